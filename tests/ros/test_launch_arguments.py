"""Arguments that all files for a robot share: speed of the line, and whether the node starts again."""

import os
import shlex
import xml.etree.ElementTree as ElementTree

import pytest
import roslaunch
from roslaunch import arg_dump, substitution_args

from .rig import ROOT

LAUNCH = ROOT / "ros1_bridge" / "launch"
FILES = {
    "traxbot.launch": "",
    "stingbot.launch": "",
    "sim.launch": "",
    "team.launch": "/robot2",
}
"""And the namespace of a robot in it."""


WITHOUT_URDFS = "description:=false"
"""Of a team, where they are not looked at: a process renders each."""


@pytest.fixture(scope="module")
def config_of(tmp_path_factory):
    """What roslaunch makes of a file; `rosversion`, which it runs with each one, is stood in for.

    The checkout's path has a space and an umlaut.
    """
    folder, made = tmp_path_factory.mktemp("launch"), {}
    (folder / "my Röboter").symlink_to(ROOT)
    (folder / "rosversion").write_text("#!/bin/sh\necho 1.15.15\n")
    (folder / "rosversion").chmod(0o755)

    def load(path, *arguments):
        if (path, arguments) not in made:
            given = [(str(path), list(arguments))]
            made[path, arguments] = roslaunch.config.load_config_default(given, None, verbose=False)
        return made[path, arguments]

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", str(folder / "my Röboter"))
        patch.setenv("ROS_LOG_DIR", str(folder))
        patch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
        patch.setattr(substitution_args, "_rospack", None)
        yield load


@pytest.fixture
def node_of(config_of):
    """The robot node that a file starts with all arguments of the line that it has, and its parameters."""

    def load(file):
        arguments = ["fast:=true", "respawn:=true", *(["baud:=57600"] if file != "sim.launch" else [])]
        if file == "team.launch":
            arguments += ["ports:=/dev/ttyACM0,/dev/ttyACM1", WITHOUT_URDFS]
        config, space = config_of(LAUNCH / file, *arguments), FILES[file]
        (node,) = (each for each in config.nodes if each.namespace + each.name == f"{space}/robot_node")
        return node, {name: each.value for name, each in config.params.items()}, f"{space}/robot_node"

    return load


@pytest.mark.parametrize("file", FILES)
def test_faster_line_and_respawn_reach_the_node(node_of, file):
    node, values, name = node_of(file)
    assert node.respawn and values[f"{name}/fast"] is True


@pytest.mark.parametrize("file", [file for file in FILES if file != "sim.launch"])
def test_speed_of_the_port_reaches_the_node(node_of, file):
    _, values, name = node_of(file)
    assert values[f"{name}/baud"] == 57600


def test_robots_of_a_team_have_frames_of_their_own(node_of):
    _, values, _ = node_of("team.launch")
    frames = [
        values[f"/robot{number}/robot_node/{key}_frame"] for number in (1, 2) for key in ("odom", "base")
    ]
    assert frames == ["robot1/odom", "robot1/base_link", "robot2/odom", "robot2/base_link"]


GROUP = """
<group ns="{name}"><include file="$(find mrl_robots)/ros1_bridge/launch/traxbot.launch">
  <arg name="port" value="/dev/ttyACM0"/> {prefix}
</include></group>
"""


@pytest.mark.parametrize("prefix, frames", [("", 1), ('<arg name="prefix" value="{name}/"/>', 2)])
def test_robots_in_groups_need_a_prefix_to_have_frames_of_their_own(config_of, tmp_path, prefix, frames):
    """Names in /tf are global: a namespace does not part them."""
    groups = [GROUP.format(name=name, prefix=prefix.format(name=name)) for name in ("robot1", "robot2")]
    file = tmp_path / "two.launch"
    file.write_text(f"<launch>{''.join(groups)}</launch>")
    params = config_of(file).params
    assert len({params[f"/{name}/robot_node/odom_frame"].value for name in ("robot1", "robot2")}) == frames


@pytest.mark.parametrize("file", FILES)
def test_arguments_of_the_line_are_listed(file, monkeypatch):
    """By `roslaunch mrl_robots FILE --ros-args`."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(ROOT))
    monkeypatch.setattr(substitution_args, "_rospack", None)
    listed = set(arg_dump.get_args([str(LAUNCH / file)]))
    assert {"fast", "respawn"} | ({"baud"} if file != "sim.launch" else set()) <= listed


@pytest.mark.parametrize("imu, options", [("true", ["--imu", "--imu-seed=0"]), ("false", [])])
@pytest.mark.parametrize("file", ["sim.launch", "team.launch"])
def test_emulated_robots_have_an_imu_if_asked(config_of, file, imu, options):
    quick = [WITHOUT_URDFS] if file == "team.launch" else []
    nodes = config_of(LAUNCH / file, f"imu:={imu}", *quick).nodes
    (node,) = (each for each in nodes if each.type == "sim_board")
    assert [option for option in node.args.split() if "imu" in option] == options


def test_build_reaches_the_board_the_node_and_the_description(config_of):
    """An emulated board of 2013 with environment sensors: its description has no sonars."""
    config = config_of(LAUNCH / "sim.launch", "profile:=2013-august", "build:=environment")
    (board,) = (node for node in config.nodes if node.name == "sim_board")
    assert "--profile 2013-august" in board.args and "--environment" in board.args
    assert config.params["/robot_node/build"].value == "environment"
    assert "sonar" not in config.params["/robot_description"].value


def test_build_reaches_each_robot_of_a_team(config_of):
    config = config_of(
        LAUNCH / "team.launch", "ports:=sim,sim,/dev/ttyACM0", "builds:=,environment", WITHOUT_URDFS
    )
    (board,) = (node for node in config.nodes if node.type == "sim_board")
    assert "--builds=',environment'" in board.args
    builds = [config.params[f"/robot{number}/robot_node/build"].value for number in (1, 2, 3)]
    assert builds == ["", "environment", "environment"]


@pytest.mark.parametrize(
    ("arguments", "ports"),
    [
        ([], "sim sim sim"),
        (["count:=5"], "sim sim sim sim sim"),
        (["ports:=/dev/ttyACM0,sim", "count:=4"], "/dev/ttyACM0 sim sim sim"),
        (["ports:=sim,/dev/ttyACM0", "count:=1"], "sim /dev/ttyACM0"),
    ],
)
def test_a_team_has_as_many_robots_as_asked_or_as_ports(config_of, arguments, ports):
    config = config_of(LAUNCH / "team.launch", *arguments, WITHOUT_URDFS)
    given = [each.value for name, each in config.params.items() if name.endswith("/port")]
    assert [port if "mrl_sim" not in port else "sim" for port in given] == ports.split()
    assert len({port for port in given}) == len(given)


def test_manual_speed_and_zones_of_an_emulated_robot_reach_its_node(config_of):
    shared = arguments_of("robot.launch") & {"manual_speed", *zone_arguments()}
    given = {name: 0.01 * (2 + i) for i, name in enumerate(sorted(shared))}
    params = config_of(LAUNCH / "sim.launch", *(f"{name}:={value}" for name, value in given.items())).params
    assert {name: params[f"/robot_node/{name}"].value for name in given} == given and len(given) == 10


def arguments_of(file):
    return set(arg_dump.get_args([str(LAUNCH / file)]))


def zone_arguments():
    return {name for name in arguments_of("robot.launch") if name.startswith("zone_")}


def test_radio_reaches_the_emulated_board(config_of):
    config = config_of(LAUNCH / "sim.launch", "radio:=true", "radio_range:=5", "radio_loss:=0.1")
    (board,) = (node for node in config.nodes if node.type == "sim_board")
    assert "--radio=auto --radio-range=5 --radio-loss=0.1" in board.args


def test_address_of_a_radio_reaches_the_emulated_board(config_of):
    config = config_of(LAUNCH / "sim.launch", "radio:=0013a20040e00012")
    (board,) = (node for node in config.nodes if node.type == "sim_board")
    assert "--radio=0013a20040e00012 --radio-range=inf --radio-loss=0" in board.args


def test_the_readme_lists_the_arguments_of_a_team():
    text = (ROOT / "ros1_bridge" / "README.md").read_text().partition("argument of `team.launch`")[2]
    rows = text.partition("\n\n")[0].splitlines()[2:]
    listed = {name.strip(" `") for row in rows for name in row.split("|")[1].split(",")}
    given = ElementTree.parse(LAUNCH / "team.launch").getroot().findall("arg")
    assert listed == {each.get("name") for each in given if each.get("value") is None} - {"index"}


@pytest.mark.parametrize("port", ["sim", "/dev/ttyACM0"])
def test_a_page_is_started_with_a_robot_that_stops_in_time(config_of, port):
    config = config_of(LAUNCH / "web.launch", f"port:={port}", "zones:=sonars", "prefix:=a/")
    node = {name.split("/")[-1]: each.value for name, each in config.params.items() if "/robot_node/" in name}
    assert (node["cmd_vel_timeout"], node["max_command_delay"]) == (0.2, 0.15)
    assert (node["zones"], node["odom_frame"]) == ("sonars", "a/odom")
    boards = {each.type for each in config.nodes} - {"web_node", "robot_node", "robot_state_publisher"}
    assert boards == ({"sim_board"} if port == "sim" else set())


def test_a_page_alone_is_started_for_a_robots_node_that_runs(config_of):
    (node,) = config_of(LAUNCH / "web.launch", "robot_node:=false", "cmd_vel:=joy_vel").nodes
    assert node.type == "web_node" and node.remap_args == [["cmd_vel", "joy_vel"]]


A_PATH = "/home/me/my Röboter/x.yaml"


@pytest.mark.parametrize(
    "file, arguments, kind",
    [
        ("../demo/run.launch", ["engine:=python", f"port:={A_PATH}"], "sim_board"),
        ("sim.launch", [f"link:={A_PATH}"], "sim_board"),
        ("sim.launch", [f"world:={A_PATH}"], "sim_board"),
        ("team.launch", [f"world:={A_PATH}", WITHOUT_URDFS], "sim_board"),
        ("team.launch", ["count:=1", f"models:={A_PATH}", WITHOUT_URDFS], "sim_board"),
        ("rviz.launch", [f"config:={A_PATH}"], "rviz"),
        ("record.launch", [f"prefix:={A_PATH}"], "record"),
    ],
)
def test_a_path_with_a_space_is_one_word_of_the_node(config_of, file, arguments, kind):
    nodes = [node for node in config_of(LAUNCH / file, *arguments).nodes if node.type == kind]
    words = [word.rpartition("=")[2] for node in nodes for word in shlex.split(node.args)]
    assert A_PATH in words


def test_a_description_is_rendered_where_the_path_of_the_checkout_has_a_space(config_of):
    config = config_of(LAUNCH / "describe.launch", "prefix:=robot1/")
    assert "robot1/base_link" in config.params["/robot_description"].value
