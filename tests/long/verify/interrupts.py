"""`python -m tests.long.verify.interrupts` interrupts functions that share data with interrupts at each instruction.

The results are in build/verify/interrupts.json, the figures in build/bench/verify.json.
"""

import json
import pathlib
import random
import subprocess
import sys
import time
from functools import partial
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

from sim_arduino.avr.machine import AvrMachine
from tests.long.bench import report
from tests.long.bench.figures import ROOT
from tests.long.verify.edits import Edit, sketch

BUILD = ROOT / "build" / "verify"
COMPILE = (
    "avr-g++ -mmcu=atmega328p -DF_CPU=16000000L -O2 -g -flto -fuse-linker-plugin -ffunction-sections -fdata-sections "
    "-Wl,--gc-sections -std=gnu++11 -fno-exceptions -fno-threadsafe-statics"
)
"""The options of firmware.mk for the hardware layer."""
BUILDS = {
    "": [],
    "bridge": ["-DMRL_BRIDGE=1"],
    "xbee": ["-DMRL_XBEE=1"],
    "environment": ["-DMRL_ENVIRONMENT=1"],
}

TICK = 1024  # cycles
SAMPLE = 78 * TICK
BIT_OF_RADIO = 52 * 32
INT0, PCINT0, PCINT2, WDT, CAPTURE, COMPARE_B, RECEIVED = 1, 3, 5, 6, 10, 12, 18
PCICR, GPIOR0, UCSR0B, WDTCSR = 0x68, 0x3E, 0xC1, 0x60
SEI, OUT_SREG, OUT_SREG_MASK = 0x9478, 0xBE0F, 0xFE0F
MARGIN = 20  # Cycles before and after the function in which the event strikes too
SHIFTS, PASSES = 25, 40
"""The idle loop has 5 cycles.  By chance, the calls begin at any of them, and the events come at any of them."""
ENTRY = 4
ASLEEP = 150  # Cycles after which `sleep_until` sleeps
SLEEP_TICKS = 100
CARRY_LEAD = 33  # The edge's interrupt reads the counter so many cycles after the edge, at least
BYTE = 10 * 8 * 17
KICK = "watchdog_kick, missed kick"
"""After the first instruction of this function the watchdog's interrupt is 128 ms away, and cannot come."""
OUTPUTS = (5, 6, 7, 11, 3, 9)
ENCODER_BYTES, COUNT_AT = 15, 11
DUST, RADIO_OUT = 8, 3


class Torn(AssertionError):
    """An interrupted function had a result that it has neither before nor after the interrupt."""


class Missed(AssertionError):
    """An instruction was never interrupted, so that a check has not shown what it should."""


class Figures(NamedTuple):
    """What one case has shown: instructions at which the function may be interrupted, those that were, and runs."""

    name: str
    boundaries: int
    interrupted: int
    runs: int
    outcomes: int


def build(kind: str, edit: Optional[Edit] = None, name: str = "") -> pathlib.Path:
    """Compile the functions of one build; `edit` replaces text in one file: (file, old, new)."""
    folder = BUILD / (name or f"interrupts_{kind}")
    folder.mkdir(parents=True, exist_ok=True)
    source = sketch(folder, edit)
    sources = [str(path) for path in sorted(source.glob("src/hal/*.cpp"))]
    target = folder / "image.elf"
    main = str(ROOT / "tests" / "long" / "verify" / "interrupts.cpp")
    subprocess.run(
        [*COMPILE.split(), *BUILDS[kind], f"-I{source}", main, *sources, "-o", str(target)],
        check=True,
        timeout=120,
    )
    return target


class Chip:
    """A chip that waits for orders, each of which is one call of a function."""

    def __init__(self, elf: pathlib.Path) -> None:
        self.machine = AvrMachine(elf)
        flash = self.machine.image_flash
        self._code = {address + i: value for address, data in flash for i, value in enumerate(data)}
        self.machine.run(2e-3)
        self._idle = min(self._pcs(60))
        self.shift = 0
        """Moves the passes of the idle loop, each of which may see an order, against the next event."""
        self._latency = 0
        self._sample = 0
        self._watchdog = 0

    def _pcs(self, cycles: int) -> List[int]:
        pcs = []
        for _ in range(cycles):
            self.machine.run_until(self.machine.cycle + 1)
            pcs.append(self.machine.pc)
        return pcs

    # ---- variables

    def at(self, name: str) -> int:
        """Address of a variable of the hardware layer or of the program."""
        symbols = self.machine.symbols
        ends = (name, f"hal{len(name)}{name}E", f"_1{len(name)}{name}E")
        (symbol,) = (one for key, one in symbols.items() if key.endswith(ends) and "sub_I" not in key)
        return symbol.address

    def get(self, name: str, count: int = 1, offset: int = 0) -> int:
        return int.from_bytes(self.machine.peek(self.at(name) + offset, count), "little")

    def put(self, name: str, data: bytes, offset: int = 0) -> None:
        self.machine.poke(self.at(name) + offset, data)

    def ring(self, name: str, head: int, tail: int, data: bytes = b"") -> None:
        self.put(name, bytes([head, tail]))
        for index, value in enumerate(data):
            self.put(name, bytes([value]), 2 + (tail + index) % 64)

    # ---- calls

    def align(self) -> None:
        while self.machine.pc != self._idle:
            self.machine.run_until(self.machine.cycle + 1)

    def order(self, what: str, *arguments: int) -> None:
        self.machine.poke(self.at("argument"), bytes(arguments))
        self.machine.poke(self.at("order"), what.encode())

    def call(self, what: str, *arguments: int, cycles: int = 800) -> bytes:
        """Calls a function and lets it end; the bytes of its result."""
        self.order(what, *arguments)
        self.machine.run_until(self.machine.cycle + cycles)
        return self.result()

    def result(self, count: int = 20) -> bytes:
        return self.machine.peek(self.at("result"), count)

    def _enabled(self, vector: int) -> bool:
        changes = {PCINT0: 1, PCINT2: 4}
        return vector not in changes or bool(self.machine.peek(PCICR)[0] & changes[vector])

    def trace(self, vector: int, what: str, *arguments: int) -> Tuple[Set[int], int]:
        """Calls a function step by step: the instructions before which an interrupt may come, and its cycles."""
        self.align()
        start, before = self.machine.cycle, self.get("finished")
        self.order(what, *arguments)
        found: Set[int] = set()
        last = self.machine.pc
        while self.get("finished") == before:
            pc = self.machine.pc
            held = pc != last and self._holds_interrupts_off(last)
            if self.machine.interrupts_on and not held and self._enabled(vector):
                found.add(pc)
            last = pc
            self.machine.run_until(self.machine.cycle + 1)
        return found, self.machine.cycle - start

    def _holds_interrupts_off(self, address: int) -> bool:
        """Whether the instruction there turns interrupts on: one more passes before the first interrupt."""
        opcode = self._code[address] | self._code[address + 1] << 8
        return opcode == SEI or opcode & OUT_SREG_MASK == OUT_SREG

    def strike(self, at: int, lead: int, vector: int, what: str, *arguments: int) -> int:
        """Calls a function `lead` cycles before the event at the cycle `at`; the interrupted address, or -1."""
        self.machine.run_until(at - lead - 200)
        self.order("j", self.shift % 5)
        self.machine.run_until(at - lead)
        self.order(what, *arguments)
        self.machine.run_until(at)
        where = -1
        for _ in range(300):
            if self.machine.pc == 4 * vector:
                where = self._return_address()
                break
            self.machine.run_until(self.machine.cycle + 1)
        self.machine.run_until(max(self.machine.cycle, at) + 1000)
        return where

    def _return_address(self) -> int:
        pointer = int.from_bytes(self.machine.peek(0x5D, 2), "little")
        high, low = self.machine.peek(pointer + 1, 2)
        return 2 * (high << 8 | low)

    # ---- events

    def byte(self, value: int) -> int:
        """Sends a byte; the cycle at which the chip has it."""
        if not self._latency:
            start = self.machine.cycle
            self.machine.send(b"?", start)
            self._latency = self._enters(RECEIVED) - start
            self.machine.run_until(self.machine.cycle + 600)
            self.ring("received", 0, 0)
        start = self.machine.cycle + 50 + self.shift // 5
        self.machine.send(bytes([value]), start)
        return start + self._latency

    def _enters(self, vector: int) -> int:
        """Runs until an interrupt is entered; the cycle of its flag, at most an instruction too late."""
        while self.machine.pc != 4 * vector:
            self.machine.run_until(self.machine.cycle + 1)
        return self.machine.cycle - ENTRY

    def edge(self, *pins: int, level: int = 1, in_cycles: int = 700) -> int:
        at = self.machine.cycle + in_cycles + self.shift // 5
        for pin in pins:
            self.machine.set_pin(pin, level, at)
        return at

    def levels(self, *pins: int, level: int = 0) -> None:
        for pin in pins:
            self.machine.set_pin(pin, level)
        self.machine.run_until(self.machine.cycle + 500)

    def sample(self) -> int:
        """The cycle of the next sample of the encoders that is far enough ahead."""
        if not self._sample:
            self._sample = self._enters(COMPARE_B)
        ahead = self.machine.cycle + 1200 - self._sample
        return self._sample + (ahead // SAMPLE + 1) * SAMPLE

    def missed_kick(self) -> int:
        """Kicks the watchdog; the cycle of its interrupt, 128 ms later."""
        while not self._watchdog:
            start = self._kick()
            self.machine.run_until(start + 2_000_000)
            self._watchdog = self._enters(WDT) - start
        return self._kick() + self._watchdog

    def _kick(self) -> int:
        self.align()
        start = self.machine.cycle
        self.call("k")
        return start


# ---- cases

Observation = Tuple[Any, ...]


class Case(NamedTuple):
    """One function and one event.

    Attributes:
        order: the call, with its arguments.
        prepare: sets the shared data.
        arm: plans the event; its cycle.
        observe: what the call, and calls after it, have done; the event has been served.
    """

    name: str
    build: str
    vector: int
    order: Tuple[Any, ...]
    prepare: Callable[[Chip], None]
    arm: Callable[[Chip], int]
    observe: Callable[[Chip], Observation]


def word(data: bytes, at: int = 0) -> int:
    return int.from_bytes(data[at : at + 2], "little", signed=True)


def encoder_cases(side: int) -> Iterator[Case]:
    """A count that changes both its bytes, and the number of impossible transitions."""
    count = ENCODER_BYTES * side + COUNT_AT
    name, pins, vector, change = (("left", (2, 4), PCINT2, 4), ("right", (8, 10), PCINT0, 1))[side]

    def prepare(chip: Chip) -> None:
        chip.levels(*pins)
        chip.put("encoders", b"\xff\xff", count)
        chip.put("impossible", b"\xff\x00")

    def mask(chip: Chip) -> None:
        prepare(chip)
        chip.machine.poke(PCICR, bytes([chip.machine.peek(PCICR)[0] & ~change]))
        chip.put("impossible", b"\0\0")

    def read(chip: Chip) -> Observation:
        return (word(chip.result(), 2 * side),)

    def turn_on(chip: Chip) -> Observation:
        for pin, level in ((pins[1], 1), (pins[0], 0), (pins[1], 0)):
            chip.levels(pin, level=level)
        return chip.get("encoders", 2, count), chip.get("impossible", 2)

    def edge(chip: Chip) -> int:
        return chip.edge(pins[0])

    yield Case(f"encoder_read, {name} edge", "bridge", vector, ("e",), prepare, edge, read)
    yield Case(f"encoder_unmask, {name} edge", "bridge", vector, ("u", side), mask, edge, turn_on)
    yield Case(
        f"impossible_transitions, both {name} channels",
        "bridge",
        vector,
        ("i",),
        prepare,
        lambda chip: chip.edge(*pins),
        lambda chip: (word(chip.result()),),
    )


def sample_case(waiting: bool) -> Case:
    """A sample while the last one is being copied, or while there is none."""

    def prepare(chip: Chip) -> None:
        chip.machine.run_until(chip.sample() - 1500)
        chip.put("newest", b"\x11" * 10)
        for side in range(2):
            chip.put("encoders", b"\x22\x22\x22\x01", ENCODER_BYTES * side + COUNT_AT)
        chip.put("is_new", bytes([waiting]))

    def observe(chip: Chip) -> Observation:
        both = chip.result(), chip.call("S")
        # Only the low bytes of the edges' ticks do not depend on the time.
        return tuple((one[:4], one[4], one[6], one[8:10] == b"\x11\x11", one[10]) for one in both)

    name = f"encoder_sample, sample {'behind another' if waiting else 'behind none'}"
    return Case(name, "bridge", COMPARE_B, ("S",), prepare, Chip.sample, observe)


def news_case(waiting: int) -> Case:

    def prepare(chip: Chip) -> None:
        chip.machine.run_until(chip.sample() - 1500)
        chip.machine.poke(GPIOR0, bytes([waiting]))

    def observe(chip: Chip) -> Observation:
        return chip.result(1), chip.machine.peek(GPIOR0)[0] & 1

    name = f"take_news, sample {'behind other news' if waiting else 'behind none'}"
    return Case(name, "bridge", COMPARE_B, ("n",), prepare, Chip.sample, observe)


def receiver_case(
    name: str, what: str, waiting: int, overruns: int, observe: Callable[[Chip], Observation]
) -> Case:
    """A byte of the host, while `waiting` others have not been read."""

    def prepare(chip: Chip) -> None:
        chip.ring("received", 250 + waiting & 255, 250, bytes(range(waiting)))
        chip.put("overruns", bytes([overruns]))

    return Case(name, "", RECEIVED, (what,), prepare, lambda chip: chip.byte(99), observe)


def reads(chip: Chip) -> Observation:
    found = [word(chip.result())] + [word(chip.call("r")) for _ in range(2)]
    used = (chip.get("received") - chip.get("received", offset=1)) & 255
    return (*found, used, chip.get("overruns"))


def watchdog_cases() -> Iterator[Case]:
    """The watchdog's interrupt switches the outputs off; neither a duty nor another pin turns one on again."""

    def on(chip: Chip) -> None:
        chip.call("k")
        chip.call("b", 1, 0, 0, 255)

    def outputs(chip: Chip) -> Observation:
        before = [chip.machine.high_cycles(pin) for pin in OUTPUTS]
        chip.machine.run_until(chip.machine.cycle + 5000)
        return tuple(chip.machine.high_cycles(pin) > high for pin, high in zip(OUTPUTS, before))

    def kept(chip: Chip) -> Observation:
        chip.call("k")
        return chip.get("missed_kicks"), chip.machine.peek(WDTCSR)[0] & 0x40

    for duties in ((0, 128, 0, 0), (1, 255, 0, 0), (1, 0, 128, 0), (0, 0, 0, 255)):
        order = ("b", *duties)
        yield Case(
            f"bridge_write{order[1:]}, missed kick", "bridge", WDT, order, on, Chip.missed_kick, outputs
        )
    for pin in (12, 4):
        name = f"pin_output({pin}), missed kick"
        yield Case(name, "bridge", WDT, ("p", pin, 1), on, Chip.missed_kick, outputs)
    yield Case(KICK, "bridge", WDT, ("k",), on, Chip.missed_kick, kept)


def dust_cases() -> Iterator[Case]:

    def low(chip: Chip) -> None:
        machine = chip.machine
        chip.levels(DUST, level=1)
        machine.run_until(machine.cycle - machine.cycle % TICK + TICK + TICK // 2)
        chip.levels(DUST)
        machine.run_until(machine.cycle + 20 * TICK)
        chip.put("low_ticks", b"\xf0\xff\0\0")
        chip.put("dust_edge", b"\0")

    def rise(chip: Chip) -> int:
        """In the middle of a tick, so that the sum does not depend on the call."""
        return chip.edge(DUST, in_cycles=3 * TICK - (chip.machine.cycle - TICK // 2) % TICK)

    def ticks(chip: Chip) -> Observation:
        both = chip.result(), chip.call("l")
        return (sum(int.from_bytes(one[:4], "little") for one in both),)

    def changed(chip: Chip) -> Observation:
        return chip.result(1), chip.call("c")[:1]

    yield Case("dust_low_ticks, end of a pulse", "environment", CAPTURE, ("l",), low, rise, ticks)
    yield Case("dust_changed, end of a pulse", "environment", CAPTURE, ("c",), low, rise, changed)


def _cases() -> List[Case]:
    return [
        *encoder_cases(0),
        *encoder_cases(1),
        sample_case(True),
        sample_case(False),
        news_case(1),
        news_case(0),
        receiver_case("serial_read, a byte behind none", "r", 0, 0, reads),
        receiver_case("serial_read, a byte behind another", "r", 1, 0, reads),
        receiver_case("serial_read, a byte for the last place", "r", 63, 0, reads),
        receiver_case("serial_read, a byte without a place", "r", 64, 0, reads),
        receiver_case(
            "serial_overruns, another one", "o", 64, 5, lambda chip: (chip.result(1), chip.call("o")[:1])
        ),
        receiver_case("serial_discard, a byte behind others", "d", 7, 0, lambda chip: reads(chip)[1:]),
        *dust_cases(),
        *watchdog_cases(),
    ]


CASES = _cases()


def sweep(chip: Chip, case: Case) -> Figures:
    """Let the event strike before, in and after the function, cycle by cycle, until each instruction was interrupted.

    Raises:
        Torn: a result is neither that of the event before the call nor that of the event after it.
        Missed: an instruction was never interrupted.
    """

    draw = random.Random(1)

    def run(lead: int) -> Tuple[int, Observation]:
        chip.call("k")
        chip.shift = draw.randrange(SHIFTS)
        case.prepare(chip)
        where = chip.strike(case.arm(chip), lead, case.vector, *case.order)
        return where, case.observe(chip)

    chip.call("k")
    case.prepare(chip)
    boundaries, cycles = chip.trace(case.vector, *case.order)
    right = {"before": run(-700)[1], "after": run(cycles + 300)[1]}
    interrupted: Set[int] = set()
    seen: Set[Observation] = set()
    runs = 0
    for _ in range(PASSES):
        for lead in range(-MARGIN, cycles + MARGIN):
            where, got = run(lead)
            runs += 1
            interrupted.add(where)
            seen.add(got)
            if got not in right.values():
                raise Torn(f"{case.name}: interrupted at 0x{where:04x}: {got}, expected one of {right}")
        if boundaries <= interrupted:
            break
    if not boundaries <= interrupted and case.name != KICK:
        missed = ", ".join(f"0x{each:04x}" for each in sorted(boundaries - interrupted))
        raise Missed(f"{case.name}: never interrupted at {missed}; more runs are needed")
    return Figures(case.name, len(boundaries), len(boundaries & interrupted), runs, len(seen))


# ---- functions whose result depends on the time


def falling_asleep(name: str, vector: int, chip: Chip) -> Figures:
    """A byte, or news, that comes at any instruction of `sleep_until` wakes the loop at once."""
    draw = random.Random(1)
    interrupted: Set[int] = set()
    for lead in range(-MARGIN, ASLEEP):
        chip.call("k")
        chip.shift = draw.randrange(SHIFTS)
        chip.ring("received", 0, 0)
        if vector == COMPARE_B:
            chip.machine.run_until(chip.sample() - 3000)
            at = chip.sample()
        chip.machine.poke(GPIOR0, b"\0")
        tick = word(chip.call("t")) + SLEEP_TICKS & 0xFFFF
        if vector == RECEIVED:
            at = chip.byte(99)
        interrupted.add(chip.strike(at, lead, vector, "s", tick & 255, tick >> 8))
        if chip.get("busy"):  # the call should have ended within the 600 cycles behind its event
            raise Torn(f"{name} {lead} cycles after the call: still asleep")
    return Figures(name, len(interrupted), len(interrupted), MARGIN + ASLEEP, 1)


def alarm(chip: Chip) -> Figures:
    """At any moment of a tick: `sleep_until` ends, whether the time is near or has passed; an oversleep takes 4 s."""
    runs = 0
    for ahead in (-1, 0, 1, 2, 3):
        for phase in range(0, TICK, 3):
            chip.ring("received", 0, 0)
            chip.machine.poke(GPIOR0, b"\0")
            chip.call("k")
            tick = word(chip.call("t")) & 0xFFFF
            start = chip.machine.cycle
            chip.machine.run_until(start - start % TICK + 2 * TICK + phase)
            now = tick + (chip.machine.cycle // TICK - start // TICK)
            until = now + ahead & 0xFFFF
            chip.order("s", until & 255, until >> 8)
            chip.machine.run_until(chip.machine.cycle + (max(ahead, 0) + 2) * TICK)
            runs += 1
            if chip.get("busy"):
                raise Torn(f"sleep_until, {ahead} ticks ahead, cycle {phase} of the tick: still asleep")
    return Figures("sleep_until, its time", 0, 0, runs, 1)


def clock_at_its_carry(chip: Chip) -> Figures:
    """An edge's interrupt reads the counter as its high byte changes, amid `ticks`, which uses the same latch."""
    draw = random.Random(1)
    interrupted: Set[int] = set()
    runs = 0
    chip.levels(2, 4)
    level = 0
    for lead in range(0, 80):
        machine = chip.machine
        chip.call("k")
        chip.shift = draw.randrange(SHIFTS)
        machine.run_until(machine.cycle - machine.cycle % TICK + TICK + 10)
        tick = word(chip.call("t")) & 0xFFFF
        start = machine.cycle - machine.cycle % TICK
        left = 256 - tick % 256
        left += 256 if left < 3 else 0
        carry = start + left * TICK
        level ^= 1
        at = carry - CARRY_LEAD
        machine.set_pin(2, level, at)
        interrupted.add(chip.strike(at, lead, PCINT2, "t"))
        runs += 1
        got, right = word(chip.result()) & 0xFFFF, (tick + left) & 0xFFFF
        if (got - right) & 0xFFFF not in (0, 0xFFFF):
            raise Torn(f"ticks: {got:#06x}, expected {right:#06x} or the one before")
    return Figures("ticks, an edge at the carry", len(interrupted), len(interrupted), runs, 2)


def bytes_on_their_way(chip: Chip) -> Figures:
    """A byte is queued at each cycle of the byte before: the transmitter neither stops early nor sends one twice."""
    runs = 0
    for phase in range(3 * BYTE):
        machine = chip.machine
        machine.sent()
        chip.call("k")
        for letter in b"ABC":
            chip.call("w", letter, cycles=120)
        machine.run_until(machine.cycle + phase)
        chip.order("w", ord("D"))
        machine.run_until(machine.cycle + 5 * BYTE)
        runs += 1
        got = bytes(byte.data for byte in machine.sent())
        if got != b"ABCD" or machine.peek(UCSR0B)[0] & 0x20:
            raise Torn(f"serial_write {phase} cycles after others: {got!r}, expected b'ABCD'")
    return Figures("serial_write, end of a byte", 0, 0, runs, 1)


def radio_bytes(chip: Chip, toggles: bool) -> Figures:
    """A byte is queued for the radio, or another pin of its port is set, at each cycle of the last bits of a byte."""
    machine = chip.machine
    machine.watch_pins([RADIO_OUT])
    runs = 0
    for phase in range(3 * BIT_OF_RADIO):
        chip.call("k")
        machine.pin_changes()
        chip.call("W", 0x55, cycles=2 * BIT_OF_RADIO)
        machine.run_until(machine.cycle - machine.cycle % BIT_OF_RADIO + 7 * BIT_OF_RADIO + phase)
        if toggles:
            chip.order("p", 7, runs & 1)
        else:
            chip.order("W", 0xAA)
        machine.run_until(machine.cycle + 24 * BIT_OF_RADIO)
        runs += 1
        got, right = _radio_decoded(machine.pin_changes()), [0x55] if toggles else [0x55, 0xAA]
        if got != right:
            raise Torn(f"radio, {phase} cycles into a bit: {got}, expected {right}")
    name = "pin_output(7), bit of the radio" if toggles else "radio_write, bit of the radio"
    return Figures(name, 0, 0, runs, 1)


def _radio_decoded(changes: Sequence[Any]) -> List[int]:
    """The bytes on the radio's line, from the times of its edges."""
    found = []
    edges = [(change.cycle, change.level) for change in changes]
    at = 0
    while edges:
        start = next((cycle for cycle, level in edges if not level and cycle >= at), None)
        if start is None:
            break
        bits = [_level_at(edges, start + int((bit + 0.5) * BIT_OF_RADIO)) for bit in range(10)]
        found.append(sum(level << bit for bit, level in enumerate(bits[1:9])))
        at = start + int(9.5 * BIT_OF_RADIO)
    return found


def _level_at(edges: Sequence[Tuple[int, int]], cycle: int) -> int:
    return [1, *(level for at, level in edges if at <= cycle)][-1]


TIMED: Tuple[Tuple[str, str, Callable[[Chip], Figures]], ...] = (
    ("sleep_until, a byte", "", partial(falling_asleep, "sleep_until, a byte", RECEIVED)),
    ("sleep_until, news", "bridge", partial(falling_asleep, "sleep_until, news", COMPARE_B)),
    ("sleep_until, its time", "", alarm),
    ("ticks, an edge at the carry", "bridge", clock_at_its_carry),
    ("serial_write, end of a byte", "", bytes_on_their_way),
    ("radio_write, bit of the radio", "xbee", lambda chip: radio_bytes(chip, False)),
    ("pin_output(7), bit of the radio", "xbee", lambda chip: radio_bytes(chip, True)),
)

CONTROLS: Tuple[Tuple[str, str, str, str], ...] = (
    *(
        (file, f"{before}  cli();\n{after}", before + after, check)
        for file, before, after, check in (
            ("hal_avr.cpp", "", "  const uint16_t now = clock_now();", "ticks, an edge at the carry"),
            ("hal_avr.cpp", "status = SREG;\n", "  registers[2]", "pin_output(12), missed kick"),
            ("hal_avr.cpp", "status = SREG;\n", "  registers[2]", "pin_output(7), bit of the radio"),
            ("hal_avr.cpp", "return 0;\n", "", "serial_overruns, another one"),
            (
                "hal_bridge_avr.cpp",
                "uint16_t encoder_read(uint16_t (&counts)[MOTORS]) {\n",
                "",
                "encoder_read, left edge",
            ),
            (
                "hal_bridge_avr.cpp",
                "",
                "  const uint16_t count = impossible;",
                "impossible_transitions, both left channels",
            ),
            (
                "hal_bridge_avr.cpp",
                "",
                "    if (!missed_kicks) write(*output",
                "bridge_write(0, 128, 0, 0), missed kick",
            ),
            ("hal_dust_avr.cpp", "uint32_t dust_low_ticks() {\n", "", "dust_low_ticks, end of a pulse"),
        )
    ),
    (
        "hal_avr.cpp",
        "  sending.put(byte);\n  cli();\n  UCSR0B |= _BV(UDRIE0);\n  sei();",
        "  UCSR0B |= _BV(UDRIE0);\n  sending.put(byte);",
        "serial_write, end of a byte",
    ),
    ("hal_avr.cpp", '"sei\\n\\tsleep', '"sei\\n\\tnop\\n\\tsleep', "sleep_until, a byte"),
    ("hal_avr.cpp", '"sei\\n\\tsleep', '"sei\\n\\tnop\\n\\tsleep', "sleep_until, news"),
    ("hal_avr.cpp", "(tick - clock_now()) > 1", "(tick - clock_now()) >= 0", "sleep_until, its time"),
    (
        "hal_avr.cpp",
        "  if (!has_news()) return false;\n  GPIOR0 &= static_cast<uint8_t>(~_BV(0));\n  return true;",
        "  const bool news = has_news();\n  GPIOR0 &= static_cast<uint8_t>(~_BV(0));\n  return news;",
        "take_news, sample behind none",
    ),
    ("hal_bridge_avr.cpp", "} while (is_new);", "} while (false);", "encoder_sample, sample behind another"),
    (
        "hal_bridge_avr.cpp",
        "  for (uint8_t i = 0; i < ENABLES; i++) enables(i) = enables(i) | ",
        "  PCIFR = lines.bits[0];\n  for (uint8_t i = 0; i < ENABLES; i++) enables(i) = enables(i) | ",
        "encoder_unmask, left edge",
    ),
    (
        "hal_radio_avr.cpp",
        "  speaking.put(byte);\n  cli();\n  if (!out_bits) {\n    out_frame = 1;\n    out_bits = 1;\n  }\n  sei();",
        "  if (!out_bits) {\n    out_frame = 1;\n    out_bits = 1;\n  }\n  speaking.put(byte);",
        "radio_write, bit of the radio",
    ),
    (
        "hal_dust_avr.cpp",
        "  if (!dust_edge) return false;\n  dust_edge = false;\n  return true;",
        "  const bool changed = dust_edge;\n  dust_edge = false;\n  return changed;",
        "dust_changed, end of a pulse",
    ),
)
"""Defects: a file, what stands there, what takes its place, and the check that finds it."""


class Check(NamedTuple):
    """A check by its name, the build that it needs, and what runs it on a chip."""

    name: str
    build: str
    run: Callable[[Chip], Figures]


def _check(case: Case) -> Check:
    return Check(case.name, case.build, lambda chip: sweep(chip, case))


QUICK = ("serial_overruns", "encoder_read, left", "take_news", "sleep_until, a byte", "dust")
QUICK_DEFECT = "encoder_read, left edge"
"""With FAST=1: how the names of checks begin, and the check of a defect."""
CHECKS = {check.name: check for check in (*map(_check, CASES), *(Check(*each) for each in TIMED))}


def find(control: Tuple[str, str, str, str], number: int = 0) -> str:
    """What the check of a control says about its defect; empty if it does not notice."""
    check = CHECKS[control[3]]
    chip = Chip(build(check.build, control[:3], f"interrupts_control{number}"))
    try:
        check.run(chip)
    except Torn as torn:
        return str(torn)
    finally:
        chip.machine.close()
    return ""


def main() -> int:
    """Run all checks and controls; the exit code is 0 if no function is torn and each defect is found."""
    checks = [each for each in CHECKS.values() if not report.FAST or each.name.startswith(QUICK)]
    controls = [each for each in CONTROLS if not report.FAST or each[3] == QUICK_DEFECT]
    chips = {kind: Chip(build(kind)) for kind in {check.build for check in checks}}
    rows: List[Dict[str, object]] = []
    good = True
    for check in checks:
        start = time.monotonic()
        try:
            figures = check.run(chips[check.build])
            outcome = f"{figures.interrupted} instructions, {figures.runs} runs"
            rows.append({**figures._asdict(), "seconds": round(time.monotonic() - start, 2)})
        except (Torn, Missed) as wrong:
            outcome, good = f"WRONG: {wrong}", False
            rows.append({"name": check.name, "wrong": str(wrong)})
        print(f"{check.name:50} {outcome}", flush=True)
    for number, control in enumerate(controls):
        said = find(control, number)
        good = good and bool(said)
        print(f"defect in {control[0]}, {control[3]}: {'found' if said else 'NOT FOUND'}", flush=True)
        rows.append({"defect": control[:3], "check": control[3], "found": said})
    (BUILD / "interrupts.json").write_text(json.dumps(rows, indent=1) + "\n")
    figures = {
        "interrupts_checks": len(checks),
        "interrupts_wrong": sum("wrong" in row for row in rows),
        "interrupts_defects": len(controls),
        "interrupts_defects_found": sum(bool(row.get("found")) for row in rows),
    }
    report.conclude("verify", figures)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
