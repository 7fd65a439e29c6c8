"""Emulated boards as other people's tests see them."""

import os
import threading

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.hardware.omni3md_registers import Omni3MDRegisters
from sim_arduino.testing.emulated_board import COMMANDS, EmulatedBoard
from sim_arduino.world.shapes import Wall
from sim_arduino.world.world import World
from tests.sim.simulator import Client

FREE = World()
SPEED = 5.0


@pytest.fixture(scope="module")
def shared():
    """One board for the tests that only look."""
    with EmulatedBoard(FREE, speed=SPEED) as board:
        board.wait_until(lambda: len(board.motors.commands()) > 3)
        yield board


def test_commands_are_told_by_name(shared):
    assert shared.motors.commands("stop")[0].code == 0xFC


def test_an_assertion_that_holds(shared):
    shared.motors.assert_commanded("set_gains", 700, 400, 200)


def test_an_assertion_that_does_not_hold_tells_what_came(shared):
    with pytest.raises(
        AssertionError, match=r"not within 0.01 s: command move_omni\(1,\); .*set_timeout\(3,\)"
    ):
        shared.motors.assert_commanded("move_omni", 1, within_s=0.01)


def test_what_must_not_come(shared):
    shared.motors.assert_not_commanded("move_omni")
    with pytest.raises(AssertionError, match="expected no stop"):
        shared.motors.assert_not_commanded("stop")


def test_an_unknown_command_is_told(shared):
    with pytest.raises(ConfigError, match="command 'halt' is unknown, expected stop, calibrate"):
        shared.motors.commands("halt")


def test_an_unknown_option_is_told():
    with pytest.raises(ConfigError, match="option 'robots' is unknown, expected robot, robot_id"):
        EmulatedBoard(robots="traxbot")


def test_every_command_of_the_motor_board_has_a_name(shared):
    assert set(COMMANDS.values()) == set(Omni3MDRegisters(shared.plant.motor_board).writers)


def test_wheels_that_turn_and_stand():
    with EmulatedBoard(FREE, speed=SPEED) as board, Client(board.port) as client:
        board.motors.assert_stopped()
        board.wait_until(lambda: len(board.motors.commands()) > 3)
        client.send(b"@11,300,0e")
        board.motors.assert_moving()
        client.send(b"@13e")
        board.motors.assert_stopped()


def test_a_port_that_is_unplugged_comes_back_under_another_name():
    with EmulatedBoard(FREE) as board:
        before = board.port
        board.faults.unplug(0.1)
        board.wait_until(lambda: board.port != before)
        assert os.path.exists(board.port)


def test_times_of_a_fault_count_from_now():
    with EmulatedBoard(FREE, speed=SPEED) as board:
        board.wait_until(lambda: board.motors.commands("stop"))
        before_s = board.plant.motor_board.time_s
        board.faults.inject("reset:at=0.5")
        board.wait_until(lambda: len(board.motors.commands("stop")) > 1)
        assert board.motors.commands("stop")[-1].time_s >= before_s + 0.3


def test_two_boards_in_one_world_see_each_other():
    world = World([Wall(9, -9, 9, 9)])
    one = EmulatedBoard(world, name="one")
    with one, EmulatedBoard(world, name="two", pose="1,0,0"):
        assert [mover.name for mover in world.robots("one")] == ["two"]
    assert world.robots() == []


def test_a_robot_is_not_put_into_another():
    world = World()
    with EmulatedBoard(world, name="one"), pytest.raises(ConfigError, match=r"another robot \(one\)"):
        EmulatedBoard(world, name="two", pose="0.1,0,0")


def test_a_closed_board_leaves_no_thread():
    before = set(threading.enumerate())
    with EmulatedBoard(FREE):
        (made,) = set(threading.enumerate()) - before
    assert not made.is_alive()
