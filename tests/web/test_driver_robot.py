"""The robot behind the page, over a driver in simulated time."""

import json
import math
from functools import partial
from types import SimpleNamespace

import pytest

from mrl_driver.apps.web.driver_robot import DriverRobot
from mrl_driver.apps.web.helm import Goal, why_of
from mrl_driver.apps.web.robot import PhoneReading
from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.protocol.stop_reason import StopReason
from sim_arduino.serve import factory

STEP_S = 0.05


class Robot:
    """A `DriverRobot` on an emulated board."""

    def __init__(self, folder, **options):
        self._emulated = factory.make(factory.Options(**options))
        self.driver = SteppedDriver(self._emulated.engine, options=Options(command_timeout_s=0.2))
        self.driver.connect()
        self.page = DriverRobot(self.driver, str(folder))

    def follow(self, command, seconds):
        """Give a command every 50 ms, as a page does; why it was refused."""
        end_s = self.driver.now_s + seconds
        while self.driver.now_s < end_s:
            why = command()
            if why is not None:
                return why
            self.driver.wait(STEP_S)
        return None

    def close(self):
        self.driver.close()
        self._emulated.close()


@pytest.fixture
def robot(tmp_path, close_later):
    return close_later(Robot(tmp_path))


def test_it_drives_while_commands_come_and_stops_0_2_s_after_the_last(robot):
    assert robot.follow(lambda: robot.page.drive(0.2, 0.0, 0.0, 0.01), 0.5) is None
    robot.driver.wait(0.14)
    assert robot.page.stopped_by is None and robot.driver.command is not None
    robot.driver.wait(0.07)
    assert "no new command arrived in time" in robot.page.stopped_by.words


def test_a_stop_between_two_commands_is_not_overridden_by_the_next(robot):
    robot.page.drive(0.2, 0.0, 0.0, 0.01)
    robot.driver.wait(0.3)
    assert "no new command arrived in time" in robot.page.drive(0.2, 0.0, 0.0, 0.01).words
    robot.page.stop()
    assert robot.page.drive(0.2, 0.0, 0.0, 0.01) is None


def test_a_latched_stop_refuses_commands_until_it_is_released(robot):
    robot.page.latch()
    assert "release it" in robot.page.drive(0.2, 0.0, 0.0, 0.01).words
    assert robot.page.latched and robot.driver.command is None
    robot.page.release()
    assert robot.page.drive(0.2, 0.0, 0.0, 0.01) is None


def test_a_held_goal_is_reached(robot):
    goal = Goal(0.3, 0.0)
    assert robot.follow(lambda: robot.page.go(goal, 0.01), 20.0) == why_of(StopReason.GOAL_REACHED)
    robot.page.stop()
    robot.driver.wait(1.0)
    assert robot.driver.pose.x_m == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize("stopped", [True, False])
def test_after_a_stop_the_next_step_begins_a_new_search(robot, monkeypatch, stopped):
    """Otherwise time without progress would count while nobody held the control."""
    monkeypatch.setattr("mrl_driver.apps.web.robot.GoalSeeker", partial(GoalSeeker, patience_s=1.0))
    goal = Goal(5.0, 0.0)
    assert robot.page.go(goal, 0.01) is None
    if stopped:
        robot.page.stop()
    robot.driver.wait(2.0)
    why = robot.page.go(goal, 0.01)
    assert (why is None) is stopped and (stopped or why.reason is StopReason.GOAL_BLOCKED)


def test_a_board_without_motors_has_no_goal(tmp_path):
    robot = Robot(tmp_path, robot="pioneer", robot_id=7)
    assert "no motors" in robot.page.go(Goal(1.0, 0.0), 0.01).words
    robot.close()


def recording_driver(path=""):
    """A driver that records, as far as `DriverRobot` looks at it."""
    notes = []
    nothing = lambda *_: None  # noqa: E731
    return SimpleNamespace(
        warning="", model=None, on_telemetry=nothing, on_event=nothing, on_sensor=nothing, notes=notes,
        recorder=SimpleNamespace(
            file=SimpleNamespace(path=path) if path else None,
            remark=notes.append, start=notes.append, stop=lambda: "2 lines lost",
        ),
    )  # fmt: skip


def phone(**angles):
    angles = {"alpha_deg": 1.0, "beta_deg": math.nan, "gamma_deg": 3.0, **angles}
    return PhoneReading(5.0, absolute=True, acceleration_m_s2=(0.0, 0.0, 9.8), rotation_deg_s=None, **angles)


@pytest.fixture
def recorder(tmp_path, monkeypatch):
    monkeypatch.setattr("mrl_driver.apps.web.robot.Series", lambda driver: None)
    (tmp_path / "old.mrl").write_bytes(b"12345")
    (tmp_path / "secret.txt").write_bytes(b"1")
    driver = recording_driver(str(tmp_path / "old.mrl"))
    return driver, DriverRobot(driver, str(tmp_path))


def test_readings_of_the_phone_go_into_the_recording(recorder):
    driver, robot = recorder
    robot.phone(phone())
    (note,) = driver.notes
    facts = json.loads(note.partition(" ")[2])
    assert facts["beta_deg"] is None and facts["acceleration_m_s2"] == [0.0, 0.0, 9.8]


def test_only_recordings_are_listed_and_found(recorder):
    _, robot = recorder
    assert robot.recordings.files() == [("old.mrl", 5, True)]
    for name in ("secret.txt", "../old.mrl", ""):
        with pytest.raises(ConfigError, match="no recording"):
            robot.recordings.path(name)


@pytest.mark.parametrize("clock", ["11", "121"], ids=["one second", "clock set back"])
def test_no_recording_replaces_another(recorder, monkeypatch, clock):
    _, robot = recorder
    seconds = iter(clock)
    monkeypatch.setattr("time.strftime", lambda form: next(seconds))
    assert len({robot.recordings.start() for _ in clock}) == len(clock)
