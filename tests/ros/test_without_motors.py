"""The node on a board without motors: sensors and diagnostics, nothing that collides with the robot's own driver."""

import re

import pytest
from click.testing import CliRunner
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import UInt16

from mrl_driver.errors import ConfigError
from ros1_bridge.demo import launcher
from ros1_bridge.demo.demo_screen import DemoScreen
from ros1_bridge.node.robot_parameters import check, without_motors
from ros1_bridge.topics.topic_robot import TopicRobot
from tests.waiting import wait_until

from .tables import Offered

SENSORS = {"alcohol", "compass", "dust", "light", "thermopile"}
OF_A_MOTOR_BOARD = ("Motion", "Battery")


def parameters(**given):
    return check({"port": "/dev/ttyACM0", **given}, "/n")


def test_parts_that_need_motors_are_left_out():
    assert [without_motors(parameters(parts=given)).parts for given in ("all", "odometry, sensors")] == [
        "status, sensors",
        "sensors",
    ]


@pytest.mark.parametrize(
    "given, message",
    [
        (
            {"parts": "odometry, commands"},
            "parts is 'odometry, commands', .* no motors, expected all, or some",
        ),
        ({"zones": "scan"}, "zones is scan, but this board has no motors, expected none"),
    ],
)
def test_parameters_for_motors_alone_are_refused(given, message):
    with pytest.raises(ConfigError, match=message):
        without_motors(parameters(**given))


NO_MOTORS = "robot pioneer is a board without motors .* something else drives its robot"


def test_demonstration_of_driving_is_refused():
    done = CliRunner().invoke(launcher.main, ["--robot", "pioneer"])
    assert done.exit_code == ConfigError.exit_code and re.search(NO_MOTORS, done.output)


def test_demonstration_ends_when_the_board_has_said_who_it_is():
    robot = TopicRobot(lambda *speeds: None, lambda: False, "pioneer")
    with pytest.raises(ConfigError, match=NO_MOTORS):
        DemoScreen(robot, "", square=True).steer(0.0)


@pytest.fixture(scope="module")
def robot(module_rig):
    rig = module_rig
    rig.diagnostics = rig.topic("/diagnostics", DiagnosticArray)
    rig.light = rig.topic("light", UInt16)
    rig.process = rig.node(rig.board("--robot", "pioneer", "--id", "8").port)
    rig.light.wait(2)
    wait_until(lambda: rig.diagnosed(rig.diagnostics, "Board"))
    return rig


def test_only_sensors_are_published_and_only_its_own_end_is_a_service(robot):
    """The robot below has odom, tf, joint_states and battery of its own, and a topic `pose` of another type."""
    offered = Offered(robot)
    assert offered.topics(0).keys() - {"/diagnostics"} == SENSORS
    assert offered.topics(1).keys() - {"/clock"} == set()
    assert {name for name in offered.services() if not name.startswith("robot_node/")} == {"shutdown"}


def test_diagnostics_know_no_motors_and_no_fault_and_the_log_says_so_once(robot):
    link, board = (robot.diagnosed(robot.diagnostics, part) for part in ("Link", "Board"))
    assert (link["Motor Board Version"], link["Device ID"], board["Faults"]) == ("none", "8", "none")
    assert not any(robot.diagnosed(robot.diagnostics, part) for part in OF_A_MOTOR_BOARD)
    words = [line for line in robot.process.output() if "no motors" in line]
    assert len(words) == 1 and "pioneer (robot id 8, firmware 2)" in words[0]
