"""The wiring of an H-bridge board: which pins have which function, and whether the chip can do that.

The board makes the same check (`wiring.cpp`); a test compares both.
"""

from typing import Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

from mrl_driver.protocol.table import NOT_CONNECTED, PARAMETER_BY_NAME, PARAMETERS, PINS, WIRING_PROBLEMS

from .chips import NONE, Chip, Pin


class Wires(NamedTuple):
    """The inputs of a bridge at PWM_A, PWM_B and LOGIC: their names, empty if it has none there."""

    inputs: Tuple[str, str, str]
    needed: Tuple[int, ...]
    """Those that it needs; the others may stay open or be tied to their level."""
    pwm: Tuple[int, ...]
    """Those with PWM."""
    tied: int = NONE
    """One that is high if it is not connected: its jumper, or a wire to 5 V."""


A, B, LOGIC = range(3)
BRIDGE_WIRES: Dict[str, Wires] = {
    "vnh5019": Wires(("PWM", "INA", "INB"), (A, B, LOGIC), (A,)),
    "cytron": Wires(("PWM", "brake", "DIR"), (A, LOGIC), (A,)),
    "l298n": Wires(("EN", "IN1", "IN2"), (B, LOGIC), (B,), tied=A),
    "tb6612": Wires(("PWM", "IN1", "IN2"), (A, B, LOGIC), (A,)),
    "drv8833": Wires(("IN1", "IN2", "enable"), (A, B), (A, B), tied=LOGIC),
    "bts7960": Wires(("RPWM", "LPWM", "enable"), (A, B), (A, B), tied=LOGIC),
    "l298n_enable": Wires(("EN", "IN1", "IN2"), (A, B, LOGIC), (A,)),
}
SIDES = ("left", "right")
OUTPUTS = [[f"pin_{side}_{wire}" for wire in ("pwm_a", "pwm_b", "logic")] for side in SIDES]
ENCODERS = [[f"pin_{side}_encoder_{channel}" for channel in "ab"] for side in SIDES]
_ANALOG = ("pin_sonar_front", "pin_sonar_left", "pin_sonar_right", "pin_battery")
I2C = "i2c"
NAMES = tuple(row.name for row in PINS)
EMPTY: Dict[str, int] = {row.name: max(NOT_CONNECTED, row.low) for row in PINS}
"""The wiring of a board on which nothing is connected."""

Pins = Mapping[str, int]
"""A wiring: the parameters `NAMES`."""


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


def of_board(board: Pins) -> Dict[str, int]:
    """Return the wiring among the parameters of a board, of which some or all may be missing."""
    return {name: board.get(name, value) for name, value in EMPTY.items()}


def section(pins: Pins, chip: Chip) -> Dict[str, Any]:
    """Return the section `wiring` of a robot's file, with what is connected."""
    used = ((name, value) for name, value in pins.items() if name == I2C or value != NOT_CONNECTED)
    return {short(name): bool(value) if name == I2C else chip.label(value) for name, value in used}


def output_pins(pins: Pins) -> List[Tuple[int, ...]]:
    """Return the pins PWM_A, PWM_B and LOGIC of each motor."""
    return [tuple(pins[name] for name in names) for names in OUTPUTS]


def encoder_pins(pins: Pins) -> List[Tuple[int, ...]]:
    """Return the pins A and B of each encoder."""
    return [tuple(pins[name] for name in names) for names in ENCODERS]


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


def servo_conflict(servo: int, pins: Pins, bridge: str, chip: Chip) -> str:
    """Return in words why a servo cannot be on a pin next to this wiring; empty if it can.

    Its pulses need an output of a 16-bit timer, and the timer for themselves.
    """
    facts = _Facts(pins, bridge, BRIDGE_WIRES.get(bridge, _NO_WIRES), chip)
    name = next((name for name, pin in facts.connected() if pin == servo), "")
    bus = chip.bus if pins[I2C] else ()
    if name or servo in (*chip.serial, *bus):
        return f"{short(name) or 'the serial link or the I2C bus'} has this pin"
    able = [number for number, pin in enumerate(chip.pins) if pin.timer not in (NONE, *_SHORT_TIMERS)]
    if servo not in able:
        return f"servo pulses need an output of a 16-bit timer: {', '.join(map(chip.label, able))}"
    users = (
        name for name, pin in facts.outputs(facts.wires.pwm) if facts.of(pin).timer == facts.of(servo).timer
    )
    return next((f"{short(name)} has the timer of this pin" for name in users), "")


def in_words(problem: Problem, pins: Pins, chip: Chip) -> str:
    """Return a problem in one line, with pin and reason; empty if there is none."""
    if problem == SOUND:
        return ""
    pin = pins[problem.parameter]
    place = "is not connected" if pin == NOT_CONNECTED else f"is on {chip.label(pin)}"
    also = f", as {short(problem.other)}" if problem.other else ""
    text = dict(WIRING_PROBLEMS)[problem.name]
    return f"{short(problem.parameter)} {place}{also}: {text[0].lower()}{text[1:-1]}"


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
        return [(name, self.pins[name]) for name in NAMES if name != I2C and self.pins[name] != NOT_CONNECTED]

    def outputs(self, which: Sequence[int]) -> List[Tuple[str, int]]:
        """These wires of both motors, and their pins."""
        return [(names[wire], self.pins[names[wire]]) for names in OUTPUTS for wire in which]

    def of(self, pin: int) -> Pin:
        """What a pin can do."""
        return self.chip.pins[pin]


Found = Iterator[Tuple[str, ...]]
_NO_WIRES = Wires(("", "", ""), (), ())


def _not_connected(facts: _Facts) -> Found:
    needed = facts.outputs(facts.wires.needed) + [(names[0], facts.pins[names[0]]) for names in ENCODERS]
    return ((name,) for name, pin in needed if pin == NOT_CONNECTED)


def _used_twice(facts: _Facts) -> Found:
    first: Dict[int, str] = {}
    for name, pin in facts.connected():
        if first.setdefault(pin, name) != name:
            yield name, first[pin]


def _led_pin(facts: _Facts) -> Found:
    """Other functions may move with the LED: while all other inputs are low, the bridge does not drive."""
    for names in OUTPUTS:
        open_enable = facts.wires.tied == A and facts.pins[names[A]] == NOT_CONNECTED
        drives = (*facts.wires.pwm, *([LOGIC] if open_enable else []))
        yield from ((names[wire],) for wire in drives if facts.pins[names[wire]] == facts.chip.led)


def _no_interrupt(facts: _Facts) -> Found:
    for names in ENCODERS:
        for name, needs in zip(names, (True, False)):
            pin = facts.pins[name]
            connected = pin != NOT_CONNECTED
            if connected and (pin == facts.chip.no_encoder or (needs and not facts.of(pin).interrupts)):
                yield (name,)


def _no_clock(facts: _Facts) -> Found:
    """A timer that makes PWM can be the clock as well, but not in the mode of a DRV8833."""
    timers = {pin.timer for pin in facts.chip.pins} - {NONE}
    wires = facts.outputs(facts.wires.pwm)
    made = {name: facts.of(pin).timer for name, pin in wires if pin != NOT_CONNECTED}
    if facts.bridge == "drv8833" and set(made.values()) == timers:
        yield from ((name,) for name, timer in made.items() if timer == _CLOCK_TIMER)


_CLOCK_TIMER = 1
_SHORT_TIMERS = (0, 2)  # they have 8 bits
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
    "no_analog": lambda facts: (
        (name,) for name, pin in facts.connected() if name in _ANALOG and facts.of(pin).channel == NONE
    ),
    "bus_pin": lambda facts: (
        (name,) for name, pin in facts.connected() if facts.pins[I2C] and pin in facts.chip.bus
    ),
    "no_clock": _no_clock,
}
"""Each rule gives the parameters with its problem, and the other parameter, in order of their numbers."""
