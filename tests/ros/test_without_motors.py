"""The node on a board without motors: sensors and diagnostics, nothing that collides with the robot's own driver."""

import re

import pytest
from click.testing import CliRunner

from mrl_driver.errors import ConfigError
from ros1_bridge.demo import launcher
from ros1_bridge.demo.demo_screen import DemoScreen
from ros1_bridge.node.robot_parameters import check, without_motors
from ros1_bridge.topics.topic_robot import TopicRobot


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
