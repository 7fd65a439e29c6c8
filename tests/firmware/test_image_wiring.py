"""The H-bridge image with other wirings: pins without and with an accepted wiring, clocks, encoders, sensors."""

from collections import Counter
from contextlib import contextmanager
from typing import Dict, Iterator, List, Mapping, NamedTuple, Set, Tuple

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME, WIRING_PROBLEMS
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip
from sim_arduino.board import parameter_store
from tests import models
from tests.conftest import EXPLORE
from tests.firmware.imu_chip import ImuChip
from tests.firmware.test_image_hbridge import DRIVEN, HALF_DUTY, MOVES, OUTPUTS, PWM_HZ, SAMPLE_S, SET, Board
from tests.long.bench.firmware_board import hang, request

PORT_A, PORT_H = 0x20, 0x100  # PIN, DDR and PORT of each port
LETTERS = "ABCDEFG", "HJKL"
TWCR, TICK, SAMPLE_TICKS = 0xBC, 1024, 78
CLOCK, DUE = "_ZN3hal5clockE", "_ZN3hal10sample_dueE"
MOST_AWAKE = 0.065  # for each motor; a pass for the ramps of all takes 0.004 of it, and keeps a stop short
PINS = wiring.rows(ATMEGA328P)
BLANK = b"\xff" * parameter_store.EEPROM_BYTES
TICKS_OFF = 3  # a tick each for the two readings and for the change of the timer
ENCODERS = {
    "pin_left_encoder_a": 2,
    "pin_left_encoder_b": 4,
    "pin_right_encoder_a": 18,
    "pin_right_encoder_b": 19,
}


MEGA_ENCODERS = dict(zip(ENCODERS, (18, 19, 2, 3)))


class Wired(NamedTuple):
    bridge: str
    pins: Dict[str, int]
    chip: Chip = ATMEGA328P
    clock: int = 0


def with_pwm(bridge: str, clock: int = 0, chip: Chip = ATMEGA328P, **pins: int) -> Wired:
    encoders = ENCODERS if chip == ATMEGA328P else MEGA_ENCODERS
    return Wired(bridge, {**encoders, **{f"pin_{name}": pin for name, pin in pins.items()}}, chip, clock)


def mega(bridge: str, clock: int = 0, **pins: int) -> Wired:
    return with_pwm(bridge, clock, ATMEGA2560, **pins)


OTHERS = {
    **{"left_pwm_a": 11, "left_pwm_b": 5, "right_pwm_a": 6, "right_pwm_b": 44},
    **{"rear_left_pwm_a": 7, "rear_right_pwm_a": 45, "rear_left_encoder_a": 62, "rear_right_encoder_a": 63},
}
CLOCKS = {
    "timer 1": with_pwm("cytron", left_pwm_a=5, left_logic=7, right_pwm_a=11, right_logic=12),
    "timer 2": with_pwm("cytron", 1, left_pwm_a=9, left_logic=7, right_pwm_a=6, right_logic=12),
    "timer 0": with_pwm("cytron", 2, left_pwm_a=9, left_logic=7, right_pwm_a=11, right_logic=12),
    "timer 2 with PWM": with_pwm("bts7960", 3, left_pwm_a=9, left_pwm_b=5, right_pwm_a=11, right_pwm_b=3),
    "Mega, timer 1": mega("cytron", left_pwm_a=5, left_logic=22, right_pwm_a=6, right_logic=23),
    "Mega, timer 3": mega("cytron", 1, left_pwm_a=11, left_logic=22, right_pwm_a=6, right_logic=23),
    "Mega, timer 4": mega("cytron", 2, left_pwm_a=11, left_logic=22, right_pwm_a=5, right_logic=23),
    "Mega, timer 5": mega("bts7960", 3, left_pwm_a=11, left_pwm_b=5, right_pwm_a=6, right_pwm_b=4),
    "Mega, timer 2": mega("bts7960", 4, left_pwm_a=11, left_pwm_b=5, right_pwm_a=6, right_pwm_b=44),
    "Mega, timer 0": mega("bts7960", 5, **OTHERS, rear_left_pwm_b=12, rear_right_pwm_b=10),
    "Mega, timer 2 with PWM": mega("bts7960", 6, **OTHERS, rear_left_pwm_b=4, rear_right_pwm_b=10),
}
"""Wirings by the timer that is the clock."""


@contextmanager
def wired(
    bridge_name: str, pins: Mapping[str, int], chip: Chip = ATMEGA328P, _clock: int = 0, **settings: int
) -> Iterator[Board]:
    """A board that drives with this wiring, without a ramp; the lines of its encoders are low."""
    known = {"bridge": BRIDGES.index(bridge_name), "wiring": SET, "ramp_time": 0, **settings}
    board = Board(models.wired_eeprom(1, pins, chip, **known), chip)
    for name, pin in pins.items():
        if "encoder" in name and pin >= 0:
            board.machine.set_pin(pin, 0)
    board.machine.power_cycle(1)
    board.machine.pin_changes()
    board.boot()
    yield board
    board.close()


def outputs(board: Board) -> Set[int]:
    return _pins(board, 1)


def pulled_up(board: Board) -> Set[int]:
    return _pins(board, 2) - outputs(board)


def free_pins(board: Board) -> range:
    """All but those of the serial link."""
    return range(2, len(board.machine.chip.pins))


def _pins(board: Board, register: int) -> Set[int]:
    """Pins whose bit is set in register DDR (1) or PORT (2) of their port; the serial link's are left out."""
    found = set()
    for number in free_pins(board):
        pin = board.machine.chip.pins[number]
        far = pin.port in LETTERS[1]
        at = (PORT_H if far else PORT_A) + 3 * LETTERS[far].index(pin.port) + register
        if board.machine.peek(at)[0] >> pin.bit & 1:
            found.add(number)
    return found


def finding(board: Board) -> Tuple[str, int, int]:
    (frame,) = board.say(request("read_wiring"))
    problem, parameter, other = frame.args
    return WIRING_PROBLEMS[problem][0], parameter, other


def write(board: Board, name: str, value: int, wait_s: float = 0.02) -> None:
    """As a host does, which waits for the answer: a Mega checks its wiring for up to 17 ms."""
    board.say(request("write_config", PARAMETER_BY_NAME[name].number, value), wait_s)


def number(name: str) -> int:
    return PARAMETER_BY_NAME[name].number


# ---- without an accepted wiring


def damaged(at: int) -> bytes:
    contents = bytearray(DRIVEN)
    contents[at] ^= 0x10
    return bytes(contents)


PINS_AT, PINS_SIZE = parameter_store.PINS_AT, len(PINS) + 3
OTHER_SETTINGS = models.wired_eeprom(bridge=BRIDGES.index("cytron"), wiring=5)
WITHOUT = {
    "of another time": OTHER_SETTINGS[:PINS_AT] + DRIVEN[PINS_AT:],  # the power was cut while both were saved
    "blank": BLANK,
    "layout": damaged(PINS_AT),
    "pin": damaged(PINS_AT + 3),
    "check": damaged(PINS_AT + PINS_SIZE - 2),
}


@pytest.mark.parametrize("eeprom", WITHOUT.values(), ids=WITHOUT)
def test_without_a_sound_wiring_all_pins_are_inputs_and_every_move_is_refused(eeprom):
    board = Board(eeprom)
    board.machine.watch_pins(free_pins(board))
    board.machine.pin_changes()
    for move in MOVES:
        board.say(move, 0.1)
    assert (board.machine.pin_changes(), outputs(board), pulled_up(board)) == ([], set(), set())
    assert finding(board)[:2] in (
        ("not_connected", number("pin_left_pwm_a")),
        ("not_connected", number("pin_left_encoder_a")),
    )
    assert "wiring" in board.faults
    board.close()


def test_an_old_board_keeps_its_parameters():
    """Its EEPROM has the first block alone."""
    board = Board(DRIVEN[:PINS_AT] + BLANK[PINS_AT:]).boot()
    (frame,) = board.say(request("read_config", number("bridge")))
    assert frame.args[1] == BRIDGES.index("tb6612")
    assert board.faults == {"wiring"}
    board.close()


def test_a_saved_wiring_is_there_after_the_next_power_up():
    board = Board(BLANK).boot().configure()
    for name, value in models.DUO_PINS.items():
        write(board, name, value)
    board.say(request("save_config"), 0.6)
    stored = board.machine.read_eeprom(PINS_AT, PINS_SIZE - 2)
    assert stored == models.wired_eeprom()[PINS_AT : PINS_AT + PINS_SIZE - 2]
    board.machine.power_cycle(1)
    board.boot().say(HALF_DUTY)
    assert board.duties()[5] > 0.1
    board.close()


def test_defaults_leave_the_wiring_alone(board):
    board.say(request("default_config"))
    (frame,) = board.say(request("read_config", number("pin_battery")))
    assert frame.args[1] == models.DUO_PINS["pin_battery"]


@pytest.fixture
def board() -> Iterator[Board]:
    with wired("tb6612", models.DUO_PINS) as each:
        yield each


# ---- a wiring comes into force, and goes


def test_no_output_rises_when_a_wiring_comes_into_force():
    """Resistors hold the bridges low; the first levels that the board drives are low, too."""
    board = Board().boot()
    write(board, "bridge", BRIDGES.index("cytron"), 0.1)
    assert (board.rises(), finding(board)) == ([], ("none", -1, -1))
    assert {5, 6, 7, 11, 3, 9, 12, 13} == outputs(board)
    assert {2, 4, 8, 10, 18, 19} == pulled_up(board)
    board.close()


REST_LOW = {"bridge": BRIDGES.index("cytron"), "stop_mode": 0}
"""A bridge whose pins are low while its motor rests."""


@pytest.mark.parametrize("row", [*PINS, PARAMETER_BY_NAME["bridge"]], ids=lambda row: row.name)
def test_a_write_of_the_wiring_stops_and_lets_go_of_all_pins_first(board, row):
    """Pull-ups outside show both: a pin that the board has driven low rises when it becomes an input, and not before.

    It falls again if the new wiring is accepted, and stays an input otherwise.
    """
    board.configure(**REST_LOW)
    board.say(HALF_DUTY)
    for pin in OUTPUTS:
        board.machine.set_pin(pin, 1)
    board.machine.pin_changes()
    write(board, row.name, max(row.low, -1), 0.05)
    levels: Dict[int, List[int]] = {pin: [0] for pin in OUTPUTS}
    for change in board.machine.pin_changes():
        levels[change.pin].append(change.level)
    accepted = finding(board)[0] == "none" and row.name != "bridge"
    assert accepted == bool(outputs(board)), "nothing stays an output otherwise"
    end = [0, 1, 0] if accepted else [0, 1]
    driven = set(OUTPUTS) - {models.DUO_PINS.get(row.name)}
    assert {pin: levels[pin][-len(end) :] for pin in driven} == dict.fromkeys(driven, end)
    assert board.stop_reason == "host"


@pytest.mark.parametrize("name", CLOCKS)
def test_after_a_missed_kick_no_output_is_high(name):
    with wired(*CLOCKS[name]) as board:
        board.machine.watch_pins(free_pins(board))
        board.say(HALF_DUTY)
        hang(board.machine)
        board.run(0.2)
        high = {pin for pin in outputs(board) if board.machine.pin(pin)}
        assert high == set()


def test_enables_are_high_until_a_missed_kick():
    bridge, pins, *_ = CLOCKS["timer 0"]
    with wired(bridge, {**pins, "pin_enable_1": 13, "pin_enable_2": 8}) as board:
        board.say(b"@13e")
        assert board.machine.pin(13) and board.machine.pin(8)
        hang(board.machine)
        board.run(0.2)
        assert not board.machine.pin(13) and not board.machine.pin(8)


# ---- the clock


def board_time(board: Board) -> Tuple[int, int]:
    """Board time [tick] at a reply, and the end of its request [cycle]."""
    board.replies()
    end = board.machine.send(request("read_encoders", checked=True))
    board.run(10e-3)
    decoder = FrameDecoder(REPLIES)
    decoder.checked = True
    received = b"".join(reply.line for reply in board.replies())
    (stamp,) = [event.stamp for event in decoder.feed(received) if isinstance(event, Frame) and event.stamp]
    return stamp.time, end


@pytest.mark.parametrize("name", CLOCKS)
def test_board_time_goes_on_in_ticks_on_each_clock(name):
    """Also over a change from timer 1, which is the clock of a board without a wiring."""
    bridge, pins, chip, clock = CLOCKS[name]
    with wired(bridge, pins, chip, bridge=0) as board:
        board.say(request("set_check", 1, checked=True))
        change = request("write_config", number("bridge"), BRIDGES.index(bridge), checked=True)
        for line, seconds in ((change, 0.1), (b"", 1.0), (b"", 1.9)):
            before, begun = board_time(board)
            board.machine.send(line)
            board.run(seconds)
            after, ended = board_time(board)
            passed = (after - before) % 65536
            assert abs(passed - (ended - begun) / TICK) <= TICKS_OFF
        assert board.machine.peek(board.machine.symbol(CLOCK).address)[0] == clock


@pytest.mark.parametrize("name", CLOCKS)
def test_samples_have_their_period_on_each_clock(name):
    with wired(*CLOCKS[name]) as board:
        board.say(HALF_DUTY)
        due = board.machine.symbol(DUE).address
        seen = set()
        for _ in range(40):
            board.run(SAMPLE_S / 4)
            seen.add(int.from_bytes(board.machine.peek(due, 2), "little"))
        gaps = {(later - earlier) % 65536 for earlier, later in zip(sorted(seen), sorted(seen)[1:])}
        assert gaps == {SAMPLE_TICKS} and len(seen) >= 10


def test_samples_go_on_over_each_change_of_the_clock():
    """Told as the host does: without a bridge, the pins, the bridge; each to its neighbours, with a seed to all."""
    ways = []
    for chip in (ATMEGA328P, ATMEGA2560):
        names = [name for name, wires in CLOCKS.items() if wires.chip == chip]
        for step in range(1, len(names)) if EXPLORE else (1, len(names) - 1):
            ways += zip(names, names[step:] + names[:step])
    assert len(ways) >= 2 * len(CLOCKS)
    for name, other in ways:
        with wired(*CLOCKS[name]) as board:
            bridge, pins, _, expected = CLOCKS[other]
            changes = {**wiring.EMPTY, **pins, "bridge": BRIDGES.index(bridge)}
            for parameter, value in {"bridge": 0, **wiring.EMPTY}.items():
                write(board, parameter, value)
            for parameter, value in changes.items():
                write(board, parameter, value)
            begun = board.machine.peek(board.machine.symbol(DUE).address, 2)
            board.run(10 * SAMPLE_S)
            ended = board.machine.peek(board.machine.symbol(DUE).address, 2)
            passed = (int.from_bytes(ended, "little") - int.from_bytes(begun, "little")) % 65536
            clock = board.machine.peek(board.machine.symbol(CLOCK).address)[0]
            assert (name, other, passed // SAMPLE_TICKS) == (name, other, pytest.approx(10, abs=1))
            assert clock == expected


WITH_BUS = Wired("tb6612", models.DUO_PINS)


@pytest.mark.parametrize("wires", [*CLOCKS.values(), WITH_BUS], ids=[*CLOCKS, "with an I2C bus"])
def test_the_chip_sleeps_on_each_clock(wires):
    with wired(*wires) as board:
        board.run(0.5)
        awake, begun = board.machine.awake_cycles, board.machine.cycle
        board.run(1.0)
        share = (board.machine.awake_cycles - awake) / (board.machine.cycle - begun)
        assert share < MOST_AWAKE * wiring.motors({**wiring.EMPTY, **wires.pins})


# ---- PWM of timer 1

ON_TIMER_1 = {
    "cytron": with_pwm("cytron", left_pwm_a=9, left_logic=7, right_pwm_a=10, right_logic=12),
    "l298n": with_pwm("l298n", left_pwm_a=12, left_pwm_b=9, left_logic=7, right_pwm_b=10, right_logic=8),
    "drv8833": with_pwm("drv8833", left_pwm_a=9, left_pwm_b=10, right_pwm_a=5, right_pwm_b=6),
    "l298n_enable": with_pwm(
        "l298n_enable", left_pwm_a=9, left_pwm_b=8, left_logic=7, right_pwm_a=10, right_pwm_b=5, right_logic=6
    ),
}
"""A bridge for each mode of the timer, and one with PWM on its enable."""
QUARTER_AND_HALF = {
    "cytron": {9: 0.25, 10: 0.5, 7: 0, 12: 1},
    "l298n": {9: 0.25, 10: 0.5, 7: 0, 8: 1, 12: 1},
    "drv8833": {9: 1, 10: 0.75, 5: 0.5, 6: 1},
    "l298n_enable": {9: 0.25, 8: 1, 7: 0, 10: 0.5, 5: 0, 6: 1},
}
"""Shares of time for which each output is high at a quarter of the duty forward, and half of it backward."""


@pytest.mark.parametrize("name", ON_TIMER_1)
def test_timer_1_makes_pwm_as_the_others_do(name):
    with wired(*ON_TIMER_1[name]) as board:
        board.machine.watch_pins(outputs(board))
        board.say(b"@10,25,-50e")
        before = {pin: board.machine.high_cycles(pin) for pin in outputs(board)}
        begun = board.machine.cycle
        board.machine.pin_changes()
        board.run(0.1)
        passed = board.machine.cycle - begun
        shares = {pin: (board.machine.high_cycles(pin) - high) / passed for pin, high in before.items()}
        assert shares == pytest.approx(QUARTER_AND_HALF[name], abs=0.01)
        rises = Counter(change.pin for change in board.machine.pin_changes() if change.level)
        assert sorted(rises.values()) == pytest.approx(2 * [0.1 * PWM_HZ[name]], rel=0.01)


@pytest.mark.parametrize("pin", [4, 5, 6, 7, 8, 9, 10, 11, 12, 44, 45, 46])
def test_each_pwm_pin_of_a_mega_has_its_duty(pin):
    """Next to one of timer 4 or 5, and direction pins on two ports behind the I/O space."""
    other = 8 if pin > 8 else 46
    wires = mega("cytron", left_pwm_a=pin, left_logic=42, right_pwm_a=other, right_logic=17)
    with wired(*wires) as board:
        board.say(b"@10,25,-50e")
        begun = board.machine.cycle
        before = {each: board.machine.high_cycles(each) for each in (pin, other, 42, 17)}
        board.run(0.1)
        passed = board.machine.cycle - begun
        shares = {each: (board.machine.high_cycles(each) - high) / passed for each, high in before.items()}
        assert shares == pytest.approx({pin: 0.25, other: 0.5, 42: 0, 17: 1}, abs=0.01)


# ---- encoders


class Places(NamedTuple):
    left: Tuple[int, int]
    right: Tuple[int, int]
    chip: Chip = ATMEGA328P


PLACES = {
    "a port each": Places((2, 4), (18, 19)),
    "one port": Places((2, 7), (3, 4)),
    "channels on two ports": Places((2, 14), (8, 15)),
    "crossed": Places((2, 8), (9, 3)),
    "port C": Places((14, 15), (16, 17)),
    "Mega, external": Places((2, 3), (18, 19), ATMEGA2560),
    "Mega, others of them": Places((21, 20), (19, 2), ATMEGA2560),
    "Mega, D10 and D50": Places((10, 53), (50, 11), ATMEGA2560),
    "Mega, D14": Places((14, 62), (15, 69), ATMEGA2560),
    "Mega, A8 to A15": Places((62, 65), (63, 69), ATMEGA2560),
    "Mega, a line and a group": Places((2, 62), (64, 18), ATMEGA2560),
    "Mega, B without interrupt": Places((2, 22), (68, 42), ATMEGA2560),
}
MOTORS = {"pin_left_pwm_a": 5, "pin_left_logic": 12, "pin_right_pwm_a": 6, "pin_right_logic": 13}


def with_encoders(left: Tuple[int, int], right: Tuple[int, int]) -> Dict[str, int]:
    names = [row.name for row in PINS if "encoder" in row.name]
    return {**MOTORS, **dict(zip(names, left + right))}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("way, sign", [(1, 1), (-1, -1)])
def test_each_edge_of_both_encoders_is_a_count(place, way, sign):
    left, right, chip = PLACES[place]
    with wired("cytron", with_encoders(left, right), chip) as board:
        board.turn(left[::way], 1000, 20_000)
        board.turn(right[::way], 600, 20_000)
        assert (board.counts(), board.status()["impossible"]) == ([sign * 1000, sign * 600], 0)


def test_an_encoder_without_channel_b_counts_in_the_direction_of_the_drive():
    with wired("cytron", {**with_encoders((2, 4), (8, -1))}) as board:
        board.say(b"@10,-50,-50e")
        board.oscillate(8, 1000, 0.05)
        board.run(0.06)
        assert board.counts() == [0, -100]


@pytest.mark.parametrize("place", PLACES)
def test_an_oscillating_line_stops_the_robot_wherever_it_is(place):
    left, right, chip = PLACES[place]
    for pin in (left[0], right[0 if "without" in place else 1]):
        with wired("cytron", with_encoders(left, right), chip) as board:
            board.say(HALF_DUTY)
            board.oscillate(pin, 500e3, 0.015)
            board.run(3 * SAMPLE_S)
            assert (pin, board.stop_reason) == (pin, "encoder")


# ---- bus, sonars, battery


@pytest.mark.parametrize("pin", [-1, 15])
def test_the_pull_up_of_an_input_goes_when_it_gets_another_pin(pin):
    with wired("tb6612", {**models.DUO_PINS, **models.WITH_INPUTS, "pin_bumper_right": -1}) as board:
        assert 14 in pulled_up(board)
        write(board, "pin_bumper_left", pin)
        assert 14 not in pulled_up(board)


def test_a_wiring_without_a_bus_leaves_its_pins_alone():
    with wired("tb6612", {**models.DUO_PINS, "i2c": 0}) as board:
        board.machine.i2c[0x68] = ImuChip()
        board.run(1.0)
        assert (board.machine.peek(TWCR), {18, 19} & pulled_up(board)) == (b"\0", set())
        assert len(board.say(request("read_protocol"))) == 1, "the answer does not wait for an IMU"


@pytest.mark.parametrize("phase_us", range(0, 1400, 140))
def test_an_imu_is_found_again_after_a_change_in_the_middle_of_its_transfers(phase_us):
    with wired("tb6612", models.DUO_PINS) as board:
        chip = board.machine.i2c[0x68] = ImuChip()
        board.run(1.0)
        change = request("write_config", number("bridge"), BRIDGES.index("tb6612"))
        board.machine.send(change)
        board.run(3e-3 + phase_us * 1e-6)
        board.machine.send(change)
        board.run(0.15)
        assert board.faults <= {"wiring"}
        board.say(b"@46e")
        ((line, *_),) = board.imu_frames
        (frame,) = FrameDecoder(REPLIES).feed(line)
        assert frame.args == chip.gyro + chip.accel


@pytest.mark.parametrize(
    "pins, first, chip",
    [
        (models.DUO_PINS, 14, ATMEGA328P),
        (models.MEGA_PINS, 54, ATMEGA2560),
        (models.MEGA_PINS, 62, ATMEGA2560),
    ],
    ids=["Uno", "A0", "A8"],
)
def test_sonars_and_battery_are_read_on_their_pins(pins, first, chip):
    """On others than those of a duo, whose readings they have."""
    volts, base = {5: 1.0, 1: 1.5, 2: 2.0, 0: 4.0}, first - chip.analog
    places = {"pin_sonar_front": first + 5, "pin_sonar_left": first + 1, "pin_battery": first, "i2c": 0}
    with wired("tb6612", {**pins, **places, "pin_sonar_right": -1}, chip, battery_divider=3000) as board:
        board.machine.adc_volts = lambda channel, time_s: volts.get(channel - base, 5.0)
        board.run(1.5)
        (sonars,), (info,) = board.say(b"@7e"), board.say(b"@5e")
    with wired("tb6612", models.DUO_PINS) as board:
        board.machine.adc_volts = lambda channel, time_s: {0: 1.0, 1: 1.5}.get(channel, 2.0)
        board.run(1.5)
        (expected,) = board.say(b"@7e")
    assert sonars.args == (*expected.args[:2], -1)
    assert info.args[2] == pytest.approx(1200, abs=5)
