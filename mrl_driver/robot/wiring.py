"""The wiring of an H-bridge board: which pins have which function, and whether the chip can do that.

The board makes the same check (`wiring.cpp`); a test compares both.
"""

from typing import Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Sequence, Set, Tuple

from mrl_driver.protocol.table import (
    INPUTS,
    NOT_CONNECTED,
    PARAMETER_BY_NAME,
    PARAMETERS,
    PINS,
    PINS_328P,
    RANGES,
    WHEELS,
    WIRING_PROBLEMS,
    Parameter,
)

from .chips import ATMEGA328P, NONE, Chip, Pin


class Wires(NamedTuple):
    """The inputs of a bridge at PWM_A, PWM_B and LOGIC: their names, empty if it has none there."""

    inputs: Tuple[str, str, str]
    needed: Tuple[int, ...]
    """Those that it needs; the others may stay open or be tied to their level."""
    pwm: Tuple[int, ...]
    """Those with PWM."""
    tied: int = NONE
    """One that is high if it is not connected: its jumper, or a wire to 5 V."""
    fast: bool = False
    """Its PWM has a mode in which a timer can be the clock as well."""
    coasts: bool = False
    """The motor coasts between the pulses: its speed is not in proportion to the duty."""


A, B, LOGIC = range(3)
BRIDGE_WIRES: Dict[str, Wires] = {
    "vnh5019": Wires(("PWM", "INA", "INB"), (A, B, LOGIC), (A,), fast=True, coasts=True),
    "cytron": Wires(("PWM", "brake", "DIR"), (A, LOGIC), (A,), fast=True),
    "l298n": Wires(("EN", "IN1", "IN2"), (B, LOGIC), (B,), tied=A),
    "tb6612": Wires(("PWM", "IN1", "IN2"), (A, B, LOGIC), (A,)),
    "drv8833": Wires(("IN1", "IN2", "enable"), (A, B), (A, B), tied=LOGIC),
    "bts7960": Wires(("RPWM", "LPWM", "enable"), (A, B), (A, B), tied=LOGIC, fast=True),
    "l298n_enable": Wires(("EN", "IN1", "IN2"), (A, B, LOGIC), (A,), coasts=True),
    "l298p": Wires(("PWM", "", "DIR"), (A, LOGIC), (A,), coasts=True),
    "l298p_brake": Wires(("PWM", "brake", "DIR"), (A, B, LOGIC), (A,), coasts=True),
}
OUTPUTS = [[f"pin_{wheel}_{wire}" for wire in ("pwm_a", "pwm_b", "logic")] for wheel in WHEELS]
ENCODERS = [[f"pin_{wheel}_encoder_{channel}" for channel in "ab"] for wheel in WHEELS]
ENABLES = ("pin_enable_1", "pin_enable_2")
FRONT = 2
"""Motors and encoders that each robot has; those behind them are connected on robots with four wheels."""
BATTERY = "pin_battery"
_ANALOG = ("pin_sonar_front", "pin_sonar_left", "pin_sonar_right", BATTERY)
SERVOS = tuple(f"pin_servo_{number}" for number in range(1, 7))
I2C, RELEASE, NO_ENCODERS = "i2c", "servo_release", "no_encoders"
FLAGS = tuple(row.name for row in PINS if row.high == 1)
NUMBERS: Dict[str, int] = {"air_temperature": 20}
"""Numbers that belong to a wiring, and their values where a robot's file does not have them."""
NAMES = tuple(row.name for row in PINS)
STOP_INPUTS = tuple(f"pin_{name}" for name in INPUTS)
PIN_NAMES = tuple(name for name in NAMES if name.startswith("pin_"))
RANGE_PINS = tuple((f"pin_range_{i}_trigger", f"pin_range_{i}_echo") for i in range(1, RANGES + 1))
"""Trigger and echo of each range sensor; an analog one has no trigger, and its voltage at the echo."""
EMPTY: Dict[str, int] = {row.name: max(NOT_CONNECTED, row.low) for row in PINS}
"""The wiring of a board on which nothing is connected."""

Pins = Mapping[str, int]
"""A wiring: the parameters `NAMES`, or those that its chip has."""


class Problem(NamedTuple):
    """What is wrong: a row of `WIRING_PROBLEMS`, and the parameters that it is about, empty if there are none."""

    name: str
    parameter: str = ""
    other: str = ""

    @property
    def reply(self) -> Tuple[int, int, int]:
        """The same as in the reply to `read_wiring`."""
        names = [name for name, _ in WIRING_PROBLEMS]
        return names.index(self.name), _number(self.parameter), _number(self.other)


SOUND = Problem("none")


def _number(name: str) -> int:
    return PARAMETER_BY_NAME[name].number if name else -1


def from_reply(problem: int, parameter: int, other: int) -> Problem:
    """Return the problem in a reply to `read_wiring`."""
    names = (PARAMETERS[number].name if number >= 0 else "" for number in (parameter, other))
    return Problem(WIRING_PROBLEMS[problem][0], *names)


def rows(chip: Chip) -> Tuple[Parameter, ...]:
    """Return the rows of a wiring that a chip has."""
    return PINS[:PINS_328P] if chip is ATMEGA328P else PINS


def of_board(board: Pins) -> Dict[str, int]:
    """Return the wiring among the parameters of a board, of which some or all may be missing."""
    return {name: board.get(name, value) for name, value in {**EMPTY, **NUMBERS}.items()}


def section(pins: Pins, chip: Chip) -> Dict[str, Any]:
    """Return the section `wiring` of a robot's file, with what is connected."""
    pins = of_board(pins)
    used = {short(name): chip.label(pins[name]) for name in PIN_NAMES if pins[name] != NOT_CONNECTED}
    flags = {name: bool(pins[name]) for name in FLAGS if pins[name] or name == I2C}
    return {**used, **flags, **{name: pins[name] for name in NUMBERS if pins[name] != NUMBERS[name]}}


def range_inputs(chip: Chip) -> Tuple[str, ...]:
    """Return the inputs of range sensors that a chip has, such as `range_1`."""
    there = [row.name for row in rows(chip)]
    return tuple(f"range_{i}" for i, (_, echo) in enumerate(RANGE_PINS, 1) if echo in there)


def motors(pins: Pins) -> int:
    """Return the number of motors, two or four: any pin of the rear ones means four."""
    rear = (name for names in OUTPUTS[FRONT:] + ENCODERS[FRONT:] for name in names)
    return len(WHEELS) if any(pins.get(name, NOT_CONNECTED) != NOT_CONNECTED for name in rear) else FRONT


def reads_high(pins: Pins) -> Set[str]:
    """Return the rows of `INPUTS` whose pins are high while they are active; pull-ups hold a broken wire high."""
    kinds = {"bumper": pins["bumpers_high"], "cliff": not pins["cliffs_low"]}
    return {name for name in INPUTS if kinds.get(name.partition("_")[0], True)}


def output_pins(pins: Pins) -> List[Tuple[int, ...]]:
    """Return the pins PWM_A, PWM_B and LOGIC of each motor, and the enable that the board writes with them."""
    enables = [*(pins[name] for name in ENABLES), NOT_CONNECTED, NOT_CONNECTED]
    outputs = OUTPUTS[: motors(pins)]
    return [(*(pins[name] for name in names), enable) for names, enable in zip(outputs, enables)]


def encoder_pins(pins: Pins) -> List[Tuple[int, ...]]:
    """Return the pins A and B of each encoder."""
    return [tuple(pins[name] for name in names) for names in ENCODERS[: motors(pins)]]


def check(pins: Pins, bridge: str, chip: Chip, complete: bool = True) -> Problem:
    """Return the first problem of a wiring with this bridge, a row of `BRIDGES`.

    If it is not `complete`, pins that are missing are not a problem.
    """
    facts = _Facts(pins, bridge, BRIDGE_WIRES.get(bridge, _NO_WIRES), chip)
    for name, _ in WIRING_PROBLEMS[1 if complete else 2 :]:
        found = next(_RULES[name](facts), None)
        if found:
            return Problem(name, *found)
    return SOUND


def in_words(problem: Problem, pins: Pins, chip: Chip) -> str:
    """Return a problem in one line, with pin and reason; empty if there is none."""
    if problem == SOUND:
        return ""
    pin = pins[problem.parameter]
    place = "is not connected" if pin == NOT_CONNECTED else f"is on {chip.label(pin)}"
    also = f", as {short(problem.other)}" if problem.other else ""
    text = dict(WIRING_PROBLEMS)[problem.name]
    able = f" ({', '.join(map(chip.label, servo_pins(chip)))})" if problem.name == "no_servo" else ""
    return f"{short(problem.parameter)} {place}{also}: {text[0].lower()}{text[1:-1]}{able}"


def servo_pins(chip: Chip) -> List[int]:
    """Return the outputs of the 16-bit timers."""
    return [number for number, pin in enumerate(chip.pins) if pin.timer not in _NO_SERVO]


def short(name: str) -> str:
    """Return the name of a parameter as in a robot's file."""
    return name[len("pin_") :] if name.startswith("pin_") else name


class _Facts(NamedTuple):
    """What the rules look at."""

    pins: Pins
    bridge: str
    wires: Wires
    chip: Chip

    def connected(self) -> List[Tuple[str, int]]:
        """The functions that have a pin, in order of their numbers."""
        found = ((name, self.pins.get(name, NOT_CONNECTED)) for name in PIN_NAMES)
        return [(name, pin) for name, pin in found if pin != NOT_CONNECTED]

    def outputs(self, which: Sequence[int]) -> List[Tuple[str, int]]:
        """These wires of all motors, and their pins."""
        there = OUTPUTS[: motors(self.pins)]
        return [(names[wire], self.pins[names[wire]]) for names in there for wire in which]

    def timers(self, pwm: bool) -> Dict[str, int]:
        """The timers of the motors' PWM, or those of the servos, by function; `NONE` if the pin has none."""
        used = [name for name, _ in self.outputs(self.wires.pwm)] if pwm else SERVOS
        return {name: self.of(pin).timer for name, pin in self.connected() if name in used}

    def echoes(self, timed: bool) -> List[str]:
        """The echoes of the sensors with a trigger, or of those without."""
        return [
            echo
            for trigger, echo in RANGE_PINS
            if (self.pins.get(trigger, NOT_CONNECTED) != NOT_CONNECTED) == timed
        ]

    def of(self, pin: int) -> Pin:
        """What a pin can do."""
        return self.chip.pins[pin]


Found = Iterator[Tuple[str, ...]]
_NO_WIRES = Wires(("", "", ""), (), ())


def _not_connected(facts: _Facts) -> Found:
    there = ENCODERS[: motors(facts.pins)]
    encoders = [] if facts.pins[NO_ENCODERS] else [names[0] for names in there]
    needed = [name for name, _ in facts.outputs(facts.wires.needed)] + encoders
    needed += facts.echoes(timed=True)
    return ((name,) for name in sorted(needed, key=_number) if facts.pins[name] == NOT_CONNECTED)


def _used_twice(facts: _Facts) -> Found:
    first: Dict[int, str] = {}
    for name, pin in facts.connected():
        if first.setdefault(pin, name) != name:
            yield name, first[pin]


def _led_pin(facts: _Facts) -> Found:
    """Other functions may move with the LED: while all other inputs are low, the bridge does not drive.

    A switch to ground, an encoder or an echo is a short circuit of a pin that the bootloader drives.
    """
    for names in OUTPUTS:
        open_enable = facts.wires.tied == A and facts.pins[names[A]] == NOT_CONNECTED
        drives = (*facts.wires.pwm, *([LOGIC] if open_enable else []))
        yield from ((names[wire],) for wire in drives if facts.pins[names[wire]] == facts.chip.led)
    driven = {*STOP_INPUTS, *facts.echoes(timed=True), *(name for names in ENCODERS for name in names)}
    yield from ((name,) for name, pin in facts.connected() if name in driven and pin == facts.chip.led)


def _no_interrupt(facts: _Facts) -> Found:
    timed = {*facts.echoes(timed=True), *(channel_a for channel_a, _ in ENCODERS)}
    return ((name,) for name, pin in facts.connected() if name in timed and not facts.of(pin).interrupts)


def _no_analog(facts: _Facts) -> Found:
    analog = (*_ANALOG, *facts.echoes(timed=False))
    return ((name,) for name, pin in facts.connected() if name in analog and facts.of(pin).channel == NONE)


def _no_servo(facts: _Facts) -> Found:
    """Its pulses need a timer for themselves."""
    others = {*_NO_SERVO, *facts.timers(pwm=True).values()}
    return ((name,) for name, timer in facts.timers(pwm=False).items() if timer in others)


def _no_clock(facts: _Facts) -> Found:
    """A timer that makes fast PWM can be the clock as well."""
    timers = {pin.timer for pin in facts.chip.pins} - {NONE}
    made = {**facts.timers(pwm=True), **facts.timers(pwm=False)}
    if not facts.wires.fast and set(made.values()) == timers:
        yield from ((name,) for name, timer in made.items() if timer == _CLOCK_TIMER)


_CLOCK_TIMER = 1
_NO_SERVO = (NONE, 0, 2)  # these timers have 8 bits
_RULES: Dict[str, Callable[[_Facts], Found]] = {
    "not_connected": _not_connected,
    "no_such_pin": lambda facts: ((name,) for name, pin in facts.connected() if pin >= len(facts.chip.pins)),
    "serial_pin": lambda facts: ((name,) for name, pin in facts.connected() if pin in facts.chip.serial),
    "pin_used_twice": _used_twice,
    "no_pwm": lambda facts: (
        (name,)
        for name, pin in facts.outputs(facts.wires.pwm)
        if pin != NOT_CONNECTED and facts.of(pin).timer == NONE
    ),
    "led_pin": _led_pin,
    "no_interrupt": _no_interrupt,
    "no_analog": _no_analog,
    "bus_pin": lambda facts: (
        (name,) for name, pin in facts.connected() if facts.pins[I2C] and pin in facts.chip.bus
    ),
    "no_servo": _no_servo,
    "no_clock": _no_clock,
}
"""Each rule gives the parameters with its problem, and the other parameter, in order of their numbers."""
