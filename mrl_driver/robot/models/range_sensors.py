"""Range sensors of a robot model: their kinds, where they are mounted, and where they are connected."""

import math
from typing import Mapping, NamedTuple, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import BY_NAME, NOT_CONNECTED
from mrl_driver.robot.wiring import RANGE_PINS


class RangeKind(NamedTuple):
    """What a kind of range sensor measures."""

    infrared: bool
    field_of_view_rad: float
    nearest_m: float
    """Dead zone: what is closer reads as too near."""
    farthest_m: float
    curve: Tuple[Tuple[float, float], ...] = ()
    """Of a sensor with an analog output: distances [m] and its voltages there [V]; empty for others."""


MB1300 = RangeKind(False, math.radians(36.0), 0.15, 6.45)
HC_SR04 = RangeKind(False, math.radians(15.0), 0.02, 4.0)
_SHARP_RAD = math.radians(5.0)
GP2Y0A21 = RangeKind(
    True,
    _SHARP_RAD,
    0.1,
    0.8,
    ((0.1, 2.3), (0.2, 1.3), (0.3, 0.9), (0.4, 0.75), (0.5, 0.6), (0.6, 0.5), (0.7, 0.45), (0.8, 0.4)),
)
GP2Y0A02 = RangeKind(
    True,
    _SHARP_RAD,
    0.2,
    1.5,
    (
        (0.2, 2.45),
        (0.3, 2.0),
        (0.4, 1.53),
        (0.5, 1.25),
        (0.6, 1.05),
        (0.8, 0.8),
        (1.0, 0.67),
        (1.2, 0.55),
        (1.5, 0.4),
    ),
)
RANGE_KINDS = {"MB1300": MB1300, "HC-SR04": HC_SR04, "GP2Y0A21": GP2Y0A21, "GP2Y0A02": GP2Y0A02}
"""Range sensors by their types.

Source: data sheets of MaxBotix, ElecFreaks and Sharp (E4-A00201EN and E4-A00101EN: typical voltages at both ends, and
those between them read off the figure).  The field of view of the MB1300 is that of (Araujo 2012), Sharp's is assumed.
"""
ANALOG = tuple(name for name, kind in RANGE_KINDS.items() if kind.curve)
CHAIN_S, TURN_S, ANALOG_S = 0.3, 0.060032, 0.048
"""Three MB1300 take turns of 100 ms; one HC-SR04 of a board fires in each turn of 60 ms; an analog sensor needs at most
38.3 + 9.6 ms for a reading [s]."""
SONARS = tuple(field.name for field in BY_NAME["read_sonars"].reply)
"""Names of the sonars that each board reads."""
ECHO_INPUTS = tuple(field.name for field in BY_NAME["read_ranges"].reply)
"""Inputs of H-bridge boards for an HC-SR04 or an analog sensor each; an Uno has the first three."""


class SonarMount(NamedTuple):
    """Mounting pose of a range sensor in base_link; yaw counter-clockwise from forward."""

    x_m: float
    y_m: float
    yaw_deg: float
    input: str = ""
    """Where it is on the board: front, left or right, or range_1 to range_3 of the wiring, on a Mega to range_6; its
    name if left out."""
    type: str = ""
    """What it is; if left out, an HC-SR04 at range_1 to range_6 and an MB1300 elsewhere."""
    field_of_view_deg: float = 0.0
    """Whole angle of the cone; this and the next two are 0 for what its type has."""
    nearest_m: float = 0.0
    farthest_m: float = 0.0

    def input_of(self, name: str) -> str:
        """Return its place on the board; `name` is its own."""
        return self.input or name

    @property
    def kind(self) -> RangeKind:
        """What it measures."""
        usual = RANGE_KINDS[self.type] if self.type else HC_SR04 if self.input in ECHO_INPUTS else MB1300
        return usual._replace(
            field_of_view_rad=math.radians(self.field_of_view_deg) or usual.field_of_view_rad,
            nearest_m=self.nearest_m or usual.nearest_m,
            farthest_m=self.farthest_m or usual.farthest_m,
        )

    @property
    def pose(self) -> Pose:
        """The same as a pose, with the yaw in radians."""
        return Pose(self.x_m, self.y_m, math.radians(self.yaw_deg))


def cycle_s(sonars: Mapping[str, SonarMount]) -> float:
    """Return the time between two readings of a sonar [s]: all that are read in the same way take turns."""
    analog = sum(mount.type in ANALOG for mount in sonars.values())
    echoes = sum(mount.input in ECHO_INPUTS for mount in sonars.values()) - analog
    chain = analog + echoes < len(sonars)
    return max(TURN_S * echoes, ANALOG_S if analog else 0.0, CHAIN_S if chain else 0.0)


def echo_cycle_s(board: Mapping[str, int]) -> float:
    """Return the time between two readings of an HC-SR04 on a board with these parameters [s]; 0 without any."""
    return TURN_S * sum(board.get(trigger, NOT_CONNECTED) != NOT_CONNECTED for trigger, _ in RANGE_PINS)


def wired_types(board: Mapping[str, int], given: str) -> Tuple[str, Tuple[str, ...]]:
    """Return what an input has on the board, in words, and the types of sensors that fit."""
    if given in SONARS:
        connected = board.get(f"pin_sonar_{given}") != NOT_CONNECTED
        return "the curve of an MB1300", ("MB1300",) if connected else ()
    trigger, echo = (board.get(f"pin_{given}_{pin}", NOT_CONNECTED) for pin in ("trigger", "echo"))
    if trigger != NOT_CONNECTED:
        return "a trigger", ("HC-SR04",)
    return "an echo without a trigger", () if echo == NOT_CONNECTED else ANALOG
