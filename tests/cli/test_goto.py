"""`mrl goto`: goals in simulated time, and the command on an emulated board."""

import json
import math

import pytest

from mrl_driver.cli.commands.goto import drive_to
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError, GoalMissed
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import CHAIN_S
from sim_arduino.serve import factory
from sim_arduino.world import world_file
from tests.models import without_encoders

from .run import fails, mrl

PLACE_M, HEADING_RAD = 0.06, 0.1
LATE_S = 1.0


@pytest.fixture
def robot(tmp_path, close_later):
    """Makes a stepped driver among walls; its attribute `plant` has the true pose."""

    def make(walls):
        file = tmp_path / "world.yaml"
        file.write_text(f"walls: [{walls}]\n")
        emulated = close_later(factory.make(factory.Options(robot="traxbot"), world_file.load(str(file))))
        driver = close_later(SteppedDriver(emulated.engine))
        driver.connect()
        driver.plant = emulated.plant
        driver.wait(2 * CHAIN_S)
        return driver

    return make


def test_a_goal_behind_a_wall_is_reached_around_it(robot):
    """And the lines of progress come nearer."""
    driver, lines, goal = robot("[0.6, -0.25, 0.6, 0.25]"), [], Pose(1.2, 0.0, math.pi / 2)
    bumps = []
    driver.on_telemetry(lambda _: bumps.append(driver.plant.robot.state.bumped))
    assert drive_to(driver, goal, 120.0, lines.append) == ""
    true = driver.plant.true_pose
    assert math.hypot(true.x_m - goal.x_m, true.y_m - goal.y_m) < PLACE_M
    assert abs(true.yaw_rad - goal.yaw_rad) < HEADING_RAD
    assert not any(bumps) and driver.stopped
    assert float(lines[0].split()[0]) > float(lines[-1].split()[0])


def test_a_goal_that_takes_too_long_is_given_up_with_the_robot_stopped(robot):
    driver = robot("[0.6, -9, 0.6, 9]")
    begun_s = driver.now_s
    assert drive_to(driver, Pose(1.2, 0.0, 0.0), 5.0, str) == "the time of 5 s is over"
    assert driver.stopped and driver.now_s - begun_s < 5.0 + LATE_S


def test_a_robot_that_is_stopped_on_its_way_does_not_drive_on(robot):
    driver = robot("[9, -9, 9, 9]")
    with pytest.raises(BoardTimeout, match="stopped early"):
        drive_to(driver, Pose(1.0, 0.0, 0.0), 60.0, lambda _: driver.inhibit("test"))
    assert driver.pose.x_m < 0.5


def test_a_robot_whose_terminal_was_held_up_does_not_drive_on(robot):
    driver = robot("[9, -9, 9, 9]")
    with pytest.raises(BoardTimeout, match="stopped early: no new command arrived in time"):
        drive_to(driver, Pose(1.0, 0.0, 0.0), 60.0, lambda _: driver.wait(30.0))
    assert driver.pose.x_m < 0.5


@pytest.mark.emulated_board(robot="traxbot")
def test_the_command_drives_there_and_prints_where_the_robot_is(emulated_board):
    """A negative number is not an option."""
    done = mrl("goto", "0.06", "-0.01", "-0", "--port", emulated_board.port, "--yes", "--json")
    told = json.loads(done.stdout)
    assert (done.returncode, told["reached"], told["why"]) == (0, True, "")
    assert told["pose"]["x_m"] > 0.03 and told["goal"] == {"x_m": 0.06, "y_m": -0.01, "yaw_rad": 0.0}


@pytest.mark.emulated_board(robot="traxbot")
def test_a_goal_that_is_not_reached_has_its_own_exit_code(emulated_board):
    line = fails(
        GoalMissed.exit_code, "goto", "1", "0", "--port", emulated_board.port, "--yes", "--timeout", "0.1"
    )
    assert "the goal was not reached: the time of 0.1 s is over" in line


def test_a_robot_that_does_not_know_where_it_is_gets_no_goal(make_emulated_board, tmp_path):
    path = without_encoders(tmp_path)
    port = make_emulated_board(robot=path).port
    line = fails(ConfigError.exit_code, "goto", "1", "0", "--port", port, "--robot", path, "--yes")
    assert "robot duo has no odometry, because its motors have no encoders" in line


@pytest.mark.parametrize(
    "words, expected", [(("1",), "missing argument 'Y'"), (("1", "x"), "'x'"), (("nan", "0"), "nan")]
)
def test_a_goal_that_is_not_a_place_is_refused(words, expected):
    assert expected in fails(2, "goto", *words)
