"""Wheels that do not do what they are told, and all the driving in which they do, on the emulated motors."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.robot.odometry import Wheels
from mrl_driver.safety.wheel_monitor import (
    DEAD,
    GAP_S,
    POWERLESS,
    REVERSED,
    monitor_of,
)
from mrl_driver.session.motion_command import QUICK, SLOW
from sim_arduino.hardware.omni3md import Omni3MD
from sim_arduino.hardware.robot_physics import RobotPhysics, params_for
from tests.models import model as load

NOTICED_S = 0.5
FRAME_S, FRAME_2013_S = 0.02, 1 / 325
LOOKED_AT_S, LOOKED_AT_2013_S = 3 * FRAME_S, 17 * FRAME_2013_S
"""The frames that the watch looks at: the first ones after TICK_S."""
MODELS = ("traxbot", "stingbot")


def sound(right, left):
    return right, left


def counting(right_share, left_share):
    """A fault from the next reading on: encoders that count a share of the way, 0 or -1 of it."""

    def begun(drive):
        at = drive.travel()
        return lambda right, left: (
            at.right + right_share * (right - at.right),
            at.left + left_share * (left - at.left),
        )

    return begun


frozen_left, both_frozen = counting(1, 0), counting(0, 0)
FAULTS = [
    (counting(0, 1), "right", DEAD),
    (frozen_left, "left", DEAD),
    (counting(-1, 1), "right", REVERSED),
    (counting(1, -1), "left", REVERSED),
    (both_frozen, "both", POWERLESS),
]


class Drive:
    """A robot's motors and board, its counts as the driver gets them, and the watch."""

    def __init__(self, name="traxbot", control_hz=20, frame_s=FRAME_S, pace=QUICK, volts=12.0):
        model = load(name)
        self.robot = RobotPhysics(params_for(model)._replace(control_hz=control_hz))
        self.robot.set_battery(volts)
        self.motors = Omni3MD(self.robot, model)
        self.motors.set_gains(0, *(model.board[key] for key in ("kp", "ki", "kd")))
        self.motors.set_ramp(0, model.board["ramp_time"], model.board["ramp_gain"])
        self.watch = monitor_of(model, pace)
        self.frame_s, self.now, self.told = frame_s, 0.0, (0.0, 0.0)
        self.fault = sound
        self.found = None

    def travel(self):
        left, _, right = (math.floor(motor.travel) for motor in self.robot.motors)
        return Wheels(*self.fault(right, left))

    def command(self, linear_m_s, angular_rad_s):
        self.told = linear_m_s, angular_rad_s
        self.motors.move_differential(self.now, round(linear_m_s * 1000), round(angular_rad_s * 1000))

    def run(self, seconds, late=None):
        """Until a mismatch; `late` is a command that is in force already, and reaches the motors on the way."""
        end, due = self.now + seconds, math.inf
        if late:
            self.told, due = late[1:], self.now + late[0]
            self.look(self.now)
        while self.now < end and self.found is None:
            self.look(min(self.now + self.frame_s, max(due, self.now), end))
            if self.now >= due:
                self.command(*self.told)
                due = math.inf
        return self.found

    def look(self, now):
        """What the watch says of a frame at that time."""
        self.now = now
        self.motors.advance(now)
        self.found = self.found or self.watch.update(*self.told, self.travel(), now)


SPEEDS = [(0.3, 0.0), (-0.2, 0.0), (0.0, 1.0), (0.2, -0.5), (0.05, 0.0)]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("speeds", SPEEDS)
@pytest.mark.parametrize(("fault", "wheel", "cause"), FAULTS)
def test_a_wheel_that_fails_on_the_move_is_named_in_time(name, speeds, fault, wheel, cause):
    drive = Drive(name)
    drive.command(*speeds)
    assert drive.run(4.0) is None
    drive.fault, failed_s = fault(drive), drive.now
    found = drive.run(2.0)
    assert (found.wheel, found.cause) == (wheel, cause)
    assert drive.now - failed_s <= NOTICED_S


@pytest.mark.parametrize("phase", range(10))
@pytest.mark.parametrize(
    "frame_s, pace, noticed_s",
    [
        (0.005, QUICK, NOTICED_S),
        (0.05 - 30e-6, QUICK, NOTICED_S - 0.1),
        (FRAME_2013_S, SLOW, NOTICED_S),
    ],
    ids=["quick stream", "monitor's own period", "2013 board"],
)
def test_the_moment_of_the_fault_does_not_matter(phase, frame_s, pace, noticed_s):
    """Board times are whole ticks, so that some frames of a stream at the monitor's period come a little early."""
    drive = Drive(frame_s=frame_s, pace=pace)
    drive.command(0.2, 0.0)
    assert drive.run(4.0 + phase * 0.005) is None
    drive.fault, failed_s = frozen_left(drive), drive.now
    assert drive.run(2.0).wheel == "left"
    assert drive.now - failed_s <= noticed_s


@pytest.mark.parametrize(("fault", "wheel", "cause"), FAULTS)
def test_a_robot_that_cannot_start_is_noticed_within_a_second(fault, wheel, cause):
    """The ramp takes 2.5 s to full speed, so there is little to see at first."""
    drive = Drive()
    drive.fault = fault(drive)
    drive.command(0.3, 0.0)
    assert drive.run(1.0) is not None
    assert (drive.found.wheel, drive.found.cause) == (wheel, cause)


COMMANDS = st.lists(
    st.tuples(
        st.one_of(st.sampled_from([-0.3, 0.0, 0.3]), st.floats(-0.3, 0.3), st.floats(-0.03, 0.03)),
        st.one_of(st.sampled_from([-1.0, 0.0, 1.0]), st.floats(-1.0, 1.0), st.floats(-0.1, 0.1)),
        st.sampled_from([0.05, 0.1, 0.3, 1.0, 3.0]),
        st.floats(0.0, 1.0),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(COMMANDS, st.sampled_from(MODELS), st.sampled_from([10, 20, 40]), st.booleans(), st.floats(8.5, 13.8))
def test_no_driving_is_a_mismatch(commands, name, control_hz, old, volts):
    """Ramps, reversals, turns in place, creeping, late commands, at each control rate and state of charge."""
    frame_s, pace, late_s = (LOOKED_AT_2013_S, SLOW, 0.5) if old else (LOOKED_AT_S, QUICK, 0.12)
    drive = Drive(name, control_hz, frame_s, pace, volts)
    for linear, angular, seconds, lateness in commands:
        assert drive.run(seconds, (min(late_s * lateness, seconds), linear, angular)) is None


@pytest.mark.parametrize("name", MODELS)
def test_a_motor_that_breaks_loose_late_is_no_mismatch(name):
    """Friction holds it until the control has built up voltage."""
    drive = Drive(name)
    drive.fault = both_frozen(drive)
    drive.command(0.3, 0.0)
    assert drive.run(0.45) is None
    drive.fault = sound
    assert drive.run(2.0) is None


def test_after_a_gap_the_watch_begins_anew():
    """The board may have stopped the robot meanwhile, and starts it again on the next command."""
    drive = Drive()
    drive.command(0.3, 0.0)
    drive.run(3.0)
    drive.motors.stop(drive.now)
    drive.now += GAP_S + 0.1
    drive.command(0.3, 0.0)
    assert drive.run(3.0) is None
