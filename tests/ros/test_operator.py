"""The operator's delay through ROS: joystick, multiplexer and robot node, the last on an emulated board."""

import itertools
import signal
import time

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64, Header

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.safety.message_age import clock_s
from ros1_bridge.robot.operators import MOST_OPERATORS, SILENT_S, Operators
from ros1_bridge.teleop.joystick_mapping import LAYOUTS
from tests.waiting import wait_until

MOVE, STOP = 11, 13
LIMIT_S, TIMEOUT_S = 1.0, 10.0  # A busy machine answers within this time
SLOW_S = 2.0  # An echo that comes at all comes within this time, even on a busy machine
HELD, RELEASED = ([int(n == LAYOUTS["ps3"].dead_man and held) for n in range(17)] for held in (True, False))

REASON = StopReason.COMMAND_TOO_LATE


class Clock:
    now_s = 1000.0

    def __call__(self):
        return self.now_s


def test_late_commands_are_refused_by_a_clock_that_differs():
    clock = Clock()
    operators = Operators(LIMIT_S, clock)
    assert not operators.refusal("desk", 77.0)
    clock.now_s += 1.0
    assert not operators.refusal("desk", 78.0 - LIMIT_S + 0.001)
    assert "late" in operators.refusal("desk", 78.0 - LIMIT_S - 0.002)
    assert operators.refused == 1
    assert not operators.refusal("sofa", 5.0), "each operator has a clock of his own"
    assert "stamp 0" in operators.refusal("desk", 0.0) and operators.refused == 2


def test_command_that_repeats_a_stamp_is_refused_after_the_limit():
    clock = Clock()
    operators = Operators(LIMIT_S, clock)
    assert not operators.refusal("desk", 900.0)
    clock.now_s += LIMIT_S + 0.01
    assert "late" in operators.refusal("desk", 900.0)


@pytest.fixture
def crowd():
    """A clock, and as many operators as have a place; each has just sent something."""
    clock = Clock()
    operators = Operators(LIMIT_S, clock)
    for n in range(MOST_OPERATORS):
        operators.late_s(str(n), 900.0)
    return clock, operators


def test_late_commands_stay_late_whoever_else_has_sent_something(crowd):
    _, operators = crowd
    for n in range(MOST_OPERATORS):
        operators.late_s(f"other {n}", 900.0)
    assert all("late" in operators.refusal(str(n), 5.0) for n in range(MOST_OPERATORS))


def test_new_operator_without_a_place_is_refused_until_one_has_been_silent_for_long(crowd):
    clock, operators = crowd
    assert "other operators" in operators.refusal("new", 900.0) and operators.refused == 1
    clock.now_s += SILENT_S - 0.001
    assert operators.refusal("new", 900.0)
    clock.now_s += 0.001
    assert not operators.refusal("new", 900.0)


def test_new_operator_takes_the_place_of_the_one_who_was_silent_for_longest(crowd):
    clock, operators = crowd
    clock.now_s += SILENT_S
    operators.late_s("0", 900.0 + SILENT_S)
    operators.late_s("new", 900.0)
    assert not operators.refusal("1", 5.0), "it is known no longer"
    assert "late" in operators.refusal("0", 5.0)


def test_name_of_an_operator_without_a_place_is_quoted_in_one_line(crowd):
    _, operators = crowd
    refusal = operators.refusal("\x1b[2J\n[ERROR] " * 100, 900.0)
    assert refusal.isprintable() and len(refusal) < 300


def test_without_a_limit_nothing_is_refused_and_nobody_needs_a_place():
    operators = Operators(0.0, Clock())
    operators.late_s("desk", 900.0)
    names = ["desk", *map(str, range(MOST_OPERATORS))]
    assert not any(operators.refusal(name, 5.0) for name in names)


@pytest.fixture(scope="module")
def robot(module_rig):
    """The rig with all three nodes."""
    rig = module_rig
    rig.wire = rig.tap(rig.board().port)
    rig.process = rig.node(rig.wire.port, f"_max_command_delay:={LIMIT_S}", f"_cmd_vel_timeout:={TIMEOUT_S}")
    source = {"name": "joystick", "topic": "joy_vel", "timeout": 5.0, "priority": 100}
    rospy.set_param(f"{rig.ns}/cmd_vel_mux/topics", [source])
    rig.program("cmd_vel_mux")
    rig.hand = rig.program("teleop_joystick", "cmd_vel:=joy_vel", f"_max_delay:={LIMIT_S}")
    rig.delay = rig.topic("teleop_joystick/delay", Float64)
    rig.echo = rig.topic("joy_vel/echo", Header)
    rig.joy, rig.stamped = rig.publisher("joy", Joy), rig.publisher("cmd_vel/stamped", TwistStamped)
    rig.echo.wait()
    return rig


ABOVE = "above the limit of 1.0 s (~max_delay)"


def hold(robot, until, speed=1.0):
    """Holds the stick until something is so; again after 2 s on a machine that was too busy, which ends the press."""
    times = itertools.count(1)

    def there():
        robot.joy.publish(axes=[0.0, speed], buttons=HELD if next(times) % 100 else RELEASED)
        return until()

    wait_until(there, step_s=0.02)


def drive(robot, speed=1.0):
    """Holds the stick until the robot has a motion command."""
    since_s = time.monotonic()
    hold(robot, lambda: robot.wire.first(MOVE, since_s) < float("inf"), speed)


def release(robot):
    robot.joy.publish(axes=[0.0, 0.0], buttons=RELEASED)


def test_delay_of_a_joystick_is_measured_through_the_multiplexer(robot):
    drive(robot)
    echo = robot.echo.wait_for_more(1)[-1]
    assert echo.frame_id.startswith(f"{robot.ns}/teleop_joystick")
    assert 0 < clock_s() - echo.stamp.to_sec() < SLOW_S
    assert wait_until(lambda: 0 < robot.delay.wait_for_more(1)[-1].data < SLOW_S)
    release(robot)


def test_joystick_that_was_held_up_for_longer_than_clocks_are_set_does_not_drive(robot):
    """Its message of 40 s ago may be true, and is no reason to believe that a clock was set."""

    def publish(late_s, buttons):
        stamp = rospy.Time.now() - rospy.Duration(late_s)
        robot.joy.publish(header=Header(stamp=stamp), axes=[0.0, 1.0], buttons=buttons)

    def is_refused():
        publish(0.0, RELEASED)
        robot.delay.wait_for_more(1)
        publish(40.0, HELD)
        robot.delay.wait_for_more(1)
        return any("40.0 s late" in line for line in robot.process.output())

    wait_until(is_refused, step_s=0.02)
    release(robot)


def test_command_that_arrives_late_is_a_stop_and_has_no_echo(robot):
    twist, now_s = Twist(Vector3(0.1, 0, 0), Vector3()), time.monotonic()
    echoes, diagnostics = robot.topic("cmd_vel/echo", Header), robot.topic("/diagnostics", DiagnosticArray)
    status = robot.topic("status", DiagnosticStatus)
    echoes.wait()

    def sent(late_s):
        robot.stamped.publish(Header(stamp=rospy.Time.from_sec(clock_s() - late_s), frame_id="tests"), twist)

    sent(0.0)
    wait_until(lambda: any(echo.frame_id == "tests" for echo in echoes.messages))
    robot.wire.wait_for(MOVE, now_s)
    count = sum(echo.frame_id == "tests" for echo in echoes.messages)
    late_s = time.monotonic()
    sent(30.0)
    robot.wire.wait_for(STOP, late_s)
    wait_until(
        lambda: any(pair.value == REASON for message in status.messages for pair in message.values),
        what=f"a stop by {REASON}",
    )
    assert sum(echo.frame_id == "tests" for echo in echoes.messages) == count
    wait_until(  # the node logs once a second
        lambda: sent(30.0) or any("30.0 s late" in line for line in robot.process.output()), step_s=0.1
    )
    wait_until(lambda: int(robot.diagnosed(diagnostics, "Motion").get("Late Commands", "0")) > 0)


def test_stop_that_arrives_late_is_followed(robot):
    """Of operators on several machines, the last message of each has no name, and so no common clock."""
    echoes = robot.topic("cmd_vel/echo", Header)
    echoes.wait()
    for late_s in (30.0, 0.0, 60.0):
        stamp = rospy.Time.from_sec(clock_s() - late_s)
        robot.stamped.publish(Header(stamp=stamp, frame_id="stops"), Twist())
        assert wait_until(lambda sent=stamp: any(echo.stamp == sent for echo in echoes.messages))


def test_operator_stops_when_the_robot_stalls_and_drives_again_after_release(robot):
    drive(robot)
    before = len(robot.hand.output())
    robot.process.signal(signal.SIGSTOP)
    try:
        hold(robot, lambda: any(ABOVE in line for line in robot.hand.output()[before:]))
    finally:
        robot.process.signal(signal.SIGCONT)
    # the first one may have been sent before the stall was noticed
    assert wait_until(lambda: robot.delay.wait_for_more(2)[-1].data < LIMIT_S)
    held_s = time.monotonic()
    for _ in range(3):
        robot.joy.publish(axes=[0.0, 1.0], buttons=HELD)
        robot.echo.wait_for_more(1)
    moved = [
        data for at, data in robot.wire.sent if at > held_s and b"@11," in data and b"@11,0," not in data
    ]
    assert not moved, "the stick is still held, and drives only after it was released"
    release(robot)
    drive(robot)
    release(robot)
