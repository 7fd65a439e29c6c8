"""The stand-ins for packages that Debian lacks refuse what the real nodes do not know."""

import os
import signal
import sys

import pytest

from mrl_driver.errors import ConfigError
from tests.waiting import wait_until

from . import stand_ins
from .rig import ROOT, START_S
from .tables import Offered
from .test_launch_packages import LAUNCH, QUICK

LAYER = {
    "plugins": [{"name": "eyes", "type": "costmap_2d::ObstacleLayer"}],
    "eyes": {"observation_sources": "scan", "scan": {"data_type": "LaserScan"}},
}


def faults(package, node, given):
    return stand_ins.faults(stand_ins.table(package, node), given)


def test_parameters_of_the_plugins_that_are_chosen_are_known():
    given = {
        "local_costmap": LAYER,
        "TrajectoryPlannerROS": {"max_vel_x": 0.3},
        "NavfnROS": {"allow_unknown": True},
    }
    assert faults("move_base", "move_base", given) == []


@pytest.mark.parametrize(
    "package, node, given, fault",
    [
        ("amcl", "amcl", {"odom_frame": "odom"}, "~odom_frame is unknown to the real node"),
        ("amcl", "amcl", {"min_particles": 0.5}, "~min_particles: got 0.5, expected int 0 1000"),
        ("amcl", "amcl", {"laser_max_beams": 512}, "~laser_max_beams: got 512, expected int 0 100"),
        ("amcl", "amcl", {"odom_model_type": "tank"}, "~odom_model_type: got 'tank'"),
        ("amcl", "amcl", {"use_map_topic": "yes"}, "~use_map_topic: got 'yes', expected bool"),
        ("move_base", "move_base", {"DWAPlannerROS": {}}, "~DWAPlannerROS is unknown to the real node"),
        ("move_base", "move_base", {"local_costmap": {"sonars": {}}}, "~local_costmap/sonars is unknown"),
        (
            "move_base",
            "move_base",
            {"local_costmap": {**LAYER, "eyes": {"scan": {}}}},
            "~local_costmap/eyes/scan is",
        ),
        (
            "move_base",
            "move_base",
            {"base_local_planner": "my/Planner", "Planner": {}},
            "~Planner: no table has plugin my/Planner",
        ),
        (
            "robot_localization",
            "ekf_localization_node",
            {"odom0_config": [True]},
            "~odom0_config: got [True], expected",
        ),
        ("robot_localization", "ekf_localization_node", {"odometry0": "odom"}, "~odometry0 is unknown"),
        ("twist_mux", "twist_mux", {"topics": [{"name": "a", "topic": "b"}]}, "~topics[0]: got {'name': 'a'"),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_what_the_real_node_does_not_know_is_refused(package, node, given, fault):
    (line,) = faults(package, node, given)
    assert line.startswith(fault)


@pytest.mark.parametrize("package", stand_ins.PACKAGES)
def test_each_table_names_its_source(package):
    lines = (stand_ins.FOLDER / f"{package}.yaml").read_text().splitlines()
    assert lines[0].startswith("# Source: github.com/")
    for node in stand_ins.nodes_of(package):
        stand_ins.table(package, node)


@pytest.fixture
def packages(rig, tmp_path):
    """A rig in which the packages of the tables are packages, with stand-ins as their nodes."""
    folder = tmp_path / "packages"
    module = "tests.ros.stand_ins.stand_in_node"
    stand_ins.install(
        folder, program=f'#!/bin/sh\nexec {sys.executable} -m {module} {{package}} {{node}} "$@"\n'
    )
    for name, text in QUICK.items():
        (folder / name).write_text(f"#!/bin/sh\n{text}\n")
        (folder / name).chmod(0o755)
    more = {
        "PYTHONPATH": os.pathsep.join((str(ROOT), rig.env.get("PYTHONPATH", ""))),
        "PATH": os.pathsep.join((str(folder), "/usr/bin", rig.env["PATH"])),
        "ROS_PACKAGE_PATH": os.pathsep.join((str(ROOT), str(folder), "/usr/share")),
        "ROS_NAMESPACE": rig.ns,
    }
    rig.env = {**rig.env, **more}
    rig.packages = folder
    return rig


def test_process_refuses_an_unknown_parameter(packages):
    child = packages.start("amcl", str(packages.packages / "amcl" / "amcl"), "_odom_frame:=odom")
    wait_until(lambda: child.exit_code is not None)
    assert child.exit_code == ConfigError.exit_code
    assert "amcl/amcl refuses: ~odom_frame is unknown to the real node" in child.last_words()


def test_navigation_runs_with_nodes_that_refuse_what_they_do_not_know(packages):
    """And their names are those of the robot: the sonar layers' topics too, which are private ones in the real node."""
    rig, program = packages, "import sys, roslaunch; roslaunch.main(sys.argv)"
    arguments = ("map:=map.yaml", "sensors:=both")
    child = rig.start(
        "roslaunch", sys.executable, "-c", program, str(LAUNCH / "navigation.launch"), *arguments
    )
    wanted = {"sonar/front", "sonar/left", "sonar/right", "scan", "odom", "map", "move_base_simple/goal"}
    planner, localisation = Offered(rig, "move_base"), Offered(rig, "amcl")
    try:
        wait_until(lambda: wanted <= set(planner.topics(1)) or child.exit_code is not None, START_S)
        own = {name for name in planner.topics(1) if not name.startswith("move_base/")}
        assert own == wanted, "\n".join(child.output())
        wait_until(
            lambda: localisation.topics(0).get("amcl_pose") == "geometry_msgs/PoseWithCovarianceStamped"
        )
        assert not any("refuses" in line for line in child.output())
    finally:
        child.signal(signal.SIGINT)
        child.finish(START_S)
