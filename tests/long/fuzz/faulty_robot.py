"""A driver's session and an emulated board over a link with random faults, stepped together in injected time."""

import math
import random
from typing import List, NamedTuple, Set, Tuple

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import STOP_CODE
from mrl_driver.robot.models import load
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.events import Counts, Ready
from mrl_driver.session.session import Session
from sim_arduino.board import PythonBoard
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.long.jumps import Jumps

STEP_S = 0.002
FIRST_FAULT_S = 1.0
"""By then the driver is connected."""
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
        self.model = load("traxbot")
        self.plant = Plant(self.model, World(), (0.0, 0.0, 0.0))
        self.board = WatchedBoard(self.plant)
        self.engine = FaultyEngine(self.board, faults, seed)
        self.state = RobotState(self.model)
        self.now = 0.0
        self.session = Session(self.state.admit, self.now)
        self.wrong: List[object] = []
        self._jumps = Jumps.of(self.model)
        self.accepted = 0
        self._asked: Set[Frame] = set()
        self._plugged = True

    def run(self, seconds: float) -> "FaultyRobot":
        end = self.now + seconds
        while self.now < end:
            self._step()
        return self

    def _step(self) -> None:
        self.now += STEP_S
        data = self.engine.advance(self.now)
        self._follow_cable()
        events = self.session.receive(data, self.now) if data else []
        if data or self.now >= self.session.deadline(self.now):
            events += self.session.tick(self.now)
        for event in events:
            self.state.digest(event, self.now)
            if isinstance(event, Ready) and event.restarted:
                self._jumps.restart()
            if isinstance(event, Counts):
                self._judge(event)
        out = self.session.take()
        if out and self._plugged:
            self._note_requests(out)
            self.engine.receive(out)
        self._judge_board()

    def _follow_cable(self) -> None:
        """What the driver does when its port goes away, and when it is found again."""
        if self._plugged and not self.engine.plugged:
            self.session.lose(self.now)
        elif self.engine.plugged and not self._plugged:
            self.session.relink(self.now)
        self._plugged = self.engine.plugged

    def _note_requests(self, out: bytes) -> None:
        for part in out.split(b"@")[1:]:
            numbers = [int(token) for token in part[:-1].split(b",")]
            self._asked.add(Frame(numbers[0], tuple(numbers[1:-1])))

    def _judge_board(self) -> None:
        self.wrong += [f for f in self.board.carried_out if f not in self._asked and f.code != STOP_CODE]
        self.board.carried_out.clear()

    def _judge(self, event: Counts) -> None:
        if event.sequence is not None:
            self.accepted += 1
            if (event.right, event.left, event.sonars, event.sequence) not in self.board.sent:
                self.wrong.append(event)
        self._jumps.see(self.state.odometry.pose, event.time_s, self.state.odometry.baseline.refused)

    @property
    def jump_m(self) -> float:
        """Largest step of the pose beyond what the wheels can do in the time."""
        return self._jumps.farthest_m

    @property
    def error_m(self) -> float:
        """Distance between the odometry's position and the true one."""
        true = self.plant.true_pose
        return math.dist(self.state.odometry.pose[:2], (true.x_m, true.y_m))

    def moves(self, seconds: float = 0.2) -> bool:
        before = self.plant.true_pose
        self.run(seconds)
        return math.dist(before[:2], self.plant.true_pose[:2]) > 1e-5


def drive(seed: int, seconds: float) -> "Tuple[FaultyRobot, Scene]":
    """A robot that was driven about while things went wrong, and what they were."""
    rng = random.Random(seed)
    what = scene(rng)
    robot = FaultyRobot(what.faults, seed).run(FIRST_FAULT_S)
    drive_about(robot, rng, seconds, what.breaks)
    return robot, what


def drive_about(robot: FaultyRobot, rng: random.Random, seconds: float, breaks: bool) -> None:
    """Random commands, as a person gives them; with `breaks` the motor board loses its counts now and then."""
    end = robot.now + seconds
    while robot.now < end:
        robot.session.drive((rng.randint(-300, 300), rng.randint(-1500, 1500)), robot.now)
        if rng.random() < 0.15:
            robot.session.stop(robot.now)
        if breaks and rng.random() < 0.15:
            robot.plant.motor_board.preset_encoder(robot.now, rng.choice((1, 3)), rng.randint(-32768, 32767))
        robot.run(rng.uniform(0.05, 0.6))
