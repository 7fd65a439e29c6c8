"""The board's check of a wiring finds what the host's does."""

import ctypes
import random

import pytest

from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P
from tests.firmware.pc_board import BRIDGE, load
from tests.wirings import random_wiring, rows

TRIALS = 20_000
SEED = 20261129


@pytest.fixture(scope="module")
def native():
    return load(BRIDGE)


def found_by_board(native, pins, bridge):
    values = (ctypes.c_int8 * len(wiring.NAMES))(*(pins[name] for name in wiring.NAMES))
    reply = (ctypes.c_int8 * 3)()
    native.pc_wiring_check(values, BRIDGES.index(bridge), reply)
    return tuple(reply)


def test_random_wirings(native):
    chance, problems = random.Random(SEED), set()
    for _ in range(TRIALS):
        pins, bridge = random_wiring(chance, ATMEGA328P)
        expected = wiring.check(pins, bridge, ATMEGA328P)
        assert found_by_board(native, pins, bridge) == expected.reply, (pins, bridge)
        problems.add(expected.name)
    assert len(problems) >= 9, "most problems were among them"


def test_wirings_of_real_robots(native):
    for row in rows():
        if row.board == "Uno" and row.bridge in BRIDGES:
            expected = wiring.check(row.pins, row.bridge, ATMEGA328P)
            assert found_by_board(native, row.pins, row.bridge) == expected.reply, row.name
