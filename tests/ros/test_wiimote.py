"""Layout wiimote of `teleop_joystick.launch`, with a stand-in for its node that publishes as the real one does."""

import os
import sys

import pytest
from geometry_msgs.msg import Twist

from . import stand_ins
from .rig import ROOT

LAUNCH = ROOT / "ros1_bridge" / "launch" / "teleop_joystick.launch"
NODE = """#!/usr/bin/python3
# As the node of the table in stand_ins/wiimote.yaml; button 3 is B, 7 is right on the cross.
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
    """Folder of the package, whose node publishes what the real one does."""
    assert stand_ins.table("wiimote", "wiimote_node.py").names("publishes")["joy"] == "sensor_msgs/Joy"
    folder = tmp_path / "packages"
    stand_ins.install(folder, ["wiimote"], NODE)
    return folder


def test_wiimote_drives_by_its_own_topic(rig, wiimote):
    twists = rig.topic("cmd_vel", Twist)
    path = os.pathsep.join((str(ROOT), str(wiimote)))
    rig.env = {**rig.env, "ROS_PACKAGE_PATH": path, "ROS_NAMESPACE": rig.ns}
    program = "import sys, roslaunch; roslaunch.main(sys.argv)"
    rig.start("roslaunch", sys.executable, "-c", program, str(LAUNCH), "layout:=wiimote")
    assert twists.wait()[0].linear.x > 0
