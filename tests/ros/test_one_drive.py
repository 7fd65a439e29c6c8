"""One drive through real ROS; the other files of this folder have the details."""

from nav_msgs.msg import Odometry

from tests.waiting import wait_until

STOP = 13


def test_the_node_follows_cmd_vel_and_stops_when_it_ends(rig):
    wire = rig.tap(rig.board().port)
    rig.node(wire.port)
    odom = rig.topic("odom", Odometry)
    begin_m = odom.wait()[-1].pose.pose.position.x
    rig.drive_until(lambda: odom.messages[-1].pose.pose.position.x > begin_m + 0.05)
    wire.wait_for(STOP, wire.sent[-1][0])
    wait_until(lambda: odom.wait_for_more(2)[-1].twist.twist.linear.x == 0.0)
