"""The tables of the bridge's README are what the running node offers."""

import re

import pytest
import rospy
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from ros1_bridge.navigation import follow_waypoints_node, go_to_goal_node, map_to_odom_node
from ros1_bridge.node.robot_parameters import ROWS
from ros1_bridge.relay import relay_settings
from ros1_bridge.teleop import joystick_node, keyboard_node
from ros1_bridge.web import web_node
from ros1_bridge.world import mirror_node, world_node
from tests.waiting import wait_until

from .rig import ROOT, START_S
from .tables import README, Offered, cells_of, first_two, table


@pytest.fixture(scope="module")
def offered(module_rig):
    rig = module_rig
    rig.node(
        rig.board("--robot", "traxbot", "--imu").port,
        "_allow_calibration:=true",
        "_allow_gains:=true",
        "_zones:=both",
    )
    rig.tf, rig.static = rig.topic("/tf", TFMessage), rig.topic("/tf_static", TFMessage)
    rig.topic("odom", Odometry).wait()
    rospy.wait_for_service(f"{rig.ns}/robot_node/gains/set_parameters", START_S)
    made = Offered(rig)
    made.rig = rig
    wait_until(lambda: "/diagnostics" in made.topics(0))
    return made


def test_published_topics_are_those_of_the_table(offered):
    assert offered.topics(0) == first_two(table("### Published topics", "topic"))


def test_subscribed_topics_are_those_of_the_table(offered):
    assert offered.topics(1) == first_two(table("### Subscribed topics", "topic"))


def test_services_are_those_of_the_table(offered):
    assert offered.services() == first_two(table("### Services", "service"))


def test_frames_are_those_of_the_table(offered):
    rig, wanted = offered.rig, first_two(table("### Frames", "frame"))

    def seen():
        every = [t for topic in (rig.tf, rig.static) for m in topic.messages for t in m.transforms]
        own = [t for t in every if t.child_frame_id.startswith(f"{rig.name}/")]
        return {t.child_frame_id.split("/")[1]: t.header.frame_id.split("/")[1] for t in own}

    wait_until(lambda: seen() == wanted), seen()


@pytest.mark.parametrize(
    "heading, rows",
    [
        ("### Parameters", ROWS),
        ("### Parameters of `go_to_goal`", go_to_goal_node.PARAMETERS),
        ("### Parameters of `follow_waypoints`", follow_waypoints_node.PARAMETERS),
        ("### Parameters of `map_to_odom`", map_to_odom_node.PARAMETERS),
        ("### Parameters of `world_node`", world_node.PARAMETERS),
        ("### Parameters of `topic_relay`", relay_settings.PARAMETERS),
        ("### Parameters of `mirror_node`", mirror_node.PARAMETERS),
        ("### Parameters of `web_node`", web_node.PARAMETERS),
        ("### Parameters of `teleop_keyboard`", keyboard_node.PARAMETERS),
        ("### Parameters of `teleop_joystick`", joystick_node.PARAMETERS),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_parameters_are_those_of_the_table(heading, rows):
    assert table(heading, "parameter") == [cells_of(row) for row in rows]


def test_launch_files_are_those_of_the_table():
    named = re.findall(r"`(\w+\.launch)`", README.split("## Launch files")[1].split("\n## ")[0])
    assert sorted(named) == sorted(path.name for path in (ROOT / "ros1_bridge" / "launch").glob("*.launch"))
