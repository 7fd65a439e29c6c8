"""The simulated world in ROS: messages, and two robots of one world."""

import math
import os
import subprocess

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan

from mrl_driver.geometry import Pose
from ros1_bridge.world.world_node import new_map, truth_of
from sim_arduino.world.grid_map import GridMap
from tests.waiting import wait_until

from .rig import ROOT
from .tables import Offered, first_two, table


def test_speeds_are_those_between_two_poses():
    there, before = Pose(0.0, 0.1, math.pi / 2), (5.0, Pose(0.0, 0.0, math.pi / 2))
    message = truth_of(None, "base_link", there, before, 5.5)
    assert message.twist.twist.linear.x == pytest.approx(0.2)
    assert message.twist.twist.linear.y == pytest.approx(0.0)
    message = truth_of(None, "base_link", Pose(1.0, 0.0, 0.0), (0.0, Pose(0.0, 0.0, 0.0)), 60.0)
    assert message.twist.twist.linear.x == 0.0, "a pose after a pause says nothing of speed"


def test_map_has_its_rows_from_below():
    grid = GridMap(np.array([[0, 100, 0], [-1, 0, 0]], np.int8), 0.05, Pose(-1.0, -2.0, 0.0))
    message = new_map("map", None, grid)
    assert (message.info.width, message.info.height) == (3, 2)
    assert list(message.data) == [0, 100, 0, -1, 0, 0]
    assert message.info.origin.position.y == -2.0


@pytest.fixture(scope="module")
def world(module_rig):
    """Two robots nose to nose, half a metre apart."""
    rig, name = module_rig, f"test_{os.getpid()}"
    for robot, pose in (("one", "0,0,0"), ("two", "0.8,0,180")):
        rig.board("--robot", "traxbot", "--world-name", name, "--name", robot, f"--pose={pose}")
    rig.program("world_node", f"_world_name:={name}")
    rig.scan, rig.truth = rig.topic("one/scan", LaserScan), rig.topic("one/base_pose_ground_truth", Odometry)
    rig.two, rig.map = rig.topic("two/base_pose_ground_truth", Odometry), rig.topic("true_map", OccupancyGrid)
    for topic in rig.scan, rig.truth, rig.two, rig.map:
        topic.wait()
    return rig


def test_laser_sees_the_other_robot(world):
    """The laser sits 0.085 m before base_link, the other's front half its length before its own."""
    at = world.two.wait()[-1].pose.pose
    assert (at.position.x, at.position.y) == (pytest.approx(0.8), pytest.approx(0.0))
    scan = world.scan.wait(3)[-1]
    assert scan.header.frame_id == "one/laser"
    assert len(scan.ranges) == 512
    ahead = scan.ranges[round(-scan.angle_min / scan.angle_increment)]
    assert ahead == pytest.approx(0.8 - 0.085 - 0.225 / 2, abs=0.03)


def test_walls_of_the_room_are_in_map_and_scan(world):
    grid = world.map.wait()[-1]
    assert {0, 100} <= set(grid.data)
    assert len(grid.data) == grid.info.width * grid.info.height
    finite = [value for value in world.scan.wait()[-1].ranges if math.isfinite(value)]
    assert len(finite) > 100


def test_nodes_of_a_world_go_on_when_simulated_time_jumps_back(rig):
    name = f"back_{os.getpid()}"
    rig.board("--robot", "traxbot", "--world-name", name, "--name", "one")
    with rig.simulated_time() as tick:
        nodes = rig.program("world_node", f"_world_name:={name}"), rig.program("mirror_node", "_name:=two")
        truth = rig.topic("one/base_pose_ground_truth", Odometry)
        status = rig.topic("mirror/status", DiagnosticStatus)
        wait_until(lambda: tick() and truth.messages and status.messages, step_s=0.02)
    tick(500.0)
    before, told = len(truth.messages), len(status.messages)
    wait_until(
        lambda: tick() and len(truth.messages) > before + 5 and len(status.messages) > told + 1, step_s=0.02
    )
    assert [node.exit_code for node in nodes] == [None, None]
    assert truth.messages[-1].header.stamp.to_sec() < 1000.0


def test_topics_of_the_node_are_those_of_the_table(world):
    node, rows = Offered(world, "world_node"), table("## Node `world_node`", "topic")
    for index, way in enumerate(("out", "in")):
        wanted = first_two([row for row in rows if row[2] == way])
        wanted = {name.replace("robot1/", "one/"): kind for name, kind in wanted.items()}
        topics = {name: kind for name, kind in node.topics(index).items() if not name.startswith("two/")}
        assert topics == wanted


def test_map_for_map_server_is_that_of_the_node(world, tmp_path):
    program, file = ROOT / "ros1_bridge" / "nodes" / "save_map", tmp_path / "room.yaml"
    subprocess.run([str(program), "room", str(file), "--resolution", "0.025"], check=True)
    told, grid = yaml.safe_load(file.read_text()), world.map.wait()[-1]
    kind, size, _, pixels = (tmp_path / told["image"]).read_bytes().split(b"\n", 3)
    assert (kind, size) == (b"P5", f"{grid.info.width} {grid.info.height}".encode())
    assert told["origin"][:2] == pytest.approx([grid.info.origin.position.x, grid.info.origin.position.y])
    assert pixels.count(b"\0") == list(grid.data).count(100)
    assert pixels.count(bytes([254])) == list(grid.data).count(0)
