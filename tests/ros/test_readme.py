"""The tables of the bridge's README are what the running node offers."""

import re

import pytest
from tf2_msgs.msg import TFMessage

from ros1_bridge.navigation import follow_waypoints_node, go_to_goal_node, map_to_odom_node
from ros1_bridge.node.robot_parameters import ROWS
from ros1_bridge.relay import relay_settings
from ros1_bridge.teleop import joystick_node, keyboard_node
from ros1_bridge.web import web_node
from ros1_bridge.world import environment_map_node, mirror_node, world_node
from tests.waiting import wait_until

from .rig import ROOT
from .tables import README, cells_of, first_two, table


def test_frames_are_those_of_the_table(rig):
    tf, static = rig.topic("/tf", TFMessage), rig.topic("/tf_static", TFMessage)
    rig.node(rig.board("--robot", "traxbot", "--imu").port)
    wanted = first_two(table("### Frames", "frame"))

    def seen():
        every = [t for topic in (tf, static) for m in topic.messages for t in m.transforms]
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
        ("### Parameters of `environment_map`", environment_map_node.PARAMETERS),
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
