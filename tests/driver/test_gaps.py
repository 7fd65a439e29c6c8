"""Gaps in telemetry: what the robot went meanwhile is bridged, or reported as lost."""

import math

import pytest

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.robot.models import load
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.events import PathUnknown, Ready
from mrl_driver.session.session import STOPPING_S
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.board.board2013 import Board2013
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.fake_board import FakeBoard

from .talk import Talk

ERROR_M = 0.005  # A drive bridged over gaps in which it turned ends this near to the true pose
DAMAGED_ERROR_M = 0.01
"""The same for 3 m with a gap in each second.  48 drives of 12 seeds ended 2 mm away in the median, 7 mm at most."""


class Drive:
    """A robot that drives about while the line is as `fault` says."""

    def __init__(self, fault, make=PythonBoard, options=DEFAULTS, seed=1):
        self.plant = Plant(load("traxbot"), World(), (0.0, 0.0, 0.0))
        self.line = FaultyEngine(make(self.plant), [fault], seed)
        self.robot, self.events = SteppedDriver(self.line, "traxbot", options), []
        self.robot.on_event(self.events.append)
        self.robot.connect()

    def run(self, seconds):
        end_s = self.robot.now_s + seconds
        while self.robot.now_s < end_s:
            self.robot.drive(0.25, 0.5 if int(self.robot.now_s) % 4 < 2 else -0.5)
            self.robot.wait(0.1)
        self.line.clear()
        self.robot.wait(2.0)
        self.robot.stop()
        self.robot.wait(1.0)
        return self

    def seen(self, kind):
        return [event for event in self.events if isinstance(event, kind)]

    @property
    def error_m(self):
        true = self.plant.true_pose
        return math.dist(self.robot.pose[:2], (true.x_m, true.y_m))


def real_image(plant):
    """The firmware's image on a simulated chip."""
    return AvrEngine(plant, robot_id=plant.model.ids[0])


@pytest.mark.parametrize("make", [PythonBoard, real_image])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["loss", "change"])
def test_heavy_damage_neither_loses_the_way_nor_makes_restarts(kind, seed, make):
    drive = Drive(f"{kind}:rate=0.03,direction=to_host,at=1", make, seed=seed).run(12.0)
    assert drive.error_m < DAMAGED_ERROR_M
    assert drive.robot.link.statistics.restarts == 0 and not drive.seen(PathUnknown)


@pytest.mark.parametrize("make", [PythonBoard, real_image])
@pytest.mark.parametrize("gap_s", [2, 4, 9])
def test_after_a_silence_of_the_same_boot_nothing_is_missed(gap_s, make):
    drive = Drive(f"loss:rate=1,at=5,lasts={gap_s}", make).run(8.0)
    assert drive.error_m < ERROR_M
    assert [event.restarted for event in drive.seen(Ready)] == [True, False]


@pytest.mark.parametrize(
    "make, options",
    [(Board2013, DEFAULTS), (PythonBoard, DEFAULTS._replace(watchdog_ms=0))],
    ids=["2013", "without watchdog"],
)
def test_a_robot_that_may_have_driven_on_in_a_silence_has_lost_its_way(make, options):
    drive = Drive("loss:rate=1,at=6,lasts=4", make, options).run(12.0)
    lost = drive.seen(PathUnknown)
    assert len(lost) == 1
    assert 3.5 < lost[0].gap_s < 6.0 and lost[0].turn_rad == math.pi


@pytest.mark.parametrize("silent_s", [0.0, 5.0])
def test_a_board_that_restarts_loses_what_the_wheels_coast_until_its_watchdog_acts_and_no_more(silent_s):
    state, talk = RobotState(load("traxbot")), Talk(FakeBoard()).until_ready().run(0.5)
    talk.board.mute = silent_s > 0.0
    talk.run(silent_s)
    talk.board.mute = False
    talk.board.reset(talk.now)
    talk.until(lambda: len(talk.seen(Ready)) == 2).run(0.2)
    events = [found for event in talk.events for found in state.digest(event, talk.now)]
    lost = [event for event in events if isinstance(event, PathUnknown)]
    assert len(lost) == 1 and max(0.28, silent_s) < lost[0].gap_s < silent_s + 1.0
    coast_s = min(lost[0].gap_s, DEFAULTS.watchdog_ms / 1000 + STOPPING_S)
    assert lost[0].distance_m == pytest.approx(state.model.limits.linear_m_s * coast_s)
