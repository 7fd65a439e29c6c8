"""Arguments that all files for a robot share: speed of the line, and whether the node starts again."""

import pytest
import roslaunch
from roslaunch import substitution_args

from .rig import ROOT

LAUNCH = ROOT / "ros1_bridge" / "launch"
FILES = {
    "traxbot.launch": "",
    "stingbot.launch": "",
    "sim.launch": "",
    "team.launch": "/robot2",
}
"""And the namespace of a robot in it."""


@pytest.fixture
def node_of(monkeypatch, tmp_path):
    """The robot node that a file starts, and its parameters."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(ROOT))
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    monkeypatch.setattr(substitution_args, "_rospack", None)

    def load(file, *arguments):
        path = str(LAUNCH / file)
        config = roslaunch.config.load_config_default([(path, list(arguments))], None, verbose=False)
        space = FILES[file]
        (node,) = (each for each in config.nodes if each.namespace + each.name == f"{space}/robot_node")
        return node, {name: each.value for name, each in config.params.items()}, f"{space}/robot_node"

    return load


@pytest.mark.parametrize("file", FILES)
def test_faster_line_and_respawn_reach_the_node(node_of, file):
    node, values, name = node_of(file, "fast:=true", "respawn:=true")
    assert node.respawn and values[f"{name}/fast"] is True


@pytest.mark.parametrize("file", [file for file in FILES if file != "sim.launch"])
def test_speed_of_the_port_reaches_the_node(node_of, file):
    ports = ["ports:=/dev/ttyACM0,/dev/ttyACM1"] if file == "team.launch" else []
    _, values, name = node_of(file, "baud:=57600", *ports)
    assert values[f"{name}/baud"] == 57600
