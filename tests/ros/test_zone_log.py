"""The log says when a zone stops the robot."""

import threading

from geometry_msgs.msg import Twist, Vector3

from tests.waiting import wait_until

from .rig import START_S

PERIOD_S = 0.05


def test_robot_that_a_zone_stops_is_told_once(rig):
    board = rig.board("--robot", "traxbot", "--pose", "1.4,0,0")
    node = rig.node(board.port, "_zones:=sonars")
    out = rig.publisher("cmd_vel", Twist)

    def stopped():
        out.publish(Twist(Vector3(0.2, 0, 0), Vector3()))
        threading.Event().wait(PERIOD_S)
        return any("protective zone" in line for line in node.output())

    wait_until(stopped, START_S)
    assert sum("protective zone" in line for line in node.output()) == 1
