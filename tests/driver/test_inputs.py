"""Bumpers, cliff sensors and the emergency stop of the board: what the driver knows and does."""

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME, INPUTS
from mrl_driver.robot.inputs import Inputs
from mrl_driver.session.events import Reply
from mrl_driver.terminal.live_view import Screen, Settings
from mrl_driver.view.words import why_refused
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.shapes import Wall
from sim_arduino.world.world import World
from tests.models import WITH_INPUTS, bridged, model

HEARD_S, DRIVE_S = 0.3, 1.0


def stepped(world=None):
    duo = bridged(battery_divider=0, **WITH_INPUTS)._replace(sonars={})
    board = PythonBoard(Plant(duo, world or World()))
    robot = SteppedDriver(board, duo)
    robot.reset, robot.plant = board.reset, board.plant
    return robot


@pytest.fixture
def robot():
    with stepped() as made:
        made.wait(HEARD_S)
        yield made


def press(robot, *names):
    robot.plant.bridge.inputs.pressed = set(names)
    robot.wait(HEARD_S)


def drive(robot, linear_m_s):
    for _ in range(10):
        robot.drive(linear_m_s, 0.0)
        robot.wait(0.1)


def test_inputs_of_the_board_are_known(robot):
    assert robot.inputs == Inputs((), False, INPUTS)


@pytest.mark.parametrize(("name", "reason"), [("bumper_left", "bumper"), ("cliff_right", "cliff")])
def test_an_input_ends_the_command_and_lets_the_robot_back_off(robot, name, reason):
    drive(robot, 0.2)
    press(robot, name)
    assert robot.command is None and robot.stop_reason == reason and robot.inputs.active == (name,)
    drive(robot, 0.2)
    assert robot.command is None and robot.stop_reason == reason
    drive(robot, -0.1)
    assert robot.twist.linear_m_s == pytest.approx(-0.1, abs=0.02)


def test_a_wall_in_front_hits_the_bumpers_and_stops_the_robot():
    with stepped(World([Wall(0.5, -1.0, 0.5, 1.0)])) as robot:
        for _ in range(4):
            drive(robot, 0.2)
        assert robot.inputs.active == ("bumper_left", "bumper_right") and robot.stop_reason == "bumper"
        assert robot.plant.true_pose.x_m == pytest.approx(0.4, abs=0.01)


def test_an_emergency_stop_is_latched_until_it_is_released(robot):
    drive(robot, 0.2)
    press(robot, "emergency_stop")
    assert robot.command is None and robot.stop_reason is StopReason.EMERGENCY_STOP
    assert not robot.release_emergency()
    press(robot)
    assert robot.inputs.latched and not robot.drive(0.2, 0.0)
    assert "look whether all is well" in why_refused(robot)
    with pytest.raises(MrlError, match="move_motors is refused"):
        robot.request(BY_NAME["move_motors"].code, 10, 10)
    assert robot.release_emergency() and not robot.inputs.latched
    drive(robot, 0.1)
    assert robot.twist.linear_m_s > 0.05


def test_a_key_releases_the_emergency_stop_if_the_keys_drive(robot):
    press(robot, "emergency_stop")
    screen = Screen(robot, Settings(keys_drive=True), None, lambda: robot.now_s)
    screen.press("r", robot.now_s)
    assert robot.inputs.latched and "still pressed" in screen.live.notice
    press(robot)
    assert "key r in mrl drive" in why_refused(robot)
    Screen(robot, Settings(), None, lambda: robot.now_s).press("r", robot.now_s)
    assert robot.inputs.latched
    screen.press("r", robot.now_s)
    assert not robot.inputs.latched and screen.live.notice == ""


def test_the_latch_survives_a_reset_of_the_board(robot):
    press(robot, "emergency_stop")
    robot.plant.bridge.inputs.pressed = set()
    robot.reset()
    robot.wait(2.0)
    assert robot.inputs == Inputs((), True, INPUTS) and not robot.drive(0.2, 0.0)
    assert robot.release_emergency() and robot.drive(0.2, 0.0)


def test_changes_are_events(robot):
    seen = []
    robot.on_event(lambda event: seen.append(event.active) if isinstance(event, Inputs) else None)
    press(robot, "bumper_rear")
    press(robot)
    assert seen == [("bumper_rear",), ()]


def test_a_board_without_inputs_is_asked_once():
    with SteppedDriver(PythonBoard(Plant(model("duo"))), model("duo")) as robot:
        answers = []
        robot.on_event(lambda event: answers.append(event) if isinstance(event, Reply) else None)
        robot.wait(DRIVE_S)
        assert robot.inputs is None and len(answers) <= 1


def test_another_board_has_no_emergency_stop():
    with SteppedDriver(PythonBoard(Plant(model("traxbot"))), model("traxbot")) as robot:
        assert robot.inputs is None
        with pytest.raises(ConfigError, match="H-bridge"):
            robot.release_emergency()
