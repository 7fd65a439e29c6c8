"""The node takes its locks in the order of `mrl_driver.lock_order`."""

import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav_msgs.msg import Odometry
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from mrl_driver.lock_order import VARIABLE
from tests.waiting import wait_until


def test_a_node_that_does_all_at_once_takes_its_locks_in_order(rig):
    """Commands, a pose, zones, a change of mode; a wrong order would end its reading thread and with it the node."""
    rig.env = {**rig.env, VARIABLE: "1"}
    node = rig.node(rig.board("--robot", "traxbot", "--pose", "0.3,0,0").port, "_zones:=sonars")
    odom, status = rig.topic("odom", Odometry), rig.topic("status", DiagnosticStatus)
    pose = rig.publisher("pose", PoseStamped)
    odom.wait()
    rig.drive_until(lambda: odom.messages[-1].pose.pose.position.x > 0.02, 0.1)
    goal = Pose(Point(0.2, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))

    def arrived():
        """Repeats the pose: the last `cmd_vel`, on its way yet, may come after it and end its drive."""
        pose.publish(PoseStamped(Header(frame_id=f"{rig.name}/odom"), goal))
        return odom.wait_for_more(10)[-1].pose.pose.position.x > 0.1

    wait_until(arrived)
    assert rospy.ServiceProxy(f"{rig.ns}/manual_mode", SetBool)(True).success
    assert status.wait() and node.exit_code is None
    assert not [line for line in node.output() if "is taken while" in line]
