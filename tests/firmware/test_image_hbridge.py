"""The H-bridge image on the simulated chip: its outputs when something is wrong, and what its encoders count."""

from collections import Counter
from pathlib import Path
from typing import Dict, Iterator, List, Set

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BRIDGES, BY_NAME, FAULTS, PARAMETER_BY_NAME, WIRING
from sim_arduino.avr.machine import AvrMachine
from tests import models
from tests.long.bench.firmware_board import Rig, request

IMAGE = Path(__file__).resolve().parents[2] / "build" / "firmware" / "mrl_firmware_hbridge.elf"
HZ = 16_000_000
LEFT, RIGHT = (5, 6, 7), (11, 3, 9)  # PWM_A, PWM_B, LOGIC
OUTPUTS = LEFT + RIGHT
LEFT_A, LEFT_B, RIGHT_A, RIGHT_B = ENCODERS = (2, 4, 8, 10)
PORT = {True: 0x2B, False: 0x25}  # registers PORTD of pins below 8, PORTB
BATTERY_CHANNEL = 3
TB6612 = BRIDGES.index("tb6612")
SET, SINGLE_CHANNEL = (1 << [name for name, _ in WIRING].index(each) for each in ("set", "single_channel"))
DRIVEN = models.wired_eeprom(bridge=TB6612)
"""Of a board that has accepted its wiring when it starts."""
READY_S = 0.05
MOVES = (b"@9,40,40e", b"@10,40,40e", b"@11,200,0e", b"@12,1,40,500e")
HALF_DUTY = b"@10,50,50e"  # without speed control: nothing has to turn
ENDLESS_LOOP, NO_INTERRUPTS_AND_LOOP = b"\xff\xcf", b"\xf8\x94\xff\xcf"  # rjmp to itself; behind a cli
WDR, NOP, LDS, EOR = b"\xa8\x95", b"\x00\x00", 0x9000, 0x2400
MISSED_KICKS = "_ZN3hal12missed_kicksE"
MISSED_KICK_S = 0.256
SAMPLE_S = 78 * 64e-6
MOST_EDGES = 250  # of one encoder between two samples
STORM_S = 2.0e-3  # 250 edges without a pause, the pass of the loop that they interrupt, and the stop
CONVERTER_READINGS = 300  # 20 s


class Board(Rig):
    """A board wired as a duo's, with resistors that hold its outputs low, and encoders whose lines are low."""

    def __init__(self, eeprom: bytes = b"") -> None:
        super().__init__(IMAGE)
        for pin in OUTPUTS + ENCODERS:
            self.machine.set_pin(pin, 0)
        self.machine.write_eeprom(0, eeprom or models.wired_eeprom())
        self.machine.watch_pins(OUTPUTS)
        self.machine.power_cycle(1)
        self.machine.pin_changes()

    def boot(self) -> "Board":
        self.run(READY_S)
        return self

    def configure(self, **parameters: int) -> "Board":
        """Sets parameters; a TB6612 with known wiring and no ramp unless they say otherwise."""
        for name, value in {
            "robot_id": 1,
            "bridge": TB6612,
            "wiring": SET,
            "ramp_time": 0,
            **parameters,
        }.items():
            self.say(request("write_config", PARAMETER_BY_NAME[name].number, value))
        self.machine.pin_changes()
        return self

    def say(self, data: bytes, wait_s: float = 0.01) -> List[Frame]:
        """Sends bytes; the frames that come until `wait_s` after the last one."""
        self.replies()
        self.machine.run_until(self.machine.send(data) + int(wait_s * HZ))
        received = b"".join(reply.line for reply in self.replies())
        return [event for event in FrameDecoder(REPLIES).feed(received) if isinstance(event, Frame)]

    def status(self) -> Dict[str, int]:
        (frame,) = self.say(request("read_status"))
        return dict(zip((field.name for field in BY_NAME["read_status"].reply), frame.args))

    @property
    def stop_reason(self) -> str:
        return STOP_REASONS[self.status()["stop_reason"]]

    @property
    def faults(self) -> Set[str]:
        present = self.status()["faults"]
        return {name for bit, (name, _) in enumerate(FAULTS) if present >> bit & 1}

    def counts(self) -> List[int]:
        (frame,) = self.say(b"@6e")
        return [frame.args[1], frame.args[0]]

    def levels(self) -> Set[int]:
        return {pin for pin in OUTPUTS if self.machine.pin(pin)}

    def rises(self) -> List[int]:
        """Cycles at which an output rose since the last look."""
        return [change.cycle for change in self.machine.pin_changes() if change.level]

    def duties(self, seconds: float = 0.02) -> Dict[int, float]:
        """Shares of the next time for which each output is high."""
        before, start = [self.machine.high_cycles(pin) for pin in OUTPUTS], self.machine.cycle
        self.run(seconds)
        passed = self.machine.cycle - start
        return {pin: (self.machine.high_cycles(pin) - high) / passed for pin, high in zip(OUTPUTS, before)}

    def turn(self, pins: tuple, edges: int, edges_hz: float) -> None:
        """Turns an encoder forward (A before B) and lets it pass."""
        gap, start = HZ / edges_hz, self.machine.cycle + 100
        for channel, pin in enumerate(pins):
            self.machine.plan_edges(pin, [start + int(edge * gap) for edge in range(channel, edges, 2)])
        self.run((edges + 2) / edges_hz)

    def oscillate(self, pin: int, hertz: float, seconds: float) -> None:
        """Plans a line that goes to and fro from now on."""
        gap, start = HZ / hertz / 2, self.machine.cycle + 100
        self.machine.plan_edges(pin, [start + int(edge * gap) for edge in range(int(2 * hertz * seconds))])

    def hang(self, code: bytes = ENDLESS_LOOP) -> None:
        """Makes the program loop where it can be interrupted next."""
        while not self.machine.interrupts_on:
            self.run(1e-6)
        self.machine.patch(self.machine.pc, code)

    def mend(self) -> None:
        for address, data in self.machine.image_flash:
            self.machine.patch(address, data)


@pytest.fixture
def board() -> Iterator[Board]:
    each = Board().boot().configure()
    yield each
    each.close()


@pytest.fixture
def blank() -> Iterator[Board]:
    each = Board()
    yield each
    each.close()


@pytest.fixture(scope="module")
def saved() -> bytes:
    each = Board().boot().configure()
    each.say(request("save_config"), 0.5)
    contents = each.machine.read_eeprom()
    each.close()
    return contents


# ---- start


def test_no_output_rises_before_the_first_move(blank):
    """Not at power-up, not while the core sets its timers, not in the first half second."""
    blank.run(0.5)
    assert blank.rises() == []


@pytest.mark.parametrize("restart", ["reset", "brown_out"])
def test_a_reset_in_motion_leaves_the_outputs_low(board, restart):
    board.say(HALF_DUTY)
    assert board.rises()
    getattr(board.machine, restart)()
    board.machine.pin_changes()
    board.run(0.3)
    assert board.rises() == []


# ---- bridge or wiring not set


@pytest.mark.parametrize("move", MOVES)
def test_with_a_damaged_eeprom_every_move_is_refused(saved, move):
    damaged = bytearray(saved)
    damaged[20] ^= 0x10
    board = Board(bytes(damaged)).boot()
    board.say(move, 0.3)
    assert (board.rises(), board.faults & {"eeprom", "wiring"}) == ([], {"eeprom", "wiring"})
    board.close()


def test_a_saved_configuration_drives_after_power_up(saved):
    board = Board(saved).boot()
    board.say(HALF_DUTY)
    assert board.duties()[LEFT[0]] > 0.1
    board.close()


# ---- hung loop


def test_a_hung_loop_switches_the_outputs_off_at_its_first_missed_kick(board):
    """Within 256 ms of the last kick; the chip has not been reset yet."""
    board.say(HALF_DUTY)
    resets = board.machine.resets
    board.hang()
    hung = board.machine.cycle
    board.machine.pin_changes()
    board.run(MISSED_KICK_S)
    last_rise = board.rises()[-1]
    assert board.levels() == set() and last_rise - hung < MISSED_KICK_S * HZ
    assert board.machine.resets == resets


def test_a_loop_that_hangs_without_interrupts_is_reset(board):
    """The watchdog's second time-out; then the resistors hold the outputs low."""
    board.say(HALF_DUTY)
    resets = board.machine.resets
    board.hang(NO_INTERRUPTS_AND_LOOP)
    board.run(MISSED_KICK_S + 1e-3)
    assert board.machine.resets > resets and board.levels() == set()


def without_kicks(machine: AvrMachine) -> None:
    """Patches the kick of the watchdog: the WDR, and the look at the kicks that were missed, which finds none."""
    missed = machine.symbol(MISSED_KICKS).address.to_bytes(2, "little")
    ((begin, code),) = [piece for piece in machine.image_flash if WDR in piece[1]]
    for at in range(0, len(code) - 6, 2):
        load = int.from_bytes(code[at + 2 : at + 4], "little")
        if code[at : at + 2] == WDR and load & 0xFE0F == LDS and code[at + 4 : at + 6] == missed:
            register = load >> 4 & 31
            zero = EOR | register << 4 | register >> 4 << 9 | register & 15
            machine.patch(begin + at, NOP + zero.to_bytes(2, "little") + NOP)


def test_after_a_missed_kick_nothing_switches_the_outputs_on(board):
    """A loop that hangs where it writes the outputs again and again would."""
    board.say(HALF_DUTY)
    begun = board.machine.cycle
    without_kicks(board.machine)
    board.run(MISSED_KICK_S)
    assert board.rises()[-1] - begun < MISSED_KICK_S * HZ
    board.run(0.1)
    assert (board.rises(), board.levels()) == ([], set())


def test_a_loop_that_goes_on_after_a_missed_kick_drives_again(board):
    """It stood still for 200 ms; the host has not been told to stop."""
    board.say(HALF_DUTY)
    board.hang()
    board.run(0.2)
    assert board.levels() == set()
    board.mend()
    assert board.duties(0.1)[LEFT[0]] > 0.1


# ---- encoders


@pytest.mark.parametrize("wheel", [0, 1])
@pytest.mark.parametrize("way, sign", [(1, 1), (-1, -1)])
def test_each_edge_is_a_count(board, wheel, way, sign):
    pins = ENCODERS[2 * wheel : 2 * wheel + 2][::way]
    board.turn(pins, 1000, 10_000)
    assert board.counts()[wheel] == sign * 1000


def test_a_step_of_both_channels_is_counted_as_impossible(board):
    at = board.machine.cycle + 1000
    for pin in (LEFT_A, LEFT_B):
        board.machine.plan_edges(pin, [at])
    board.run(1e-3)
    assert (board.counts(), board.status()["impossible"]) == ([0, 0], 1)


def test_an_encoder_of_one_channel_counts_both_edges_of_it(board):
    board.configure(wiring=SET + SINGLE_CHANNEL)
    board.oscillate(LEFT_B, 300e3, 0.1)
    gap = HZ // 1000
    board.machine.plan_edges(LEFT_A, [board.machine.cycle + (edge + 1) * gap for edge in range(50)])
    board.run(0.11)
    assert board.counts() == [50, 0]


@pytest.mark.parametrize("pins", [(LEFT_A,), (LEFT_A, RIGHT_B)], ids=["one line", "a line of each"])
def test_an_oscillating_line_stops_the_robot(board, pins):
    """500 kHz: 250 edges take 1.5 ms, then the encoder's interrupt is masked, and the loop stops."""
    board.say(HALF_DUTY)
    for pin in pins:
        board.oscillate(pin, 500e3, 0.05)
    begun = board.machine.cycle
    board.machine.pin_changes()
    board.run(3 * SAMPLE_S)
    assert board.machine.pin_changes()[-1].cycle - begun < len(pins) * STORM_S * HZ
    assert board.stop_reason == "encoder"


def test_the_wheels_are_driven_after_the_chip_stood_still(board):
    """For 20 ms, four samples; the next one would come in the timer's next round, 4 s later."""
    board.say(HALF_DUTY)
    board.machine.stall_until(board.machine.cycle + HZ // 50)
    board.say(b"@10,20,20e")
    assert board.duties()[LEFT[0]] == pytest.approx(0.2, abs=0.02)


def test_an_oscillating_line_delays_no_stop(board):
    """A line at the most edges that are not masked yet, on each encoder."""
    board.say(HALF_DUTY)
    for pin in (LEFT_A, RIGHT_A):
        board.oscillate(pin, (MOST_EDGES - 5) / SAMPLE_S / 2, 0.1)
    board.machine.pin_changes()
    end = board.machine.send(b"@13e")
    board.machine.run_until(end + HZ // 100)
    assert board.machine.pin_changes()[-1].cycle - end < 1e-3 * HZ


def test_open_encoder_lines_are_pulled_up(board):
    pulled_up = {pin for pin in ENCODERS if board.machine.peek(PORT[pin < 8])[0] >> pin % 8 & 1}
    assert pulled_up == set(ENCODERS)


# ---- sleep


# ---- PWM

PWM_HZ = {
    "vnh5019": 7812.5,
    "cytron": 7812.5,
    "l298n": 3921.6,
    "tb6612": 31372.5,
    "drv8833": 31372.5,
    "bts7960": 7812.5,
    "l298n_enable": 3921.6,
}


@pytest.mark.parametrize("name", BRIDGES[1:])
def test_each_bridge_has_its_pwm_rate(board, name):
    board.configure(bridge=BRIDGES.index(name))
    board.say(HALF_DUTY)
    board.machine.pin_changes()
    board.run(0.1)
    rises = Counter(change.pin for change in board.machine.pin_changes() if change.level)
    assert [rate for _, rate in rises.most_common()] == pytest.approx(2 * [0.1 * PWM_HZ[name]], rel=0.01)


@pytest.mark.parametrize("name", BRIDGES[1:])
def test_full_duty_is_a_constant_level(board, name):
    board.configure(bridge=BRIDGES.index(name))
    board.say(b"@10,100,100e", 0.02)
    board.machine.pin_changes()
    board.run(0.05)
    assert board.machine.pin_changes() == []


# ---- battery


def test_battery_and_sonars_share_the_converter(board):
    """Each gets the voltage of its own input, at whatever phases their periods meet."""
    board.machine.adc_volts = lambda channel, time_s: 4.0 if channel == BATTERY_CHANNEL else 1.0
    board.configure(battery_divider=3000)
    board.run(1.0)
    readings = set()
    for _ in range(CONVERTER_READINGS):
        (sonars,), (info,) = board.say(b"@7e", 0.03), board.say(b"@5e", 0.03)
        readings |= {*sonars.args, info.args[2]}
    assert len(readings) == 2 and max(readings) == pytest.approx(1200, abs=5)
