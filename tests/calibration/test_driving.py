"""Motors that a calibration turns by itself, past the driver's own watch."""

import time

import numpy as np
import pytest

from mrl_driver.apps.calibration import manoeuvres
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, HostBusy
from sim_arduino.serve import factory

SILENT_S, STOPPED_S = 1.0, 0.6
SILENCE = f"loss:rate=1,at={SILENT_S},direction=to_host"


@pytest.fixture
def driven(close_later):
    """Makes an emulated robot and its driver, at rest; the line has a fault from one second on."""

    def make(fault, **options):
        made = close_later(factory.make(factory.Options(robot="traxbot", faults=(fault,), **options)))
        robot = SteppedDriver(made.engine)
        robot.connect()
        manoeuvres.settle(robot)
        assert robot.now_s < SILENT_S
        return made.plant, robot

    return make


def test_a_short_silence_does_not_end_a_course(driven):
    plant, robot = driven(SILENCE + ",lasts=0.8", footprint="none")
    manoeuvres.straight(robot, 0.5, manoeuvres.Speeds())
    assert plant.true_pose.x_m == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("fault", [SILENCE, f"reset:at={SILENT_S}"], ids=["silence", "restart"])
def test_a_silence_or_a_restart_ends_a_course_and_the_robot_stands(driven, fault):
    """The counters of a board that has started again have lost a part of the way."""
    plant, robot = driven(fault, footprint="none")
    with pytest.raises(BoardTimeout, match="accepted no command"):
        manoeuvres.straight(robot, 0.5, manoeuvres.Speeds())
    robot.wait(0.5)
    assert all(motor.at_rest for motor in plant.robot.motors)


def test_a_course_does_not_go_on_when_a_suspended_computer_is_woken(driven, monkeypatch):
    _, robot = driven(SILENCE, world="square")
    since_boot_s, wait = time.clock_gettime, robot.wait

    def suspend(seconds):
        wait(seconds)
        monkeypatch.setattr(time, "clock_gettime", lambda clock: since_boot_s(clock) + 3600.0)

    monkeypatch.setattr(robot, "wait", suspend)
    with pytest.raises(BoardTimeout):
        manoeuvres.straight(robot, 0.5, manoeuvres.Speeds())
    assert robot.command is None and robot.now_s < SILENT_S


def test_motors_are_not_turned_on_without_telemetry(driven):
    plant, robot = driven(SILENCE, world="square")
    with pytest.raises(
        BoardTimeout, match="the motors did not turn on: no data arrived from the robot"
    ) as ended:
        manoeuvres.spin_motors(robot, manoeuvres.MOVE_PID, (-40, 40), 5.0)
    assert ended.value.code == "no_telemetry"
    assert robot.now_s < SILENT_S + STOPPED_S
    robot.wait(0.5)
    assert all(motor.at_rest for motor in plant.robot.motors)


@pytest.fixture
def paused(driven, monkeypatch):
    """A robot whose computer pauses in the third wait of each of the first steps; and the waits."""

    def make(steps):
        _, robot = driven("loss:rate=1,at=60", world="square")
        wait, waits = robot.wait, []

        def pause_in_the_third(seconds):
            wait(seconds)
            waits.extend([seconds] if seconds == manoeuvres.KEEP_ALIVE_S else [])
            if waits and len(waits) % 3 == 0 and len(waits) <= 3 * steps:
                robot.pause(0.4)

        monkeypatch.setattr(robot, "wait", pause_in_the_third)
        return robot, waits

    return make


def test_motors_that_stood_while_the_computer_was_busy_are_not_measured(paused):
    """The board's watchdog stopped them, and the step would go on in its middle."""
    robot, waits = paused(1)
    with pytest.raises(HostBusy, match="the computer that drives the robot was too busy"):
        manoeuvres.spin_motors(robot, manoeuvres.MOVE_PID, (-40, 40), 1.0)
    assert len(waits) == 3


def test_a_step_in_which_the_computer_was_busy_is_made_again(paused):
    robot, waits = paused(2)
    track = manoeuvres.Track(robot)
    manoeuvres.step(robot, track, manoeuvres.MOVE_PID, (-40, 40), 1.0)
    assert len(waits) == 3 + 3 + 10 and np.ptp(track.rows()[:, 0]) == pytest.approx(1.0, abs=0.05)


def test_a_step_on_a_computer_that_stays_busy_ends_with_the_reason(paused):
    robot, waits = paused(3)
    with pytest.raises(HostBusy):
        manoeuvres.step(robot, manoeuvres.Track(robot), manoeuvres.MOVE_PID, (-40, 40), 1.0)
    assert len(waits) == 3 + 3 + 3
