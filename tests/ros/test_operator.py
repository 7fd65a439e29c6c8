"""The operator's delay through ROS: joystick, multiplexer and robot node, the last on an emulated board."""

import itertools
import signal
import time

import pytest
import rospy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64, Header

from mrl_driver.clocks import clock_s
from ros1_bridge.teleop.joystick_mapping import LAYOUTS
from tests.waiting import wait_until

MOVE, STOP = 11, 13
LIMIT_S, TIMEOUT_S = 1.0, 10.0  # A busy machine answers within this time
SLOW_S = 2.0  # An echo that comes at all comes within this time, even on a busy machine
HELD, RELEASED = ([int(n == LAYOUTS["ps3"].dead_man and held) for n in range(17)] for held in (True, False))


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
    wait_until(lambda: any("robot id" in line for line in rig.process.output()), what="a node that drives")
    return rig


ABOVE = "above the limit of 1.0 s"


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
