"""The log says when a zone stops the robot."""

from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from tests.waiting import wait_until

from .rig import START_S

HELD_FRAMES = 50
"""The robot is commanded and held for this many frames after the line."""


def test_robot_that_a_zone_stops_is_told_once(rig):
    board = rig.board("--robot", "traxbot", "--pose", "1.7,0,0")
    node = rig.node(board.port, "_zones:=sonars")
    odom = rig.topic("odom", Odometry)
    odom.wait()
    out = rig.publisher("cmd_vel", Twist)

    def lines():
        out.publish(Twist(Vector3(0.2, 0, 0), Vector3()))
        odom.wait_for_more(2)
        return sum("protective zone" in line for line in node.output())

    wait_until(lines, START_S)
    assert [lines() for _ in range(HELD_FRAMES // 2)][-1] == 1
