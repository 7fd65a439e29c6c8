"""The pins of H-bridge boards: which wirings drive, what a board says of one that cannot, and who has no pins."""

import pytest

from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME, PINS
from mrl_driver.robot import wiring
from tests.wirings import rows

DRIVEN = [row for row in rows() if row.verdict == "drives"]
MOVE, DRIVE_S = ("move_differential", 150, 0), 0.8


@pytest.fixture
def motors():
    return "bridge"


def number(name):
    return PARAMETER_BY_NAME[f"pin_{name}"].number


def drives(bench):
    """Whether a move turns both wheels forward, and both encoders count that."""
    before = bench.reply("read_encoders")
    bench.ask(*MOVE, wait_s=DRIVE_S)
    after = bench.reply("read_encoders")
    wheels = bench.wheels()
    bench.ask("stop")
    return min(wheels) > 0.02 and all(b - a > 50 for a, b in zip(before, after))


@pytest.mark.parametrize("row", DRIVEN, ids=lambda row: row.name)
def test_a_wiring_drives(make, row):
    bench = make(board={"bridge": BRIDGES.index(row.bridge), **row.pins})
    assert bench.reply("read_wiring") == (0, -1, -1) and bench.status().faults == 0
    assert drives(bench)


@pytest.mark.parametrize(
    ("pins", "reply"),
    [
        ({row.name: -1 for row in PINS[:-1]}, (1, 28, -1)),
        ({"pin_left_logic": 20}, (2, 30, -1)),
        ({"pin_battery": 1}, (3, 43, -1)),
        ({"pin_left_encoder_b": 7}, (4, 35, 30)),
        ({"pin_left_pwm_a": 12, "pin_sonar_trigger": 5}, (5, 28, -1)),
        ({"pin_right_encoder_b": 13, "pin_sonar_power": -1}, (7, 37, -1)),
        ({"pin_right_logic": 19}, (9, 33, -1)),
    ],
    ids=["nothing", "20", "serial", "twice", "no PWM", "LED", "bus"],
)
def test_a_wiring_that_the_chip_cannot_do_refuses_every_move(make, pins, reply):
    """Until it is mended; then the board drives, without a reset."""
    bench = make(stored=pins)
    assert bench.reply("read_wiring") == reply
    assert bench.ask(*MOVE, wait_s=0.1) == [] and not bench.is_driven()
    for name in pins:
        bench.ask("write_config", PARAMETER_BY_NAME[name].number, bench.plant.model.board[name])
    assert bench.reply("read_wiring") == (0, -1, -1) and drives(bench)


def test_a_wiring_that_breaks_while_the_robot_drives_stops_it(bench):
    bench.ask(*MOVE, wait_s=DRIVE_S)
    bench.ask("write_config", number("left_encoder_a"), -1)
    assert not bench.is_driven() and bench.reply("read_wiring") == (1, number("left_encoder_a"), -1)
    assert bench.ask(*MOVE, wait_s=0.1) == [] and not bench.is_driven()


def test_the_pins_are_kept_and_defaults_leave_them(bench):
    bench.ask("write_config", number("battery"), -1)
    bench.ask("default_config")
    bench.ask("save_config", wait_s=0.6)
    bench.brown_out()
    bench.run(0.3)
    kept = [bench.reply("read_config", row.number)[1] for row in PINS]
    assert kept == list({**wiring.of_board(bench.plant.model.board), "pin_battery": -1}.values())


def test_other_boards_have_no_pins(omni3md):
    assert omni3md.ask("read_config", PINS[0].number) == omni3md.ask("write_config", PINS[0].number, 5) == []
    assert omni3md.ask("read_wiring") == []
    assert omni3md.counters() == {"argument_range": 2, "unavailable": 1}
