"""How many functions one frame passes through from the port to the topic, and one command on its way back."""

import json
import sys
from collections import Counter

import pytest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from tests.call_lists import DUE, Step, listed

MOST_CALLS, MOST_VALUES = 15, 3
MOST_FOR_A_COMMAND = 16
"""One more: whether its source may move the robot."""
FRAMES, COMMANDS = 150, 40
OTHER_TOPICS = {"mrl_driver/robot/sonar.py:update", "ros1_bridge/topics/publishers.py:_publish_joints"}
"""Calls with the frames that have new ranges, which are published with the joints."""


@pytest.fixture(scope="module")
def steps(module_rig, tmp_path_factory):
    """The steps of a node whose topic `odom` has a subscriber, with a command before every third frame."""
    rig, path = module_rig, tmp_path_factory.mktemp("steps") / "steps.json"
    frames = [f"_odom_frame:={rig.name}/odom", f"_base_frame:={rig.name}/base_link"]
    ros = [f"__ns:={rig.ns}", f"_port:={rig.board().port}", "_zones:=none", *frames]
    node = rig.start("robot_node", sys.executable, "-m", "tests.ros.profiled_node", str(path), *ros)
    odom, cmd_vel = rig.topic("odom", Odometry), rig.publisher("cmd_vel", Twist)
    odom.wait(FRAMES)
    for n in range(COMMANDS):
        cmd_vel.publish(Twist(Vector3(0.1 + n / 1000, 0.0, 0.0), Vector3(0.0, 0.0, 0.1)))
        odom.wait_for_more(3)
    node.signal(2)
    node.finish(10.0)
    return json.loads(path.read_text())


def most_frequent(steps):
    return Step(*Counter((tuple(calls), tuple(values)) for calls, values in steps).most_common(1)[0][0])


def nothing_due(steps):
    """The steps of frames with which no request, repeat or comparison of the wheels falls due, and for `odom` alone."""
    return [(calls, values) for calls, values in steps if not set(calls) & {*DUE, *OTHER_TOPICS}]


@pytest.mark.parametrize("robot", ["standing", "driving"])
def test_a_steady_frame_takes_few_calls_from_the_port_to_the_topic(steps, robot):
    """From the bytes that are read to the socket of the subscriber, with nothing else due."""
    step = most_frequent(nothing_due(steps[robot]))
    print(listed(step))
    assert len(step.calls) <= MOST_CALLS, listed(step)
    assert len(step.values) <= MOST_VALUES, listed(step)


def test_a_command_takes_few_calls_from_the_topic_to_the_port(steps):
    step = most_frequent(steps["commands"])
    print(listed(step))
    assert len(step.calls) <= MOST_FOR_A_COMMAND, listed(step)
