"""The driver without I/O: what a command does in each state of the robot."""

import pytest

from tests.models import model as load

from .robot import Robot


@pytest.fixture
def robot():
    return Robot(load("traxbot"))


def test_a_command_of_zero_is_a_command_while_the_battery_is_good(robot):
    robot.drive(0.2)
    assert robot.drive(0.0) and robot.motion.target == (0, 0)
    assert robot.motion.stop_reason == "none"


@pytest.mark.parametrize("goes_on, reason", [(True, "battery"), (False, "command_timeout")])
def test_the_gentle_stop_of_an_empty_battery_lasts_while_commands_come(robot, goes_on, reason):
    """The commands are refused, but show that their source is alive."""
    robot.until_empty(0.3)
    robot.until(lambda: (goes_on and robot.drive(0.3)) or robot.motion.target is None)
    assert robot.motion.stop_reason == reason


def test_a_restriction_holds_in_the_gentle_stop_of_an_empty_battery(robot):
    """As of a protective zone with an obstacle in it."""
    robot.until_empty(0.3)
    robot.core.limiter.restrict = lambda speeds, now: (0.0, 0.0)
    before = len(robot.board.moves)
    robot.until(lambda: len(robot.board.moves) > before)
    assert robot.board.moves[-1] == (0, 0)


def test_a_command_of_zero_with_an_empty_battery_leaves_the_reason_of_a_stop(robot):
    robot.until_empty(0.2)
    robot.core.stop(robot.now, "user")
    robot.drive(0.0)
    assert robot.motion.stop_reason == "user"


def test_a_board_that_was_taken_for_one_with_three_wheels_gets_the_commands_of_two():
    """Its plain answers were damaged; what it says under the checksum counts."""
    omni = b"@5,2500,172,1200,2,%de" % load("omni").ids[0]
    robot = Robot(None, lambda data: data.replace(b"@5,2500,172,1200,2,1e", omni))
    assert robot.drive(0.2)
    robot.until(lambda: robot.board.moves)
    assert robot.board.moves == [(200, 0)] and robot.core.state.model.name == "traxbot"
