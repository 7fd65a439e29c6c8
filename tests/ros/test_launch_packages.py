"""Launch files with nodes of packages that Debian lacks: the real nodes know each parameter, topic and type."""

import os
import re
import subprocess
import xml.etree.ElementTree as ElementTree

import pytest
import roslaunch
import yaml

from ros1_bridge.node.packages import PACKAGES, advice
from tests.waiting import PATIENCE

from . import stand_ins
from .rig import ROOT
from .tables import first_two, table

LAUNCH = ROOT / "ros1_bridge" / "launch"
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
DECLARED = yaml.safe_load((ROOT / "tests" / "ros" / "declared.yaml").read_text())
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


def test_each_package_has_a_table_and_an_origin():
    assert set(stand_ins.PACKAGES) == {name for name, origin in PACKAGES.items() if not origin.debian}


@pytest.mark.parametrize("name", DECLARED["parameters"])
def test_stand_in_has_the_parameters_that_the_real_package_declares(name):
    """A kind of its own is narrower than `str`, or one that no cfg file declares."""
    nodes = {
        node: stand_ins.table(each, node).rows
        for each in stand_ins.PACKAGES
        for node in stand_ins.nodes_of(each)
    }
    kinds = {**nodes, **stand_ins.GROUPS}[name].get("parameters", {})
    wider = {
        key: "str" if isinstance(kind, list) or kind == "footprint" else kind for key, kind in kinds.items()
    }
    declared = DECLARED["parameters"][name]
    assert wider == {key: declared.get(key, "unknown") or kind for key, kind in wider.items()}


@pytest.mark.parametrize("name", DECLARED["topics"])
def test_stand_in_has_the_topics_that_the_real_node_had(name):
    """But sonars, whose names navigation.launch remaps, and amcl's map, which needs use_map_topic."""
    topics = stand_ins.table(name, name).names("publishes", "subscribes")
    left_out = {"map"} if name == "amcl" else {each for each in topics if "/sonars/" in each}
    topics = {each: kind for each, kind in topics.items() if each not in left_out}
    assert topics.items() <= DECLARED["topics"][name].items()


def test_plugins_have_the_class_names_of_the_real_packages():
    plugins = {name for name in stand_ins.GROUPS if stand_ins.is_plugin(name)}
    assert plugins and plugins <= set(DECLARED["plugins"])


def test_each_launch_file_with_such_a_package_is_among_the_variants():
    nodes = {path.name: ElementTree.parse(path).getroot().iter("node") for path in LAUNCH.glob("*.launch")}
    files = {file for file, each in nodes.items() if any(node.get("pkg") in PACKAGES for node in each)}
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
    "arguments, name, words",
    [
        (
            ("x:=1", "y:=2", "yaw:=0.5", "sensors:=sonars", "prefix:=robot1/"),
            "map_to_odom",
            "1 2 0 0.5 0 0 map robot1/odom",
        ),
        (("sensors:=both",), "clear_range", CLEARING),
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
