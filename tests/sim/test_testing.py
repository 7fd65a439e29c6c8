"""Emulated boards as other people's tests see them."""

import threading

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.hardware.omni3md_registers import Omni3MDRegisters
from sim_arduino.testing.emulated_board import COMMANDS, EmulatedBoard
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


def test_an_assertion_that_does_not_hold_tells_what_came(shared):
    with pytest.raises(
        AssertionError, match=r"not within 0.01 s: command move_omni\(1,\); .*set_timeout\(3,\)"
    ):
        shared.motors.assert_commanded("move_omni", 1, within_s=0.01)


@pytest.mark.parametrize(
    ("use", "text"),
    [
        (lambda board: board.motors.commands("halt"), "command 'halt' is unknown, expected stop, calibrate"),
        (lambda _: EmulatedBoard(robots="traxbot"), "option 'robots' is unknown, expected robot, robot_id"),
    ],
)
def test_an_unknown_name_is_told(shared, use, text):
    with pytest.raises(ConfigError, match=text):
        use(shared)


def test_what_must_come_and_what_must_not(shared):
    shared.motors.assert_commanded("set_gains", 700, 400, 200)
    shared.motors.assert_not_commanded("move_omni")
    with pytest.raises(AssertionError, match="expected no stop"):
        shared.motors.assert_not_commanded("stop")


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


def test_times_of_a_fault_count_from_now():
    with EmulatedBoard(FREE, speed=SPEED) as board:
        board.wait_until(lambda: board.motors.commands("stop"))
        before_s = board.plant.motor_board.time_s
        board.faults.inject("reset:at=0.5")
        board.wait_until(lambda: len(board.motors.commands("stop")) > 1)
        assert board.motors.commands("stop")[-1].time_s >= before_s + 0.3


def test_a_robot_is_not_put_into_another():
    world = World()
    with EmulatedBoard(world, name="one"), pytest.raises(ConfigError, match=r"another robot \(one\)"):
        EmulatedBoard(world, name="two", pose="0.1,0,0")
    assert world.robots() == []


def test_a_closed_board_leaves_no_thread():
    before = set(threading.enumerate())
    with EmulatedBoard(FREE):
        (made,) = set(threading.enumerate()) - before
    assert not made.is_alive()
