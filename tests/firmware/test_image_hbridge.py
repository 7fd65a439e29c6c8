"""The H-bridge image on the simulated chip: its outputs when something is wrong, and what its encoders count."""

from bisect import bisect
from collections import Counter
from pathlib import Path
from typing import Dict, Iterator, List, Set

import pytest

from mrl_driver.protocol.table import BAUD, BAUDS, BRIDGES, INPUTS, PARAMETER_BY_NAME, WIRING
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip
from sim_arduino.avr.machine import AvrMachine
from tests import models
from tests.long.bench.bench_firmware import BRIDGE_EDGES_HZ
from tests.long.bench.bridge_board import BridgeRig
from tests.long.bench.firmware_board import ENDLESS_LOOP, Rig, hang, mend, request

BUILD = Path(__file__).resolve().parents[2] / "build" / "firmware"
IMAGES = {ATMEGA328P: "mrl_firmware_hbridge.elf", ATMEGA2560: "mrl_firmware_hbridge_mega.elf"}
HZ = 16_000_000
LEFT, RIGHT = (5, 6, 7), (11, 3, 9)  # PWM_A, PWM_B, LOGIC
OUTPUTS = LEFT + RIGHT
INACTIVE = {models.WITH_INPUTS[f"pin_{name}"]: int(name.startswith("bumper")) for name in INPUTS}
LEFT_A, LEFT_B, RIGHT_A, RIGHT_B = ENCODERS = (2, 4, 8, 10)
TB6612 = BRIDGES.index("tb6612")
SET = 1 << [name for name, _ in WIRING].index("set")
DRIVEN = models.wired_eeprom(bridge=TB6612)
"""Of a board that has accepted its wiring when it starts."""
READY_S = 0.05
MOVES = (b"@9,40,40e", b"@10,40,40e", b"@11,200,0e", b"@12,1,40,500e")
HALF_DUTY = b"@10,50,50e"  # without speed control: nothing has to turn
NO_INTERRUPTS_AND_LOOP = b"\xf8\x94" + ENDLESS_LOOP  # cli first
WDR, NOP, LDS, EOR = b"\xa8\x95", b"\x00\x00", 0x9000, 0x2400
MISSED_KICKS = "_ZN3hal12missed_kicksE"
MISSED_KICK_S = 0.256
SAMPLE_S = 78 * 64e-6
MOST_EDGES = 250  # of one encoder between two samples
LOOK_AT_BYTES, LONGEST_TASK_S = "_ZN3mrl8commands7receiveEv", 130e-6


class Board(Rig):
    """A board wired as a duo's, with resistors that hold its outputs low, and encoders whose lines are low."""

    def __init__(self, eeprom: bytes = b"", chip: Chip = ATMEGA328P) -> None:
        super().__init__(BUILD / IMAGES[chip], chip=chip)
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


@pytest.fixture
def board() -> Iterator[Board]:
    each = Board().boot().configure()
    yield each
    each.close()


@pytest.fixture
def turning() -> Iterator[BridgeRig]:
    """A board whose wheels turn, with an IMU that streams."""
    rig = BridgeRig(BUILD / IMAGES[ATMEGA328P], BRIDGE_EDGES_HZ).fit_imu(10).settle()
    yield rig
    rig.close()


# ---- start


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
def test_with_a_damaged_eeprom_every_move_is_refused(move):
    damaged = bytearray(DRIVEN)
    damaged[20] ^= 0x10
    board = Board(bytes(damaged)).boot()
    board.say(move, 0.3)
    assert (board.rises(), board.faults & {"eeprom", "wiring"}) == ([], {"eeprom", "wiring"})
    board.close()


# ---- hung loop


def test_a_hung_loop_switches_the_outputs_off_at_its_first_missed_kick(board):
    """Within 256 ms of the last kick; the chip has not been reset yet."""
    board.say(HALF_DUTY)
    resets = board.machine.resets
    hang(board.machine)
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
    hang(board.machine, NO_INTERRUPTS_AND_LOOP)
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
    hang(board.machine)
    board.run(0.2)
    assert board.levels() == set()
    mend(board.machine)
    assert board.duties(0.1)[LEFT[0]] > 0.1


# ---- encoders


def test_a_step_of_both_channels_is_counted_as_impossible(board):
    at = board.machine.cycle + 1000
    for pin in (LEFT_A, LEFT_B):
        board.machine.plan_edges(pin, [at])
    board.run(1e-3)
    assert (board.counts(), board.status()["impossible"]) == ([0, 0], 1)


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


def test_no_byte_of_the_host_waits_for_a_long_task(turning):
    """For six samples: the host sends without a pause, streams have all of the link, and wheels are controlled."""
    machine = turning.machine
    machine.send(b"@18e@9,40,40e")
    turning.run(0.02)
    look, looks, begun = machine.symbol(LOOK_AT_BYTES).address, [], machine.cycle
    count = round(6 * SAMPLE_S * BAUD / 10)
    end = machine.send(b"\r" * count)
    while not looks or looks[-1] <= end:
        machine.run_until(machine.cycle + 1)
        if machine.pc == look:
            looks.append(machine.cycle)
    arrivals = [begun + (end - begun) * (number + 1) / count for number in range(count)]
    waits = [looks[bisect(looks, arrival)] - arrival for arrival in arrivals]
    assert max(waits) < LONGEST_TASK_S * HZ


def test_passes_of_a_millisecond_leave_time_for_the_wheels():
    """The host's bytes and edges make them so long that each one looks at the inputs."""
    rig = BridgeRig(BUILD / IMAGES[ATMEGA328P], 40e3, pins={**models.DUO_PINS, **models.WITH_INPUTS})
    for pin, level in INACTIVE.items():
        rig.machine.set_pin(pin, level)
    machine = rig.settle().machine
    machine.send(request("set_baud", 1))
    rig.run(0.01)
    machine.set_host_baud(BAUDS[1])
    machine.send(HALF_DUTY)
    machine.watch_pins(rig.outputs)
    rig.run(0.1)
    assert machine.pin_changes()
    machine.send(b"@10,0,0e" * 600)
    rig.run(0.1)
    machine.pin_changes()
    rig.run(0.05)
    assert not machine.pin_changes()
    rig.close()


# ---- PWM

PWM_HZ = {
    "vnh5019": 7812.5,
    "cytron": 7812.5,
    "l298n": 3921.6,
    "tb6612": 31372.5,
    "drv8833": 31372.5,
    "bts7960": 7812.5,
    **dict.fromkeys(("l298n_enable", "l298p", "l298p_brake"), 3921.6),
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
