"""A TraxBot of 2013 with environment sensors: what its node publishes, and how it drives."""

import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry

from ros1_bridge.topics import sensor_topics
from tests.waiting import wait_until

from .rig import ROOT


@pytest.fixture(scope="module")
def robot(module_rig):
    """The node of such a robot, whose `build` names its sensors; topics with their messages."""
    rig = module_rig
    port = rig.board("--robot", "traxbot", "--profile", "2013-august", "--environment").port
    rig.sensors = {
        name: rig.topic(name, sensor_topics.KINDS[each.type].message)
        for name, each in sensor_topics.load().items()
        if name != "compass"
    }
    rig.odometry = rig.topic("odom", Odometry)
    rig.process = rig.node(port, "_build:=environment")
    rig.odometry.wait()
    return rig


def test_sensors_are_published_as_those_of_newer_boards(robot):
    values = {name: topic.wait()[-1].data for name, topic in robot.sensors.items()}
    assert len(values.pop("thermopile")) == 8
    assert values == {"alcohol": 123, "dust": 300.0, "light": 500}


def test_neither_ranges_nor_a_compass_are_advertised(robot):
    names = [name for name, _ in rospy.get_published_topics(robot.ns)]
    assert names and not [name for name in names if "/sonar/" in name or name.endswith("/compass")]


def test_pose_goal_drives_and_warns_that_the_robot_is_blind(robot):
    goal = PoseStamped()
    goal.header.frame_id = f"{robot.name}/base_link"
    goal.pose.position.x, goal.pose.orientation.w = 0.05, 1.0
    robot.publisher("pose", PoseStamped).publish(goal)
    wait_until(lambda: robot.odometry.messages[-1].pose.pose.position.x > 0.01)
    assert any("this board has no sonars" in line for line in robot.process.output())


def test_a_bag_has_the_sensors_too():
    text = (ROOT / "ros1_bridge" / "launch" / "record.launch").read_text(encoding="utf-8")
    topics = text.partition('name="topics" default="')[2].partition('"')[0].split()
    assert set(sensor_topics.load()) <= set(topics)
