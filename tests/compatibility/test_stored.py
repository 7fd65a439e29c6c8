"""Each board reads what the firmware of an earlier release has stored in its EEPROM."""

import contextlib

import pytest

from mrl_driver.protocol.table import PARAMETER_BY_NAME
from tests.conformance.bench import BLANK, ENGINES, Bench
from tests.models import four_wheels

from .test_promises import REMEDY, promised

STORED = [(release, name, words) for release, _, name, words in promised("eeprom")]


@pytest.mark.parametrize("engine", sorted(ENGINES))
@pytest.mark.parametrize("release, name, words", STORED, ids=[f"{row[0]}-{row[1]}" for row in STORED])
def test_a_board_reads_the_eeprom_of_a_release(engine, release, name, words):
    used, meant = bytes.fromhex(words[0]), [each.partition("=") for each in words[1:]]
    eeprom = used + BLANK[len(used) :]
    motors, _, mega = name.partition("_")
    robot = four_wheels("mecanum") if mega else ""
    with contextlib.closing(Bench(engine, motors, robot, eeprom=eeprom)) as bench:
        bench.wake()
        for key, _, value in meant:
            number = PARAMETER_BY_NAME[key].number
            assert bench.reply("read_config", number) == (number, int(value)), f"{key} of {release}; {REMEDY}"
