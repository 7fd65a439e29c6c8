"""Launch files: roslaunch-check finds nothing, each argument is documented and reaches what it is for.

Nodes of packages that Debian lacks know each parameter, topic and type that they get.
"""

import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import roslaunch
import rospkg
import yaml
from nav_msgs.msg import Odometry
from roslaunch import arg_dump
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from mrl_driver.robot import models
from mrl_driver.robot.sonar import NAMES
from ros1_bridge.description import urdf
from ros1_bridge.node.packages import PACKAGES, advice
from ros1_bridge.node.robot_parameters import ROWS
from tests.waiting import PATIENCE, wait_until

from . import stand_ins
from .rig import ROOT, without_a_busy_machine
from .tables import first_two, table

LAUNCH = ROOT / "ros1_bridge" / "launch"
FILES = sorted(LAUNCH.glob("*.launch"))
OF_A_ROBOT = {"traxbot.launch": "", "stingbot.launch": "", "sim.launch": "", "team.launch": "/robot2"}
"""And the namespace of a robot in it."""
WITHOUT_URDFS = "description:=false"  # Of a team, where they are not looked at: a process renders each
LINKS = (("base_link", "odom"), ("sonar_left", "base_link"), ("left_wheel", "base_link"))
"""Some frames with their parents: one of the node, one that stands still, one that turns."""
TROUBLE = ("FAILURE", "cannot find", "unable to find", "Missing", "Traceback", "WARNING")
A_PATH = "/home/me/my Röboter's/x.yaml"


def values_of(config):
    return {name: each.value for name, each in config.params.items()}


def arguments_of(file):
    return set(arg_dump.get_args([str(LAUNCH / file)]))


def test_roslaunch_check_finds_nothing(config_of, tmp_path):
    script = os.path.join(rospkg.RosPack().get_path("roslaunch"), "scripts", "roslaunch-check")
    command = [sys.executable, script, "-i", "-o", str(tmp_path / "out.xml"), str(LAUNCH)]
    done = subprocess.run(command, env={**os.environ}, capture_output=True, text=True, timeout=100 * PATIENCE)
    said = done.stdout + done.stderr
    assert done.returncode == 0 and "passed" in said, said
    assert not any(word in said for word in TROUBLE), said
    assert all(f"checking {path}" in said for path in FILES)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_argument_is_documented_and_listed(path, config_of):
    listed = arg_dump.get_args([str(path)])
    for argument in ElementTree.parse(path).getroot().iter("arg"):
        if argument.get("value") is None:
            assert argument.get("doc"), f"{path.name}: {argument.get('name')} has no doc"
            assert listed[argument.get("name")][0] == argument.get("doc")


def test_parameters_of_the_launch_file_are_those_of_the_node(config_of):
    """A row that robot.launch passes and the node does not know would end the node."""
    given = {name.split("/")[-1] for name in config_of("robot.launch").params if "robot_node/" in name}
    assert given == {row.name for row in ROWS}


@pytest.mark.parametrize("prefix", ["", "robot1/"])
@pytest.mark.parametrize("name", [model.name for model in models.driven_models()])
def test_description_of_a_packaged_model_is_that_which_is_rendered(name, prefix, config_of):
    shown = (
        config_of("describe.launch", f"robot:={name}", f"prefix:={prefix}").params["/robot_description"].value
    )
    assert shown == urdf.render(models.load(name), prefix)


def test_description_of_a_models_own_file_is_rendered(config_of, tmp_path):
    own = tmp_path / "my robot.yaml"
    own.write_text((ROOT / "mrl_driver" / "robot" / "models" / "traxbot.yaml").read_text())
    values = values_of(config_of("robot.launch", f"robot:={own}", "publish_imu_mount:=false"))
    assert "sonar_left" in values["/robot_description"] and '"imu_link"' in values["/robot_description"]
    assert values["/robot_node/publish_imu_mount"] is False


def test_board_without_motors_starts_without_a_description(config_of):
    assert [node.name for node in config_of("robot.launch", "robot:=pioneer").nodes] == ["robot_node"]


def test_unknown_model_is_named(config_of, capfd):
    with pytest.raises(roslaunch.RLException):
        config_of("sim.launch", "robot:=tank")
    assert "robot 'tank' is unknown, expected" in capfd.readouterr().err


@pytest.mark.parametrize(
    "given, topics",
    [
        ((), [f"sonar/{name}" for name in NAMES]),
        (("sonar_topics:=[/sonar/nose, /tail]",), ["/sonar/nose", "/tail"]),
    ],
)
def test_the_costmaps_take_sonars_of_any_name(given, topics, config_of):
    values = values_of(config_of("navigation.launch", MAP, "sensors:=sonars", *given))
    assert [values[f"/move_base/{each}_costmap/sonars/topics"] for each in ("global", "local")] == [
        topics
    ] * 2


@pytest.mark.parametrize("ns, place", [("", "/"), ("robot1", "/robot1/"), ("/deep/er/", "/deep/er/")])
def test_bag_has_topics_by_their_full_names(ns, place, config_of):
    (node,) = config_of("record.launch", f"ns:={ns}", "topics:=odom  sonar/front").nodes
    assert node.args.split()[-5:] == [
        f"{place}odom",
        f"{place}sonar/front",
        "/tf",
        "/tf_static",
        "/diagnostics",
    ]


def test_a_bag_is_for_its_user_alone(config_of, tmp_path):
    (node,) = config_of("record.launch").nodes
    subprocess.run([*shlex.split(node.launch_prefix), "touch", str(tmp_path / "a b.bag")], check=True)
    assert (tmp_path / "a b.bag").stat().st_mode & 0o777 == 0o600


def test_team_has_its_descriptions_and_frames_each(rig, config_of):
    """Frames of robot_state_publisher meet those of the node; each has one parent."""
    unique = f"{rig.name}_{os.getpid()}"  # names of ports and world are this test's own
    rig.env = {**os.environ, "USER": unique, **{key: rig.env[key] for key in ("ROS_MASTER_URI", "ROS_IP")}}
    program = "import sys, roslaunch; roslaunch.main(sys.argv)"
    launch = rig.start(
        "roslaunch",
        *(sys.executable, "-c", program, str(LAUNCH / "team.launch"), "ports:=sim,sim"),
        *("models:=stingbot,traxbot", f"world_name:={unique}"),
    )
    static, moving = rig.topic("/tf_static", TFMessage), rig.topic("/tf", TFMessage)
    for name in ("robot1", "robot2"):
        rig.topic(f"/{name}/odom", Odometry).wait()
        rig.topic(f"/{name}/joint_states", JointState).wait()

    def parents():
        every = [t for topic in (static, moving) for m in topic.messages for t in m.transforms]
        return {(t.child_frame_id, t.header.frame_id) for t in every if t.child_frame_id.startswith("robot")}

    wanted = {(f"{n}/{c}", f"{n}/{p}") for n in ("robot1", "robot2") for c, p in LINKS}
    wait_until(lambda: wanted <= parents()), parents()
    assert len({child for child, _ in parents()}) == len(parents())
    said = without_a_busy_machine(launch.output())
    assert not any(word in said for word in ("WARN", "ERROR", "Traceback")), said


@pytest.mark.parametrize("file", OF_A_ROBOT)
def test_speed_of_the_line_and_respawn_reach_the_node(config_of, file):
    arguments, space = ["fast:=true", "respawn:=true"], OF_A_ROBOT[file]
    if file != "sim.launch":
        arguments.append("baud:=57600")
    if file == "team.launch":
        arguments += ["ports:=/dev/ttyACM0,/dev/ttyACM1", WITHOUT_URDFS]
    config = config_of(file, *arguments)
    (node,) = (each for each in config.nodes if each.namespace + each.name == f"{space}/robot_node")
    values = values_of(config)
    assert node.respawn and values[f"{space}/robot_node/fast"] is True
    assert values[f"{space}/robot_node/baud"] == (115200 if file == "sim.launch" else 57600)


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
    params = config_of(str(file)).params
    assert len({params[f"/{name}/robot_node/odom_frame"].value for name in ("robot1", "robot2")}) == frames


@pytest.mark.parametrize(
    "file, arguments, options, without",
    [
        ("sim.launch", ["imu:=true"], "--imu --imu-seed=0", "--radio"),
        ("sim.launch", ["imu:=false"], "", "--imu"),
        ("team.launch", ["imu:=true"], "--imu --imu-seed=0", "--radio"),
        (
            "sim.launch",
            ["profile:=2013-august", "build:=environment"],
            "--profile 2013-august --environment",
            "--imu",
        ),
        (
            "sim.launch",
            ["radio:=true", "radio_range:=5", "radio_loss:=0.1"],
            "--radio=auto --radio-range=5 --radio-loss=0.1",
            "--imu",
        ),
        (
            "sim.launch",
            ["radio:=0013a20040e00012"],
            "--radio=0013a20040e00012 --radio-range=inf --radio-loss=0",
            "--imu",
        ),
    ],
)
def test_emulated_board_has_what_is_asked_for(config_of, file, arguments, options, without):
    quick = [WITHOUT_URDFS] if file == "team.launch" else []
    (board,) = (node for node in config_of(file, *arguments, *quick).nodes if node.type == "sim_board")
    assert set(options.split()) <= set(board.args.split()) and without not in board.args


def test_build_reaches_the_node_and_the_description(config_of):
    """The description of a robot with environment sensors has no sonars."""
    values = values_of(config_of("sim.launch", "profile:=2013-august", "build:=environment"))
    assert values["/robot_node/build"] == "environment" and "sonar" not in values["/robot_description"]


def test_robots_of_a_team_have_builds_and_frames_of_their_own(config_of):
    config = config_of("team.launch", "ports:=sim,sim,/dev/ttyACM0", "builds:=,environment", WITHOUT_URDFS)
    (board,) = (node for node in config.nodes if node.type == "sim_board")
    assert "--builds=,environment" in shlex.split(board.args)
    values, robots = values_of(config), [f"robot{number}" for number in (1, 2, 3)]
    assert [values[f"/{name}/robot_node/build"] for name in robots] == ["", "environment", "environment"]
    for key, frame in (("odom_frame", "odom"), ("base_frame", "base_link")):
        assert [values[f"/{name}/robot_node/{key}"] for name in robots] == [
            f"{name}/{frame}" for name in robots
        ]


@pytest.mark.parametrize(
    ("arguments", "ports"),
    [
        ([], "sim sim sim"),
        (["count:=5"], "sim sim sim sim sim"),
        (["ports:=/dev/ttyACM0,sim", "count:=4"], "/dev/ttyACM0 sim sim sim"),
        (["ports:=/dev/ttyACM1,/dev/ttyACM0", "count:=1"], "/dev/ttyACM1 /dev/ttyACM0"),
    ],
)
def test_a_team_has_as_many_robots_as_asked_or_as_ports(config_of, arguments, ports):
    config = config_of("team.launch", *arguments, WITHOUT_URDFS)
    given = [each.value for name, each in config.params.items() if name.endswith("/port")]
    assert [port if "mrl_sim" not in port else "sim" for port in given] == ports.split()
    assert len({port for port in given}) == len(given)
    assert ("sim_boards" in {node.name for node in config.nodes}) == ("sim" in ports)


def test_manual_speed_and_zones_of_an_emulated_robot_reach_its_node(config_of):
    own = arguments_of("robot.launch")
    names = sorted(name for name in own if name == "manual_speed" or name.startswith("zone_"))
    given = {name: 0.01 * (2 + i) for i, name in enumerate(names)}
    values = values_of(config_of("sim.launch", *(f"{name}:={value}" for name, value in given.items())))
    assert {name: values[f"/robot_node/{name}"] for name in given} == given and len(given) == 11


def test_the_readme_lists_the_arguments_of_a_team():
    text = (ROOT / "ros1_bridge" / "README.md").read_text().partition("argument of `team.launch`")[2]
    rows = text.partition("\n\n")[0].splitlines()[2:]
    listed = {name.strip(" `") for row in rows for name in row.split("|")[1].split(",")}
    given = ElementTree.parse(LAUNCH / "team.launch").getroot().findall("arg")
    assert listed == {each.get("name") for each in given if each.get("value") is None} - {"index"}


@pytest.mark.parametrize("port", ["sim", "/dev/ttyACM0"])
def test_a_page_is_started_with_a_robot_that_stops_in_time(config_of, port):
    config = config_of("web.launch", f"port:={port}", "zones:=sonars", "prefix:=a/")
    node = {name.split("/")[-1]: each.value for name, each in config.params.items() if "/robot_node/" in name}
    assert (node["cmd_vel_timeout"], node["max_command_delay"]) == (0.2, 0.15)
    assert (node["zones"], node["odom_frame"], node["record"]) == ("sonars", "a/odom", "")
    boards = {each.type for each in config.nodes} - {"web_node", "robot_node", "robot_state_publisher"}
    assert boards == ({"sim_board"} if port == "sim" else set())


def test_a_page_alone_is_started_for_a_robots_node_that_runs(config_of):
    (node,) = config_of("web.launch", "robot_node:=false", "cmd_vel:=joy_vel").nodes
    assert node.type == "web_node" and node.remap_args == [["cmd_vel", "joy_vel"]]


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
def test_a_path_with_a_space_or_an_apostrophe_is_one_word_of_the_node(config_of, file, arguments, kind):
    nodes = [node for node in config_of(file, *arguments).nodes if node.type == kind]
    words = [word.rpartition("=")[2] for node in nodes for word in shlex.split(node.args)]
    assert A_PATH in words


MAP = "map:=map.yaml"
MASTERS = ("name:=robot1", "topics:=/claims,/robot1/*", "hosts:=10.0.0.12")
VARIANTS = [
    ("navigation.launch", (MAP, "robot:=traxbot"), "amcl map_server move_base"),
    ("navigation.launch", (MAP, "robot:=stingbot"), "amcl map_server move_base"),
    ("navigation.launch", (MAP, "robot:=omni"), "amcl map_server move_base"),
    ("navigation.launch", (MAP, "robot:=duo", "localisation:=none"), "map_server move_base"),
    ("navigation.launch", (MAP, "sensors:=both"), "amcl clear_range map_server move_base"),
    ("navigation.launch", (MAP, "sensors:=sonars"), "clear_range map_server map_to_odom move_base"),
    ("laser.launch", ("driver:=urg",), "laser"),
    ("laser.launch", ("driver:=rplidar",), "laser"),
    ("ekf.launch", ("prefix:=robot1/",), "ekf_localization"),
    ("slam.launch", ("method:=gmapping",), "slam_gmapping"),
    ("slam.launch", ("method:=hector",), "hector_mapping map_to_odom"),
    ("multimaster.launch", MASTERS, "master_discovery master_sync"),
    ("mux.launch", ("mux:=twist_mux",), "twist_mux"),
    ("teleop_joystick.launch", ("layout:=ps3",), "joy_node teleop_joystick"),
    ("teleop_joystick.launch", ("layout:=wiimote",), "teleop_joystick wiimote_node"),
    ("teleop_joystick.launch", ("layout:=wiimote_tilt",), "teleop_joystick wiimote_node"),
]
"""File, its arguments, and all nodes that it starts with them."""
CLEARING = "set robot_node/sonars clear_range 0.7"  # Arguments of dynparam; test_move_base.py runs it
DISPLAYS = {
    "rviz/Map": "nav_msgs/OccupancyGrid",
    "rviz/Path": "nav_msgs/Path",
    "rviz/Polygon": "geometry_msgs/PolygonStamped",
    "rviz/PoseArray": "geometry_msgs/PoseArray",
    "rviz/Pose": "geometry_msgs/PoseStamped",
}


@pytest.fixture(params=VARIANTS, ids=lambda variant: " ".join((variant[0], *variant[1])))
def variant(request, config_of):
    file, arguments, nodes = request.param
    return config_of(file, *arguments), nodes


def private(config, node):
    """Parameters of a node, namespaces as mappings."""
    given, space = {}, f"{node.namespace}{node.name}/"
    for name, parameter in config.params.items():
        if name.startswith(space):
            *spaces, key = name[len(space) :].split("/")
            place = given
            for each in spaces:
                place = place.setdefault(each, {})
            place[key] = parameter.value
    return given


def real_nodes(config):
    """Table and private parameters of each node of a package that Debian lacks, and its <node>."""
    for node in config.nodes:
        if node.package in stand_ins.PACKAGES:
            yield stand_ins.table(node.package, node.type), private(config, node), node


def needed(config):
    """Packages that the file asks for before it starts anything."""
    return {
        word for name, p in config.params.items() if name.endswith("_packages") for word in p.value.split()
    }


def test_file_starts_these_nodes(variant):
    config, nodes = variant
    assert {node.name for node in config.nodes} == set(nodes.split())


def test_real_nodes_know_each_parameter(variant):
    config, _ = variant
    found = [stand_ins.faults(known, given) for known, given, _ in real_nodes(config)]
    assert found and not any(found)


def test_real_nodes_have_each_remapped_name(variant):
    config, _ = variant
    for known, _, node in real_nodes(config):
        names = known.names("publishes", "subscribes", "services", "calls", "actions")
        assert {old for old, _ in node.remap_args} <= set(names)


def test_each_package_is_asked_for_before_it_is_needed(variant):
    config, _ = variant
    started = {node.package for node in config.nodes} & set(PACKAGES)
    for known, given, _ in real_nodes(config):
        started |= {stand_ins.PLUGIN_PACKAGES[plugin] for plugin in stand_ins.plugins_of(known, given)}
    assert needed(config) == started


def test_a_package_that_no_robot_needs_is_asked_for(config_of):
    assert needed(config_of("diagnostics.launch")) == {"diagnostic_aggregator"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_file_says_in_one_line_what_it_needs(path):
    head = path.read_text(encoding="utf-8").split("-->", 1)[0]
    assert len(re.findall(r"^ {7}Needs: [^\n]+\. $", head, re.MULTILINE)) == 1


def test_each_package_has_a_table_and_an_origin():
    assert set(stand_ins.PACKAGES) == {name for name, origin in PACKAGES.items() if not origin.debian}


def test_each_launch_file_with_such_a_package_is_among_the_variants():
    nodes = {path.name: ElementTree.parse(path).getroot().iter("node") for path in LAUNCH.glob("*.launch")}
    lacked = stand_ins.PACKAGES
    files = {file for file, each in nodes.items() if any(node.get("pkg") in lacked for node in each)}
    assert files == {file for file, _, _ in VARIANTS}


@pytest.mark.parametrize("package, node", [("amcl", "amcl"), ("gmapping", "slam_gmapping")])
@pytest.mark.parametrize("laser", [("urg_node", "urg_node"), ("rplidar_ros", "rplidarNode")])
def test_scan_of_a_laser_is_one_that_localisation_and_mapping_take(package, node, laser):
    scan = stand_ins.table(*laser).names("publishes")["scan"]
    assert stand_ins.table(package, node).names("subscribes")["scan"] == scan
    assert ["robot1/scan", scan] in [row[:2] for row in table("## Node `world_node`", "topic")]


def test_robot_gives_and_takes_what_move_base_does():
    planner = stand_ins.table("move_base", "move_base")
    ours, theirs = first_two(table("### Published topics", "topic")), planner.names("subscribes")
    inputs = {
        name: kind
        for name, kind in theirs.items()
        if name.split("/")[-1] in ("front", "left", "right", "odom")
    }
    assert len(inputs) == 7
    assert all(kind == ours[re.sub(r"^~\w+/sonars/", "", name)] for name, kind in inputs.items())
    assert (
        first_two(table("### Subscribed topics", "topic"))["cmd_vel"] == planner.names("publishes")["cmd_vel"]
    )


def test_rviz_shows_what_the_real_nodes_publish():
    config = yaml.safe_load((ROOT / "ros1_bridge" / "rviz" / "robot.rviz").read_text())
    shown = {
        each["Topic"]: each["Class"]
        for each in config["Visualization Manager"]["Displays"]
        if "Topic" in each
    }
    planner = stand_ins.table("move_base", "move_base").names("publishes")
    published = {name.replace("~", "move_base/"): kind for name, kind in planner.items()}
    published.update(stand_ins.table("amcl", "amcl").names("publishes"))
    shown = {
        topic: DISPLAYS[kind] for topic, kind in shown.items() if topic.startswith(("move_base/", "particle"))
    }
    assert len(shown) == 7 and shown.items() <= published.items()


@pytest.mark.parametrize(
    "file, arguments, values",
    [
        (
            "ekf.launch",
            ("prefix:=robot1/",),
            {
                "ekf_localization/odom_frame": "robot1/odom",
                "ekf_localization/world_frame": "robot1/odom",
                "ekf_localization/base_link_frame": "robot1/base_link",
            },
        ),
        (
            "navigation.launch",
            (MAP, "x:=1", "y:=2", "yaw:=0.5"),
            {"amcl/initial_pose_x": 1, "amcl/initial_pose_y": 2, "amcl/initial_pose_a": 0.5},
        ),
        (
            "multimaster.launch",
            MASTERS,
            {
                "master_sync/sync_topics": ["/claims", "/robot1/*"],
                "master_sync/ignore_services": ["*"],  # without a list of services, master_sync shares all
                "master_discovery/robot_hosts": ["10.0.0.12"],
            },
        ),
    ],
)
def test_arguments_reach_the_real_nodes(config_of, file, arguments, values):
    params = config_of(file, *arguments).params
    assert {name: params[f"/{name}"].value for name in values} == values


@pytest.mark.parametrize(
    "arguments, noise",
    [
        ((), 0.0015),
        (("robot:=stingbot",), 0.001),
        (("gyro:=false",), 0.07),
        (("robot:=stingbot", "gyro:=false"), 0.002),
        (("yaw_noise:=0.5",), 0.5),
    ],
)
def test_filter_is_less_sure_of_turns_by_wheels_and_least_by_tracks(config_of, arguments, noise):
    params = config_of("ekf.launch", *arguments).params
    assert params["/ekf_localization/process_noise_covariance"].value[::16][5] == noise


@pytest.mark.parametrize(
    "arguments, name, words",
    [
        (
            ("x:=1", "y:=2", "yaw:=0.5", "sensors:=sonars", "prefix:=robot1/"),
            "map_to_odom",
            "1 2 0 0.5 0 0 map robot1/odom",
        ),
        (("sensors:=both",), "clear_range", CLEARING),
        (("sensors:=both", "robot:=stingbot"), "clear_range", CLEARING.replace("0.7", "1.0")),
    ],
)
def test_programs_for_the_sonars_get_these_words(config_of, arguments, name, words):
    (node,) = (each for each in config_of("navigation.launch", MAP, *arguments).nodes if each.name == name)
    assert node.args == words


def test_wiimotes_own_imu_is_not_the_robots(config_of):
    nodes = config_of("teleop_joystick.launch", "layout:=wiimote").nodes
    assert [dict(node.remap_args)["imu/data"] for node in nodes if node.package == "wiimote"] != ["imu/data"]


@pytest.mark.parametrize(
    "file, argument, expected",
    [
        ("navigation.launch", "sensors:=lidar", "'laser': True, 'sonars': False, 'both': True"),
        ("navigation.launch", "localisation:=amlc", "'amcl': True, 'start': False, 'none': False"),
        ("laser.launch", "driver:=hokuyo", "'urg': 'urg_node', 'rplidar': 'rplidar_ros'"),
    ],
)
def test_word_that_a_launch_file_does_not_know_is_refused(config_of, file, argument, expected):
    with pytest.raises(roslaunch.RLException) as refusal:
        config_of(file, MAP, argument)
    assert argument.split(":=")[1] in str(refusal.value) and expected in str(refusal.value)


@pytest.mark.parametrize(
    "given, found", [("house.yaml", "/home/me/house.yaml"), ("/maps/a.yaml", "/maps/a.yaml")]
)
def test_map_is_found_from_the_folder_of_the_user(config_of, monkeypatch, given, found):
    """Nodes run in another one."""
    monkeypatch.setenv("PWD", "/home/me")
    nodes = config_of("navigation.launch", f"map:={given}").nodes
    assert [node.args for node in nodes if node.name == "map_server"] == [f'"{found}"']


def test_missing_packages_are_named_in_one_line_with_the_ways_to_get_them(config_of, monkeypatch):
    path = (str(ROOT), str(config_of.folder / "map_server"), "/usr/share")
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join(path))
    command = ["/usr/bin/rosrun", "mrl_robots", "need_packages", "amcl", "map_server", "range_sensor_layer"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60 * PATIENCE)
    line = advice(["amcl", "range_sensor_layer"])
    assert (done.returncode, done.stdout, done.stderr) == (1, "", line + "\n") and "\n" not in line
    assert "ros-noetic-amcl (Noetic)" in line and "ros-one-amcl (ROS One)" in line
    assert "https://github.com/DLu/navigation_layers" in line and "ros-noetic-range-sensor-layer" not in line
    assert "ros-one" not in advice(["amcl", "fkie_master_sync"])
