"""A robot with an H-bridge board through ROS: it drives, and what its board does not measure is NaN."""

import math

import pytest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Temperature

from tests.waiting import wait_until

DRIVEN_M = 0.1


@pytest.fixture
def duo(rig):
    rig.node(rig.board("--robot", "duo").port)
    rig.odom = rig.topic("odom", Odometry)
    rig.odom.wait()
    return rig


def test_what_the_board_does_not_measure_is_nan(duo):
    battery, board = duo.topic("battery", BatteryState), duo.topic("board_temperature", Temperature)
    message = battery.wait()[-1]
    assert math.isnan(message.voltage) and math.isnan(message.percentage)
    assert math.isnan(board.wait()[-1].temperature)


def test_it_drives(duo):
    cmd_vel = duo.publisher("cmd_vel", Twist)

    def has_driven():
        cmd_vel.publish(Twist(Vector3(0.2, 0, 0), Vector3()))
        return duo.odom.wait()[-1].pose.pose.position.x > DRIVEN_M

    wait_until(has_driven, step_s=0.1)
