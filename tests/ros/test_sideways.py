"""The node on an emulated robot with three wheels."""

import math

from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from mrl_driver.robot.covariance import SIDEWAYS_M2_S2
from ros1_bridge.node.tf_names import OMNI_JOINTS
from tests.waiting import wait_until


def test_linear_y_drives_it_to_the_left(rig):
    """The model is found by the board's id; pose, speed and wheels tell the slide, and the silence ends it."""
    odom, joints = rig.topic("odom", Odometry), rig.topic("joint_states", JointState)
    rig.node(rig.board("--robot", "omni").port)
    odom.wait()
    rig.drive_until(lambda: odom.messages[-1].pose.pose.position.y > 0.15, 0.0, 0.2)
    message = odom.messages[-1]
    assert abs(message.pose.pose.position.x) < 0.08
    assert max(each.twist.twist.linear.y for each in odom.messages) > 0.15
    assert message.twist.covariance[7] > 10 * SIDEWAYS_M2_S2
    assert joints.wait()[-1].name == list(OMNI_JOINTS)
    assert joints.messages[-1].position[2] < 0 < joints.messages[-1].position[0]
    wait_until(lambda: math.isclose(odom.messages[-1].twist.twist.linear.y, 0.0, abs_tol=1e-9))
