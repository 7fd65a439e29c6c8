"""The EEPROM configuration: defaults, damage, saving, and what a change does."""

import struct
from binascii import crc_hqx

import pytest

from mrl_driver.protocol.table import FAULTS, PARAMETER_BY_NAME, SETTINGS
from sim_arduino.board import parameter_store

FAULT = {name: 1 << bit for bit, (name, _) in enumerate(FAULTS)}
BLANK = b"\xff" * 1024
SAVED_S = 0.3  # 59 bytes of 3.4 ms at most
BLOCK_BYTES = 1 + 2 * len(SETTINGS) + 2
USED = [*range(4), *range(parameter_store.BLOCK_AT, parameter_store.BLOCK_AT + BLOCK_BYTES)]


def parameters(board):
    return [board.ask("read_config", row.number).args[1] for row in SETTINGS]


def float_id(value: float) -> bytes:
    return struct.pack("<f", value) + BLANK[4:]


@pytest.mark.parametrize("robot_id", [1, 3, 4, 5])
def test_sound_image(bench, robot_id):
    board = bench(robot_id=robot_id)
    assert parameters(board) == parameter_store.defaults(robot_id) and board.faults() == 0


def test_blank_eeprom(bench):
    board = bench(eeprom=BLANK)
    assert parameters(board) == parameter_store.defaults(0)
    assert board.faults() == FAULT["eeprom"] | FAULT["id_unset"]


@pytest.mark.parametrize("robot_id", [1, 4, 7, 11])
def test_board_of_2013_keeps_its_id(bench, robot_id):
    """The float at address 0 alone: defaults of that model."""
    board = bench(eeprom=float_id(robot_id))
    assert parameters(board) == parameter_store.defaults(robot_id) and board.faults() == FAULT["eeprom"]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 0.0, 1.5, 40000.0, 1e30])
def test_floats_that_are_no_id(bench, value):
    assert bench(eeprom=float_id(value)).ask("robot_info").args[4] == 0


@pytest.mark.parametrize("layout", [0, parameter_store.LAYOUT - 1, parameter_store.LAYOUT + 1])
def test_other_layout(bench, layout):
    """Older and newer layouts are not read, even with a right check value."""
    values = parameter_store.defaults(1)
    image = bytearray(parameter_store.image(values))
    body = struct.pack(f"<B{len(values)}h", layout, *values[:5], 1, *values[6:])
    image[16 : 16 + len(body)] = body
    struct.pack_into("<H", image, 16 + len(body), crc_hqx(body, 0xFFFF))
    board = bench(eeprom=bytes(image))
    assert parameters(board) == parameter_store.defaults(1) and board.faults() == FAULT["eeprom"]


def test_impossible_values_with_a_right_check_value(bench):
    """Half an axle of 0: written by something that does not know the ranges."""
    values = parameter_store.defaults(1)
    values[1] = 0
    board = bench(eeprom=parameter_store.image(values))
    assert parameters(board) == parameter_store.defaults(1) and board.faults() == FAULT["eeprom"]


@pytest.mark.parametrize("place", USED)
def test_every_damaged_byte_is_caught(bench, place):
    """A calibrated board with one wrong byte starts with the defaults of its model and says so."""
    values = parameter_store.defaults(4)
    values[1] += 100
    image = bytearray(parameter_store.image(values))
    for flip in (0x01, 0xFF):
        image[place] ^= flip
        board = bench(eeprom=bytes(image))
        assert board.faults() == FAULT["eeprom"]
        assert parameters(board) == parameter_store.defaults(4)
        image[place] ^= flip


def test_saved_image_is_the_documented_one(bench):
    """Id as float at 0, the block at 16, and nothing else."""
    board = bench(eeprom=BLANK)
    board.send("write_config", 0, 5)
    board.send("save_config", wait_s=SAVED_S)
    assert board.board.eeprom == parameter_store.image([5, *parameter_store.defaults(0)[1:]])


def test_saving_does_not_hold_up_the_loop(bench):
    board = bench(eeprom=BLANK)
    board.send("save_config", wait_s=0.01)
    assert board.ask("get_stream").args == (0,)
    board.run(SAVED_S)
    assert board.board.longest_pass_s < 1e-3


def test_a_change_while_saving_is_saved_too(bench):
    board = bench(eeprom=BLANK)
    board.send("save_config", wait_s=0.1)
    board.send("write_config", 1, 1234, wait_s=SAVED_S)
    board.board.reset()
    board.run(0.1)
    assert board.ask("read_config", 1).args == (1, 1234)


def test_eeprom_that_takes_nothing_is_reported(bench):
    board = bench()
    board.board.native.pc_break_eeprom(1)
    board.send("write_config", 10, 300)
    assert board.ask("save_config", wait_s=SAVED_S).args == (0,) and board.faults() & FAULT["eeprom"]
    board.board.native.pc_break_eeprom(0)
    assert board.ask("save_config", wait_s=SAVED_S).args == (1,), "a second save writes again"


def test_saving_clears_the_fault(bench):
    board = bench(eeprom=float_id(1))
    board.faults()
    board.send("save_config", wait_s=SAVED_S)
    assert board.faults() == 0


@pytest.mark.parametrize("row", SETTINGS, ids=lambda row: row.name)
def test_values_outside_a_parameters_range_are_refused(bench, row):
    board = bench()
    bad = [value for value in (row.low - 1, row.high + 1) if -32768 <= value <= 32767]
    for value in bad:
        board.send("write_config", row.number, value)
    assert board.counter("argument_range") == len(bad)
    assert board.ask("read_config", row.number).args[1] == parameter_store.defaults(1)[row.number]


def test_defaults_keep_the_id(bench):
    board = bench()
    board.send("write_config", 0, 5)
    board.send("write_config", 1, 1)
    assert board.ask("default_config").args == (1,)
    assert parameters(board) == parameter_store.defaults(5)


def test_defaults_are_in_force_at_once(bench):
    """The sonars' curve is computed from parameters when these change."""
    board = bench()
    board.run(0.5)
    before = board.ask("read_sonars").args
    board.send("write_config", PARAMETER_BY_NAME["sonar_b"].number, 5000, wait_s=0.3)
    changed = board.ask("read_sonars").args
    board.send("default_config", wait_s=0.3)
    assert changed != before and board.ask("read_sonars").args == before
