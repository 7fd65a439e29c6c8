"""Emulated boards as other people's tests see them."""

import threading

import pytest

from mrl_driver.errors import SimulatorError
from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.models import kit
from sim_arduino.testing.emulated_board import EmulatedBoard
from sim_arduino.world.world import World
from tests.models import four_wheel_kit
from tests.sim.simulator import Client

FREE = World()
SPEED = 5.0


@pytest.fixture(scope="module")
def shared():
    with EmulatedBoard(FREE, speed=SPEED) as board:
        board.wait_until(lambda: len(board.motors.commands()) > 3)
        yield board


def test_an_assertion_that_does_not_hold_tells_what_came(shared):
    with pytest.raises(
        AssertionError, match=r"not within 0.01 s: command move_omni\(1,\); .*set_prescaler\(3, 0\)"
    ):
        shared.motors.assert_commanded("move_omni", 1, within_s=0.01)


def test_what_must_come_and_what_must_not(shared):
    shared.motors.assert_commanded("set_gains", 700, 400, 200)
    shared.motors.assert_not_commanded("move_omni")
    with pytest.raises(AssertionError, match="expected no stop"):
        shared.motors.assert_not_commanded("stop")


def test_commands_that_are_forgotten_count_no_more():
    with EmulatedBoard(FREE) as board:
        board.motors.assert_commanded("set_timeout")
        board.motors.forget()
        board.motors.assert_not_commanded("set_timeout")


def test_what_must_not_come_may_have_come_long_ago():
    with EmulatedBoard(FREE) as board:
        with board.lock:
            motors = board.plant.motor_board
            motors.move_omni(motors.time_s, 1, 0, 0)
            for _ in range(1001):
                motors.stop(motors.time_s)
        with pytest.raises(AssertionError, match="expected no move_omni"):
            board.motors.assert_not_commanded("move_omni")


def test_wheels_that_turn_and_stand():
    with EmulatedBoard(FREE, speed=SPEED) as board, Client(board.port) as client:
        board.motors.assert_stopped()
        board.wait_until(lambda: len(board.motors.commands()) > 3)
        client.send(b"@11,300,0e")
        board.motors.assert_moving()
        client.send(b"@13e")
        board.motors.assert_stopped()


def test_a_rear_wheel_that_turns_alone(tmp_path):
    path = tmp_path / "skid.yaml"
    path.write_text(kit.text_of(four_wheel_kit("skid")))
    with EmulatedBoard(FREE, robot=str(path), speed=SPEED) as board, Client(board.port) as client:
        board.motors.assert_stopped()
        client.send(encode_request(BY_NAME["move_wheels"].code, 0, 0, 30, 0))
        board.motors.assert_moving()


def test_a_closed_board_leaves_no_thread():
    before = set(threading.enumerate())
    with EmulatedBoard(FREE):
        (made,) = set(threading.enumerate()) - before
    assert not made.is_alive()


@pytest.fixture
def dead():
    """A board that has failed; nobody has been told yet."""

    def fail(to_s):
        raise SimulatorError("the firmware crashed")

    before = set(threading.enumerate())
    board = EmulatedBoard(FREE)
    (thread,) = set(threading.enumerate()) - before
    board.plant.advance = fail
    thread.join()
    return board


@pytest.mark.parametrize(
    "look",
    [
        lambda board: board.true_pose,
        lambda board: board.true_speed_m_s,
        lambda board: board.motors.assert_not_commanded("move_omni"),
        lambda board: board.motors.assert_commanded("stop"),
        lambda board: board.faults.inject("loss"),
        lambda board: board.close(),
    ],
)
def test_a_board_that_has_failed_says_so_at_the_next_look(dead, look):
    with pytest.raises(SimulatorError, match="the firmware crashed"):
        look(dead)
    dead.close()


def test_an_error_of_the_block_comes_before_one_of_the_board(dead):
    with pytest.raises(AssertionError, match="own"), dead:
        raise AssertionError("own")
