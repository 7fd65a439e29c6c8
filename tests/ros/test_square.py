"""The main job: a square, driven through ROS, ends where odometry says; a small one, for it takes real time."""

import json
import math

from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from mrl_driver.navigation.line_follower import FollowerLimits, Square
from mrl_driver.robot.models import load
from tests.waiting import wait_until

MODEL = "stingbot"
LIMITS = FollowerLimits(linear_m_s=0.5, angular_rad_s=1.8, braking_m_s2=0.16, braking_rad_s2=1.8)
SIDE_M = 0.2
SPEED = 2  # The board's time runs so many times as fast
CLOSED_M = 0.08
STILL_MESSAGES = 15
COUNT_M = load(MODEL).drive.metres_per_count
POSE_M = 0.001 + COUNT_M
YAW_RAD = math.radians(0.1) + COUNT_M / load(MODEL).drive.wheel_separation_m


def odom_pose(message):
    position, orientation = message.pose.pose.position, message.pose.pose.orientation
    return position.x, position.y, 2 * math.atan2(orientation.z, orientation.w)


def true_pose(path):
    """The newest true pose as seen from the first one."""
    rows = [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]
    first, last = rows[0], rows[-1]
    dx, dy = last["x"] - first["x"], last["y"] - first["y"]
    cos, sin = math.cos(first["yaw"]), math.sin(first["yaw"])
    return dx * cos + dy * sin, dy * cos - dx * sin, math.remainder(last["yaw"] - first["yaw"], 2 * math.pi)


def test_square_is_closed_and_odometry_ends_where_the_robot_is(rig):
    """It ends where it began, as far as the brakes allow."""
    board, odom = rig.board("--robot", MODEL, "--speed", str(SPEED)), rig.topic("odom", Odometry)
    rig.node(board.port)
    cmd_vel = rig.publisher("cmd_vel", Twist)
    odom.wait()
    square = Square(SIDE_M, LIMITS)

    def driven_on():
        linear, angular = square.command(odom_pose(odom.messages[-1]))
        cmd_vel.publish(Twist(Vector3(linear, 0, 0), Vector3(0, 0, angular)))
        odom.wait_for_more(2)
        return square.corner == 4

    wait_until(driven_on, 60.0, what="the fourth corner")
    cmd_vel.publish(Twist())
    wait_until(lambda: len(set(map(odom_pose, odom.messages[-STILL_MESSAGES:]))) == 1)
    odometry, true = odom_pose(odom.messages[-1]), true_pose(board.truth)
    assert math.dist(odometry[:2], true[:2]) < POSE_M
    assert abs(math.remainder(odometry[2] - true[2], 2 * math.pi)) < YAW_RAD
    assert math.hypot(*odometry[:2]) < CLOSED_M
