"""The board's check of a wiring finds what the host's does."""

import ctypes
import random

import pytest

from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560
from tests.conftest import EXPLORE
from tests.firmware.pc_board import BRIDGE, MEGA, load
from tests.wirings import random_wiring, rows

TRIALS = 60_000 if EXPLORE else 2_000
SEED = int(EXPLORE or 20261129)


LIBRARIES = {ATMEGA328P: BRIDGE, ATMEGA2560: MEGA}


@pytest.fixture(scope="module", params=LIBRARIES, ids=lambda chip: chip.name)
def chip(request):
    return request.param


@pytest.fixture(scope="module")
def native(chip):
    return load(LIBRARIES[chip])


def found_by_board(native, chip, pins, bridge):
    names = [row.name for row in wiring.rows(chip)]
    values = (ctypes.c_int8 * len(names))(*(pins[name] for name in names))
    reply = (ctypes.c_int8 * 3)()
    native.pc_wiring_check(values, BRIDGES.index(bridge), reply)
    return tuple(reply)


def test_random_wirings(native, chip):
    chance, problems = random.Random(SEED), set()
    for _ in range(TRIALS):
        pins, bridge = random_wiring(chance, chip)
        expected = wiring.check(pins, bridge, chip)
        assert found_by_board(native, chip, pins, bridge) == expected.reply, (pins, bridge)
        problems.add(expected.name)
    assert len(problems) >= 9, "most problems were among them"


def test_wirings_of_real_robots(native, chip):
    for row in rows():
        if row.has_table and row.chip == chip:
            expected = wiring.check(row.pins, row.bridge, chip)
            assert found_by_board(native, chip, row.pins, row.bridge) == expected.reply, row.name
