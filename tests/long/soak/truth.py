"""What the wheels of an emulated robot really did: when its motors were driven, in the time of its physics."""

from collections import deque
from typing import Any, Callable, Deque, List, NamedTuple, Optional

from sim_arduino.hardware.motor import Mode
from sim_arduino.hardware.wiring import Plant

ON_THE_WAY_S = 0.05  # A command that was given before reaches the motors within this time [s]
PULSE_S = 0.005
"""Motors that are driven for less than this while no wheel turns do not count as motion: a line that stalled delivers
a move together with the stop that follows it [s]."""
REMEMBERED = 4000  # Edges that are kept; the oldest are forgotten


class Edge(NamedTuple):
    """The motors began to be driven, or ceased to be, at this time of the plant [s]."""

    time_s: float
    driven: bool
    reason: str = ""  # Why the board has stopped the motors, as it says itself
    turned: bool = False  # Whether a wheel turned since the edge before


class Truth:
    """Notes each edge between driven and not driven of a robot with an OMNI-3MD.

    The physics is called in pieces between two commands of the motor board, so that each edge has its exact time.

    Attributes:
        driven: a motor is asked to turn; braked or asked for zero, it is not.
        edges: the last edges, oldest first.
    """

    def __init__(self, plant: Plant, reason: Callable[[], str] = str) -> None:
        self.plant, self._reason = plant, reason
        self.driven = self._turned = False
        self.edges: Deque[Edge] = deque(maxlen=REMEMBERED)
        step = plant.robot.step

        def watched(dt: float) -> None:
            self._look()
            step(dt)
            self._turned = self._turned or self.turning

        plant.robot.step = watched  # type: ignore[method-assign]

    def _look(self) -> None:
        driven = any(map(_is_driven, self.plant.robot.motors))
        if driven != self.driven:
            self.edges.append(Edge(self.plant.motor_board.time_s, driven, self._reason(), self._turned))
            self.driven, self._turned = driven, self.turning

    @property
    def turning(self) -> bool:
        return any(motor.speed != 0.0 for motor in self.plant.robot.motors)

    def since(self, time_s: float) -> List[Edge]:
        """The edges after a time [s]."""
        return [edge for edge in list(self.edges) if edge.time_s > time_s]

    def driven_at(self, time_s: float) -> bool:
        """Whether the motors were driven at a time that is not forgotten yet [s]."""
        before = [edge.driven for edge in list(self.edges) if edge.time_s <= time_s]
        return before[-1] if before else False


class Window(NamedTuple):
    """What happened between two times in which nobody asked the robot to move.

    `stopped_s` is the time from the beginning to the end of the motion (0: it stood); None if it never ended.
    `again` counts how often the motors were driven again, without the `pulses` that moved nothing (`PULSE_S`).
    """

    stopped_s: Optional[float]
    again: int
    pulses: int = 0


def judge(truth: Truth, from_s: float, to_s: float, on_the_way_s: float = ON_THE_WAY_S) -> Window:
    """Judge a time in which no new command may move the robot; one may be on the way for so long at its beginning."""
    edges = [edge for edge in truth.since(from_s) if edge.time_s <= to_s]
    late = from_s + on_the_way_s
    on_the_way = [edge for edge in edges if edge.driven and edge.time_s <= late]
    pulses = sum(edge.time_s > late and _is_pulse(edge, end) for edge, end in zip(edges, edges[1:]))
    again = sum(edge.driven for edge in edges) - len(on_the_way) - pulses
    if not truth.driven_at(from_s) and not on_the_way:
        return Window(0.0, again, pulses)
    moved_s = on_the_way[-1].time_s if on_the_way else from_s
    ends = [edge.time_s for edge in edges if not edge.driven and edge.time_s >= moved_s]
    return Window(ends[0] - from_s if ends else None, again, pulses)


def _is_pulse(edge: Edge, end: Edge) -> bool:
    return edge.driven and not end.turned and end.time_s - edge.time_s < PULSE_S


def _is_driven(motor: Any) -> bool:
    if motor.mode is Mode.DUTY:
        return bool(motor.duty)
    return motor.mode is not Mode.BRAKE and bool(motor.target)
