"""HC-SR04 on the H-bridge image: the echo's time under full load on each clock, and its pins."""

from typing import Dict

import pytest

from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip
from tests.firmware.test_image_hbridge import HZ
from tests.firmware.test_image_wiring import CLOCKS, Board, outputs, pulled_up, wired, write
from tests.long.bench.bridge_board import Echoes
from tests.long.bench.firmware_board import request

TURN_S = 0.060032
ECHO_US = 40.0  # error of an echo's time under full load
EDGES_HZ, TURNS = 20_000, 12  # edges of each encoder; turns of the sensors
PLACES = {ATMEGA328P.name: ((13, 8), (14, 17)), ATMEGA2560.name: ((30, 50), (31, 69), (32, 21))}
"""Trigger and echo of sensors.  On the Uno the second echo is on a port with channels of an encoder; on the Mega the
third one is on an external interrupt."""


def pins_of(chip: Chip) -> Dict[str, int]:
    pins = [pin for place in PLACES[chip.name] for pin in place]
    return {"air_temperature": 20, **dict(zip((name for pair in wiring.RANGE_PINS for name in pair), pins))}


def load(board: Board, seconds: float, encoders) -> int:
    """Edges of both encoders, a stream without a pause, and commands without a pause; the number of edges of each."""
    start, gap, edges = board.machine.cycle, HZ / EDGES_HZ, 2 * round(seconds * EDGES_HZ / 2)
    for phase, pins in zip((0.0, 0.37), encoders):
        for place, pin in enumerate(pins):
            board.machine.plan_edges(
                pin, [start + int((edge + phase) * gap) for edge in range(place, edges, 2)]
            )
    while board.machine.cycle < start + seconds * HZ:
        board.machine.run_until(board.machine.send(b"@11,200,100e"))
    return edges


@pytest.mark.parametrize("name", CLOCKS)
def test_the_echo_is_exact_under_full_load(name):
    """And no edge of the encoders is lost to it."""
    bridge, pins, chip, _ = CLOCKS[name]
    encoders = wiring.encoder_pins(wiring.of_board(pins))
    with wired(bridge, {**pins, **pins_of(chip)}, chip) as board:
        echoes, errors_us, edges = Echoes(board.machine, PLACES[chip.name], name), [], 0
        for turn in range(TURNS):
            board.say(request("start_stream", 0), 0.0)
            edges += load(board, TURN_S, encoders)
            board.say(request("stop_stream"))
            (frame,) = board.say(request("read_ranges"))
            errors_us += echoes.errors_us(frame.args) if turn > 3 else ()
        assert max(errors_us) <= ECHO_US
        turned = edges * 2 // len(encoders)  # of four wheels, the rear ones stand
        assert (board.counts(), board.status()["impossible"]) == ([turned] * 2, 0)


def test_the_pins_of_ranges_are_a_low_output_and_an_input_without_a_pull_up():
    bridge, pins, chip, _ = CLOCKS["timer 1"]
    with wired(bridge, {**pins, **pins_of(chip)}) as board:
        assert {13, 14} < outputs(board) and not {8, 17} & (pulled_up(board) | outputs(board))
        board.say(request("write_config", 19, 0))
        assert outputs(board) == set()


def test_the_pin_of_an_awaited_echo_may_become_that_of_an_encoder():
    bridge, pins, chip, _ = CLOCKS["timer 1"]
    name = "pin_left_encoder_b"
    echo = {"pin_range_1_trigger": 13, "pin_range_1_echo": pins[name]}
    with wired(bridge, {**pins, **echo, name: -1}, chip) as board:
        board.run(2 * TURN_S)
        for parameter, pin in {**dict.fromkeys(echo, -1), name: pins[name]}.items():
            write(board, parameter, pin)
        before = board.counts()
        edges = load(board, TURN_S, wiring.encoder_pins(wiring.of_board(pins)))
        board.run(20e-3)
        assert [count - old for count, old in zip(board.counts(), before)] == [edges] * 2
