"""One drive through real ROS; the other files of this folder have the details."""

from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from tests.waiting import wait_until

from .rig import Topic

STOP = 13


def test_the_node_follows_cmd_vel_and_stops_when_it_ends(rig):
    wire = rig.tap(rig.board().port)
    rig.node(wire.port)
    odom: Topic = rig.topic("odom", Odometry)
    cmd_vel = rig.publisher("cmd_vel", Twist)
    begin_m = odom.wait()[-1].pose.pose.position.x

    def driven():
        cmd_vel.publish(Twist(Vector3(0.2, 0.0, 0.0), Vector3()))
        return odom.wait_for_more(2)[-1].pose.pose.position.x > begin_m + 0.05

    wait_until(driven)
    wire.wait_for(STOP, wire.sent[-1][0])
    wait_until(lambda: odom.wait_for_more(2)[-1].twist.twist.linear.x == 0.0)
