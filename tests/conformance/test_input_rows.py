"""Bumpers, cliff sensors and the emergency stop of H-bridge boards: what they stop and refuse, and until when."""

import pytest

from mrl_driver.protocol.table import INPUTS, NOT_CONNECTED
from tests.models import WITH_INPUTS

BITS = {name: 1 << bit for bit, name in enumerate(INPUTS)}
ALL = sum(BITS.values())
REASONS = {"bumper": "bumper", "cliff": "cliff", "emergency": "emergency_stop"}
FORWARD, BACKWARD, TURN = (("move_differential", *speeds) for speeds in ((150, 0), (-150, 0), (0, 1000)))
DRIVE_S, STOP_S = 0.6, 6e-3
"""Boards that are stepped see the plant up to 1 ms late."""


@pytest.fixture
def fitted(make):
    """A duo with all inputs: `fitted(*active)` with some that are active from the start."""

    def build(*active, **board):
        bench = make(wake=False, board={**WITH_INPUTS, **board})
        press(bench, *active)
        return bench.wake()

    return build


def press(bench, *names):
    bench.plant.bridge.inputs.pressed = set(names)


def reason_of(name):
    return REASONS[name.partition("_")[0]]


@pytest.mark.parametrize("name", INPUTS)
def test_an_input_stops_the_robot_with_its_own_reason(fitted, name):
    bench = fitted()
    bench.ask(*(BACKWARD if name == "bumper_rear" else FORWARD), wait_s=DRIVE_S)
    press(bench, name)
    bench.run(STOP_S)
    assert not bench.is_driven()
    assert bench.stop_reason() == reason_of(name)
    assert bench.reply("read_inputs") == (BITS[name], int(name == "emergency_stop"), ALL)


@pytest.mark.parametrize("name", INPUTS)
def test_an_active_input_allows_moves_away_from_its_side_alone(fitted, name):
    """Neither wheel may turn towards it: not in a turn, and not to a position, which it holds in both directions."""
    bench = fitted(name)
    towards, away = (BACKWARD, FORWARD) if name == "bumper_rear" else (FORWARD, BACKWARD)
    moves = [
        towards,
        TURN,
        ("move_to_position", 1, 50, 1000),
        ("move_motors", -towards[1] // 5, towards[1] // 5),
    ]
    for move in moves:
        assert bench.ask(*move, wait_s=0.1) == [] and not bench.is_driven(), move
        assert bench.stop_reason() == reason_of(name)
    assert bench.counters() == {"unavailable": len(moves)}
    bench.ask(*away, wait_s=0.1)
    assert bench.is_driven() == (name != "emergency_stop")


def test_a_robot_that_backs_off_is_not_stopped_by_the_bumper_that_it_leaves(fitted):
    bench = fitted("bumper_left")
    bench.ask(*BACKWARD, wait_s=DRIVE_S)
    assert bench.is_driven() and bench.stop_reason() == "none"


@pytest.mark.parametrize(
    ("name", "active"), [("bumper_left", False), ("cliff_left", True), ("emergency_stop", True)]
)
def test_an_open_wire_reads_high(fitted, name, active):
    bench = fitted()
    bench.plant.bridge.inputs.open = {name}
    bench.run(STOP_S)
    assert bench.reply("read_inputs")[0] == BITS[name] * active


@pytest.mark.parametrize(
    "levels", [{"bumpers_high": 1}, {"cliffs_low": 1}, {"bumpers_high": 1, "cliffs_low": 1}]
)
def test_levels_of_bumpers_and_cliff_sensors_are_a_parameter(fitted, levels):
    bench = fitted(**levels)
    assert bench.reply("read_inputs") == (0, 0, ALL)
    press(bench, "bumper_left", "cliff_right")
    bench.run(STOP_S)
    assert bench.reply("read_inputs") == (BITS["bumper_left"] + BITS["cliff_right"], 0, ALL)


def test_the_emergency_stop_is_latched_until_it_is_released(fitted):
    bench = fitted("emergency_stop")
    assert bench.reply("read_inputs") == (BITS["emergency_stop"], 1, ALL)
    assert release(bench) == (1,)
    press(bench)
    bench.run(STOP_S)
    assert bench.reply("read_inputs") == (0, 1, ALL)
    bench.ask(*FORWARD, wait_s=0.1)
    assert not bench.is_driven() and bench.stop_reason() == "emergency_stop"
    assert release(bench) == (0,)
    bench.ask(*FORWARD, wait_s=0.1)
    assert bench.is_driven()


def release(bench):
    bench.ask("set_check", 1)
    reply = bench.reply("release_emergency")
    bench.ask("set_check", 0)
    return reply


def test_a_short_pulse_on_a_line_stops_nothing(fitted):
    bench = fitted()
    bench.ask(*FORWARD, wait_s=DRIVE_S)
    press(bench, "bumper_left")
    bench.run(0.5e-3)
    press(bench)
    bench.run(0.1)
    assert bench.is_driven()


def test_other_boards_have_no_inputs(omni3md):
    assert omni3md.ask("read_inputs") == [] and omni3md.counters() == {"unavailable": 1}


def test_a_write_of_the_wiring_keeps_the_latch(fitted):
    bench = fitted("emergency_stop")
    press(bench)
    bench.write_config("bumpers_high", 0)
    assert bench.reply("read_inputs") == (0, 1, ALL)
    bench.write_config("pin_emergency_stop", NOT_CONNECTED)
    bench.ask(*FORWARD, wait_s=0.1)
    assert bench.is_driven()
