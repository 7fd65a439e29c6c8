"""Layout wiimote of `teleop_joystick.launch`, with a stand-in for its node that publishes as the real one does."""

import os
import sys

import pytest
from geometry_msgs.msg import Twist

from .rig import ROOT

LAUNCH = ROOT / "ros1_bridge" / "launch" / "teleop_joystick.launch"
PACKAGE = "<package format='2'><name>wiimote</name><version>1.0.0</version></package>"
NODE = """#!/usr/bin/python3
# wiimote_node of joystick_drivers: sensor_msgs/Joy on `joy`, button 3 is B, 7 is right on the cross.
import rospy
from sensor_msgs.msg import Joy
rospy.init_node("wiimote")
out = rospy.Publisher("joy", Joy, queue_size=1)
while not rospy.is_shutdown():
    out.publish(Joy(axes=[0.0] * 3, buttons=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]))
    rospy.sleep(0.05)
"""


@pytest.fixture
def wiimote(tmp_path):
    """Folder of the package."""
    folder = tmp_path / "packages" / "wiimote"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(PACKAGE)
    node = folder / "wiimote_node.py"
    node.write_text(NODE)
    node.chmod(0o755)
    return folder


def test_wiimote_drives_by_its_own_topic(rig, wiimote):
    twists = rig.topic("cmd_vel", Twist)
    path = os.pathsep.join((str(ROOT), str(wiimote.parent)))
    rig.env = {**rig.env, "ROS_PACKAGE_PATH": path, "ROS_NAMESPACE": rig.ns}
    program = "import sys, roslaunch; roslaunch.main(sys.argv)"
    rig.start("roslaunch", sys.executable, "-c", program, str(LAUNCH), "layout:=wiimote")
    assert twists.wait()[0].linear.x > 0
