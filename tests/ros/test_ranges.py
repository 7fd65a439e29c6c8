"""Range sensors of an own robot's file, with names of their own, as topics and for the nodes that use them."""

import math
import pathlib

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, Twist
from sensor_msgs.msg import Range

from mrl_driver.geometry import Pose
from mrl_driver.robot import models, wirings
from mrl_driver.robot.models import kit
from mrl_driver.robot.models.kit import Kit
from ros1_bridge.navigation.go_to_goal_node import sonar_of
from ros1_bridge.topics.topic_robot import TopicRobot
from sim_arduino.testing import EmulatedBoard
from tests.waiting import wait_until

from .tables import Offered

PINS = {
    **wirings.load("mrl_duo").pins,
    **dict.fromkeys(("pin_sonar_front", "pin_sonar_left"), -1),
    "pin_range_1_echo": 14,
    "pin_range_2_echo": 15,
}
MADE = Kit("rover", 11, 65.0, 150.0, 1496.0, "cytron", PINS)
SONARS = """sonars:
  nose: {input: range_1, type: GP2Y0A21, x_m: 0.0, y_m: 0.0, yaw_deg: 0}
  tail: {input: range_2, type: GP2Y0A02, x_m: 0.0, y_m: 0.0, yaw_deg: 180}
"""


@pytest.mark.parametrize("auto", [False, True], ids=["named", "by the board's id"])
def test_a_view_takes_sensors_of_any_name(auto, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    path = pathlib.Path(models.own_folder()) / "rover.yaml"
    path.parent.mkdir(parents=True)
    path.write_text(kit.text_of(MADE).replace("sonars: {}\n", SONARS))
    robot, topics = TopicRobot(lambda *_: None, lambda: False, "auto" if auto else "rover"), []
    robot.subscribe(lambda topic, kind, callback, **options: topics.append(topic))
    if auto:
        pairs = [KeyValue("Device ID", "11")]
        robot.on_diagnostics(
            DiagnosticArray(status=[DiagnosticStatus(name="robot_node: Link", values=pairs)])
        )
    assert {"sonar/nose", "sonar/tail"} <= set(topics)


def test_go_to_goal_takes_sensors_of_any_name(rig, tmp_path):
    path, world = tmp_path / "rover.yaml", tmp_path / "wall.yaml"
    path.write_text(kit.text_of(MADE).replace("sonars: {}\n", SONARS))
    world.write_text("walls: [[0.5, -9, 0.5, 9]]\n")
    with EmulatedBoard(robot=str(path), world=str(world), pose="0,0,0") as board:
        rig.node(board.port, f"_robot:={path}")
        nose, tail = (rig.topic(f"sonar/{name}", Range) for name in ("nose", "tail"))
        first = nose.wait()[0]
        assert (first.radiation_type, first.max_range) == (Range.INFRARED, pytest.approx(0.8))
        assert first.range == pytest.approx(0.5, abs=0.01) and tail.wait()[0].range == math.inf
        rig.program("go_to_goal")
        goals = rig.publisher("move_base_simple/goal", PoseStamped)
        goal = PoseStamped()
        goal.pose.position.x, goal.pose.orientation.w = 2.0, 1.0
        goals.publish(goal)
        node = Offered(rig, "go_to_goal")
        wait_until(lambda: {"sonar/nose", "sonar/tail"} <= set(node.topics(1)), step_s=0.05)


def test_go_to_goal_drives_over_free_floor_although_the_ranges_are_cut(rig):
    """With `clear_range` each sonar reports 0.5 m there."""
    with EmulatedBoard(world="square") as board:
        rig.node(board.port, "_clear_range:=0.5")
        rig.program("go_to_goal")
        twists = rig.topic("cmd_vel", Twist)
        goals, goal = rig.publisher("move_base_simple/goal", PoseStamped), PoseStamped()
        goal.pose.position.x, goal.pose.orientation.w = 0.7, 1.0
        goals.publish(goal)
        assert twists.wait(10)[-1].linear.x > 0.1


@pytest.mark.parametrize(
    "cone_deg, max_range, seen_deg, farthest_m",
    [(20.0, 0.3, 20.0, 0.3), (0.0, 0.0, 36.0, 6.45), (200.0, math.inf, 36.0, 6.45)],
)
def test_go_to_goal_knows_how_far_a_sensor_sees(cone_deg, max_range, seen_deg, farthest_m):
    """Beyond that it frees nothing.  What a driver does not say is that of an MB1300."""
    message = Range(field_of_view=math.radians(cone_deg), max_range=max_range)
    mount = sonar_of(Pose(0.1, 0.0, math.pi / 2), message)
    assert mount.kind.farthest_m == farthest_m
    assert math.degrees(mount.kind.field_of_view_rad) == pytest.approx(seen_deg)
