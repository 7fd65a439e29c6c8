"""A driver's session and an emulated board over a link with random faults, stepped together in injected time."""

import math
import random
from typing import List, NamedTuple, Set, Tuple

from mrl_driver.driver.options import Options
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import STOP_CODE
from mrl_driver.robot.models import load
from mrl_driver.session.events import Counts
from sim_arduino.board import PythonBoard
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.long.jumps import Jumps
from tests.long.soak.simulated import SoakDriver

FIRST_FAULT_S = 1.0  # By then the driver is connected [s]
BAD_BYTES = ("loss", "flip", "change", "swap", "repeat")
NUISANCES = (
    "loss:rate=0.003,burst=40",
    "delay:delay=0.002,jitter=0.016,direction=to_host",
    "split:size=20,gap=0.002",
    "junk:rate=300",
    "text:period=0.05",
    "flood:at=3,lasts=0.5",
    "stall:at=2.5,lasts=0.7",
    "stall:at=2.5,lasts=0.2,every=1,direction=to_host",
    "freeze:at=3,lasts=0.6",
)
BREAKS = ("unplug:at=3,lasts=0.5", "reset:at=3", "reset:at=2,every=1.7")


class Scene(NamedTuple):
    """What goes wrong, and whether the board's counters or the link start anew in between."""

    faults: Tuple[str, ...]
    breaks: bool


def scene(rng: random.Random) -> Scene:
    faults = [f"{rng.choice(BAD_BYTES)}:rate={10 ** rng.uniform(-4, -2):.5f},at={FIRST_FAULT_S}"]
    for fault in rng.sample(NUISANCES, rng.randint(0, 2)):
        faults.append(fault if "at=" in fault else f"{fault},at={FIRST_FAULT_S}")
    breaks = rng.random() < 0.4
    return Scene((*faults, rng.choice(BREAKS)) if breaks else tuple(faults), breaks)


class WatchedBoard(PythonBoard):
    """A board that notes what it carries out under the check value, and what it sends."""

    def __init__(self, plant: Plant) -> None:
        self.carried_out: List[Frame] = []
        self.sent: Set[Tuple[object, ...]] = set()
        self.checked = False
        self._replies = FrameDecoder(REPLIES, checked=True)
        super().__init__(plant)

    def advance(self, to_s: float) -> bytes:
        """As the board's; stamped frames that it sends are noted."""
        data = super().advance(to_s)
        for event in self._replies.feed(data):
            if isinstance(event, Frame) and event.stamp is not None:
                args = event.args
                self.sent.add((args[0], args[1], args[2:] or None, event.stamp.sequence))
        return data

    def carry_out(self, frame: Frame) -> None:
        if self.checked:
            self.carried_out.append(frame)
        super().carry_out(frame)

    def set_check(self, on: bool) -> None:
        self.checked = on
        super().set_check(on)

    def reset(self) -> None:
        """As the board's, which is without check value afterwards."""
        self.checked = False
        super().reset()


class FaultyRobot:
    """Robot, bad link and driver.

    Attributes:
        wrong: Values accepted under the check value, on either side, that the other side did not send.
    """

    def __init__(self, faults: Tuple[str, ...], seed: int) -> None:
        model = load("traxbot")
        self.plant = Plant(model, World(), (0.0, 0.0, 0.0))
        self.board = WatchedBoard(self.plant)
        self.engine = FaultyEngine(self.board, faults, seed)
        self.wrong: List[object] = []
        self.accepted = 0
        self._asked: Set[Frame] = set()
        self._jumps, self._receive = Jumps.of(model), self.engine.receive
        self.engine.receive = self._note_requests  # type: ignore[method-assign]
        self.driver = SoakDriver(self.engine, Options(command_timeout_s=None))
        self.driver.watch_pose(self._jumps, self._judge)
        self.driver.connect()

    def run(self, seconds: float) -> "FaultyRobot":
        self.driver.wait(seconds)
        carried_out, self.board.carried_out = self.board.carried_out, []
        self.wrong += [f for f in carried_out if f not in self._asked and f.code != STOP_CODE]
        return self

    def _note_requests(self, out: bytes) -> None:
        for part in out.split(b"@")[1:]:
            numbers = [int(token) for token in part[:-1].split(b",")]
            self._asked.add(Frame(numbers[0], tuple(numbers[1:-1])))
        self._receive(out)

    def _judge(self, event: Counts, _: float) -> None:
        if event.sequence is not None:
            self.accepted += 1
            if (event.right, event.left, event.sonars, event.sequence) not in self.board.sent:
                self.wrong.append(event)

    @property
    def jump_m(self) -> float:
        """Largest step of the pose beyond what the wheels can do in the time."""
        return self._jumps.farthest_m

    @property
    def error_m(self) -> float:
        """Distance between the odometry's position and the true one."""
        true = self.plant.true_pose
        return math.dist(self.driver.pose[:2], (true.x_m, true.y_m))

    def moves(self, seconds: float = 0.2) -> bool:
        before = self.plant.true_pose
        self.run(seconds)
        return math.dist(before[:2], self.plant.true_pose[:2]) > 1e-5


def drive(seed: int, seconds: float) -> "Tuple[FaultyRobot, Scene]":
    """A robot that was driven about while things went wrong, and what they were."""
    rng = random.Random(seed)
    what = scene(rng)
    robot = FaultyRobot(what.faults, seed)
    drive_about(robot, rng, seconds, what.breaks)
    return robot, what


def drive_about(robot: FaultyRobot, rng: random.Random, seconds: float, breaks: bool) -> None:
    """Random commands, as a person gives them; with `breaks` the motor board loses its counts now and then."""
    end_s = robot.driver.now_s + seconds
    while robot.driver.now_s < end_s:
        robot.driver.drive(rng.uniform(-0.3, 0.3), rng.uniform(-1.5, 1.5))
        if rng.random() < 0.15:
            robot.driver.stop()
        if breaks and rng.random() < 0.15:
            robot.plant.motor_board.preset_encoder(
                robot.driver.now_s, rng.choice((1, 3)), rng.randint(-32768, 32767)
            )
        robot.run(rng.uniform(0.05, 0.6))
