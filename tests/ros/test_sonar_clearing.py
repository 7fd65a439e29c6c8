"""The sonar layer clears readings of max_range alone; navigation.launch lets the running node report them."""

import math

import roslib.packages
import rospy
from sensor_msgs.msg import Range

from tests.waiting import wait_until

from .rig import START_S
from .test_launch_packages import CLEARING


def test_running_node_reports_the_longest_range_when_it_is_requested(rig, tmp_path):
    """On a floor without end."""
    world = tmp_path / "far.yaml"
    world.write_text("walls: [[99, -9, 99, 9]]\n")
    rig.node(rig.board("--robot", "traxbot", "--world", str(world)).port)
    sonar = rig.topic("sonar/front", Range)
    assert sonar.wait()[-1].range == math.inf
    (program,) = roslib.packages.find_node("dynamic_reconfigure", "dynparam")
    child = rig.start(
        "dynparam", "/usr/bin/python3", program, *CLEARING.split(), f"__ns:={rig.ns}", "__name:=once"
    )
    wait_until(lambda: sonar.messages[-1].max_range < 0.71, START_S)
    wait_until(lambda: child.exit_code == 0)
    assert rospy.get_param(f"{rig.ns}/robot_node/clear_range") == 0.7, "a respawned node forgets it"
