"""Motors that a calibration turns by itself, past the driver's own watch."""

import time

import numpy as np
import pytest

from mrl_driver.apps.calibration import manoeuvres
from mrl_driver.apps.measure import host
from mrl_driver.cli.doctor import wheels
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, HostBusy, MrlError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.view.words import STOPS, stop_error
from sim_arduino.serve import factory
from tests.driver.test_inputs import stepped

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


@pytest.fixture
def suspended_after(monkeypatch):
    """The computer is suspended for an hour after each call of a robot's `wait` or `pause`."""

    def make(robot, name):
        since_boot_s, call = time.clock_gettime, getattr(robot, name)

        def suspend(seconds):
            call(seconds)
            monkeypatch.setattr(time, "clock_gettime", lambda clock: since_boot_s(clock) + 3600.0)

        monkeypatch.setattr(robot, name, suspend)

    return make


def test_a_course_does_not_go_on_when_a_suspended_computer_is_woken(driven, suspended_after):
    _, robot = driven(SILENCE, world="square")
    suspended_after(robot, "wait")
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

    def make(steps, fault="loss:rate=1,at=60"):
        _, robot = driven(fault, world="square")
        wait, waits = robot.wait, []

        def pause_in_the_third(seconds):
            wait(seconds)
            if seconds == manoeuvres.KEEP_ALIVE_S:
                waits.append(seconds)
                if len(waits) % 3 == 0 and len(waits) <= 3 * steps:
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


@pytest.mark.parametrize(
    "fault", ["loss:rate=1,at=1.5,lasts=3,direction=to_host", "reset:at=1.6"], ids=["silence", "restart"]
)
def test_a_step_is_not_made_again_after_a_long_silence_or_a_restart(paused, fault):
    """The board has forgotten the gains and ramp of the step, and who looks after the robot may have left."""
    robot, waits = paused(1, fault)
    with pytest.raises(BoardTimeout):
        manoeuvres.step(robot, manoeuvres.Track(robot), manoeuvres.MOVE_PID, (-40, 40), 1.0)
    assert len(waits) == 3


def test_a_step_is_not_made_again_after_a_suspension(paused, suspended_after):
    robot, waits = paused(1)
    suspended_after(robot, "pause")
    with pytest.raises(HostBusy):
        manoeuvres.step(robot, manoeuvres.Track(robot), manoeuvres.MOVE_PID, (-40, 40), 1.0)
    assert len(waits) == 3


@pytest.fixture
def touched(close_later):
    """A robot with inputs, at rest; `touch` makes one active for a moment in the tenth wait."""

    def make(name):
        robot = close_later(stepped())
        robot.connect()
        robot.wait(0.4)
        manoeuvres.settle(robot)
        inputs, wait, waits = robot.plant.bridge.inputs, robot.wait, []

        def touch(seconds):
            waits.append(seconds)
            inputs.pressed = {name} if len(waits) == 10 else set()
            return wait(seconds)

        robot.wait = touch
        return robot, waits

    return make


@pytest.mark.parametrize("name", ["bumper_left", "cliff_left", "emergency_stop"])
@pytest.mark.parametrize(
    "drive",
    [
        lambda robot: manoeuvres.spin_motors(robot, manoeuvres.MOVE, (40, 40), 2.5),
        lambda robot: manoeuvres.straight(robot, 1.0, manoeuvres.Speeds()),
        lambda robot: wheels.turn(robot, "left"),
    ],
    ids=["motors", "course", "doctor"],
)
def test_an_input_that_was_active_for_a_moment_ends_what_drives_by_itself(touched, name, drive):
    robot, waits = touched(name)
    with pytest.raises(BoardTimeout, match=STOPS[StopReason(name.partition("_left")[0])].why):
        drive(robot)
    assert len(waits) < 15


def test_a_stop_is_not_measured_after_an_input_was_active(touched):
    robot, waits = touched("bumper_left")
    assert host.stops(robot, moves=True).likely == "bumper_hit" and len(waits) < 15


def test_a_wheel_that_is_blocked_ends_a_step_of_the_motors(close_later):
    made = close_later(factory.make(factory.Options("duo", faults=("wheel_blocked:wheel=left",))))
    robot = SteppedDriver(made.engine)
    robot.connect()
    manoeuvres.settle(robot)
    with pytest.raises(BoardTimeout) as ended:
        manoeuvres.spin_motors(robot, manoeuvres.MOVE, (100, 100), 5.0)
    assert ended.value.code == "wheel_blocked"


@pytest.mark.parametrize(("volts", "state"), [(7.5, "empty"), (0.1, "off")])
def test_no_request_turns_motors_without_battery(driven, volts, state):
    plant, robot = driven("loss:rate=1,at=60")
    plant.robot.set_battery(volts)
    with pytest.raises(MrlError, match=f"nothing was sent: the battery is {state}"):
        for _ in range(100):
            robot.request(manoeuvres.MOVE, 40, 40)
            robot.wait(0.1)
    assert robot.stop_reason == StopReason.BATTERY and stop_error(robot, "stopped").code == f"battery_{state}"
