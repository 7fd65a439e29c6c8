"""The wiring of a new robot: from the catalogue, from options, or asked pin by pin; checked before it is written."""

import itertools
from typing import Any, Callable, Dict, Mapping, NamedTuple, Optional, Sequence, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import NOT_CONNECTED, WHEELS
from mrl_driver.robot import wiring, wirings
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip, Pin
from mrl_driver.robot.inputs import SAFETY
from mrl_driver.robot.models import ANALOG
from mrl_driver.robot.models.kit import SONAR_PLACES, Kit

from .shared import agrees, choose, print_message

CHIPS = {
    "vnh5019": "Pololu's VNH5019 shield or carrier, VNH2SP30: inputs INA, INB, PWM",
    "cytron": "Cytron's MD10C, MD13S, MDD10A: inputs PWM, DIR",
    "l298n": "modules with an L298N and PWM on IN1: inputs EN, IN1, IN2; remove the jumpers of EN",
    "l298n_enable": "the same with PWM on EN",
    "l298p": "shields with an L298P: inputs PWM, DIR; motors coast between the pulses and at rest",
    "l298p_brake": "the same with a brake, as the Arduino Motor Shield R3: inputs PWM, brake, DIR",
    "tb6612": "carriers of the TB6612FNG: inputs PWM, IN1, IN2; connect STBY to 5 V, or to a pin",
    "drv8833": "carriers of the DRV8833: two inputs a motor",
    "bts7960": "modules with two BTS7960 (IBT-2), Cytron's MDD3A: inputs RPWM, LPWM",
}
"""What each bridge is sold as."""
BOARDS = {"uno": ATMEGA328P, "mega": ATMEGA2560}
"""Arduinos that a robot may have, and their chips; a Nano is wired as an Uno."""
OWN = "own"
_PICTURE = """
    Arduino     bridge {bridge}
      pin ----- {0:<7}---+--------+
      pin ----- {1:<7}---|        |---- motor        pin ----- A ---+---------+
      pin ----- {2:<7}---+--------+                  pin ----- B ---| encoder |   B is optional
                                                                +---------+
    Pins are {pins}.  D0 and D1 are the USB link.  PWM: {pwm}.
    Channel A of an encoder: {encoder}.  Enter or -: not connected.
"""


_SONAR_PICTURE = """
    HC-SR04                     GP2Y0A21 (10 to 80 cm), GP2Y0A02 (20 to 150 cm)
      VCC ---- 5V                 3 VCC ---- 5V
      TRIG --- pin                2 GND ---- GND
      ECHO --- pin                1 VO ----- analog pin, and 100 kOhm to GND
      GND ---- GND
    ECHO: {echo}.  VO: {analog}.  Enter: none.
"""
SONAR_WIRES: Dict[str, Dict[str, str]] = {
    "HC-SR04": {"trigger": "TRIG", "echo": "ECHO"},
    **dict.fromkeys(ANALOG, {"echo": "VO"}),
}
"""Pins of a range sensor in the wiring, and their names on it, by type."""


def add_options(command: Any) -> Any:
    """Add the options of the wiring to a command."""
    for option in (
        click.option(
            "--i2c", is_flag=True, help="Devices are on the I2C bus: A4 and A5, on a Mega D20 and D21."
        ),
        click.option("--servo", type=str, multiple=True, metavar="PIN", help="Pin of a servo."),
        click.option(
            "--sonar",
            multiple=True,
            metavar="PLACE=TYPE:PINS",
            help="A range sensor, such as front=hc-sr04:A0,A1 (trigger, echo) or left=gp2y0a21:A2.",
        ),
        click.option(
            "--pin",
            multiple=True,
            metavar="NAME=PIN",
            help="A pin, such as left_pwm_a=5 or battery=A3, next to those of --wiring, or instead of it.",
        ),
        click.option(
            "--wiring",
            type=click.Choice([*wirings.names(), OWN]),
            help="Wiring of the catalogue, or own to be asked for each pin.",
        ),
        click.option(
            "--board", type=click.Choice(list(BOARDS)), help="Arduino; default: that of --wiring, or uno."
        ),
        click.option(
            "--bridge", type=click.Choice(list(CHIPS), case_sensitive=False), help="Kind of the H-bridge."
        ),
    ):
        command = option(command)
    return command


class Wired(NamedTuple):
    """A wiring that its board can have."""

    bridge: str
    pins: Dict[str, int]
    chip: Chip
    sonars: Dict[str, Tuple[str, str]]
    """As of a `Kit`."""

    def add_sonar(self, place: str, kind: str) -> Dict[str, str]:
        """Give a range sensor the next input; return the names of its pins, and what they are called on it."""
        if not self.free_ranges:
            most = len(wiring.range_inputs(self.chip))
            raise ConfigError(
                f"{place} {kind} is one range sensor too many: the {self.chip.board} has inputs for {most}"
            )
        self.sonars[place] = given, _ = self.free_ranges[0], kind
        return {f"pin_{given}_{wire}": text for wire, text in SONAR_WIRES[kind].items()}

    @property
    def free_ranges(self) -> Sequence[str]:
        """Inputs without a range sensor."""
        inputs = wiring.range_inputs(self.chip)
        return [each for each in inputs if self.pins[f"pin_{each}_echo"] == NOT_CONNECTED]


def wiring_of(options: Mapping[str, Any], wheels: int) -> Wired:
    """Return the wiring of two or four `wheels`; raise ConfigError, with pin and reason, if the board cannot do it."""
    name = options["wiring"] or ("" if options["pin"] else _chosen(wheels, options["board"]))
    entry = wirings.load(name) if name not in ("", OWN) else None
    board = options["board"] or ("mega" if wheels > wiring.FRONT else None)
    chip = _chip(board, entry, ask=name == OWN)
    bridge = options["bridge"] or (entry.bridge if entry else "")
    bridge = (bridge or choose("Which H-bridge drives the motors?", CHIPS, "--bridge")).lower()
    given = dict(_given(text, chip) for text in options["pin"])
    pins = wiring.of_board({**(entry.pins if entry else {}), **given})
    pins[wiring.I2C] |= int(options["i2c"])
    if options["no_encoders"]:
        pins.update({name: NOT_CONNECTED for names in wiring.ENCODERS for name in names}, no_encoders=1)
    pins.update(_servos(options["servo"], chip))
    wired = Wired(bridge, pins, chip, {})
    _take_sonars(wired, options["sonar"])
    conflict = _conflict(wired, complete=name != OWN)
    if name == OWN and not conflict:
        _ask(wired, wheels)
        conflict = _conflict(wired)
    if not conflict and wiring.motors(pins) != wheels:
        conflict = f"the wiring has {wiring.motors(pins)} motors, expected {wheels}: choose another --kind or --wiring"
    if conflict:
        raise ConfigError(f"{conflict}; nothing was written")
    return wired


def _chip(board: Optional[str], entry: Optional[wirings.Entry], ask: bool) -> Chip:
    """Return the chip of the board that was given, of the wiring, or of the user's answer."""
    if board is None and ask:
        board = choose("Which Arduino?", {name: chip.board for name, chip in BOARDS.items()}, "--board")
    chip = BOARDS[board] if board else entry.chip if entry else ATMEGA328P
    if entry and chip != entry.chip:
        raise ConfigError(
            f"the board is the {chip.board}, but --wiring is for the {entry.chip.board}; "
            f"give --wiring {OWN} to be asked for each pin"
        )
    return chip


def show_wires(made: Kit) -> None:
    """Print what each pin of the Arduino leads to."""
    inputs = (*wiring.BRIDGE_WIRES[made.bridge].inputs, "enable")
    outputs, encoders = wiring.output_pins(made.pins), wiring.encoder_pins(made.pins)
    names = [f"{_words(wheel)} motor" for wheel in WHEELS[: len(outputs)]]
    _show_row("input of " + made.bridge.upper(), names)
    for text, *pins in zip(inputs, *outputs):
        if set(pins) != {NOT_CONNECTED}:
            _show_row(text, [_label(pin, made.chip) for pin in pins])
    labels = [", ".join(_label(pin, made.chip) for pin in each) for each in encoders]
    _show_row("encoder A, B", ["none: no odometry"] if made.pins[wiring.NO_ENCODERS] else labels)
    shown = {*itertools.chain(*wiring.OUTPUTS, *wiring.ENCODERS), *wiring.ENABLES}
    others = [name for name in wiring.PIN_NAMES if name not in shown]
    used = [name for name in others if made.pins.get(name, NOT_CONNECTED) != NOT_CONNECTED]
    sonars = {given: place for place, (given, _) in made.sonars.items()}
    for name in used:
        given, _, wire = wiring.short(name).rpartition("_")
        leads_to = (
            "battery's divider" if name == wiring.BATTERY else _words(f"{sonars.get(given, given)}_{wire}")
        )
        _show_row(leads_to, [_label(made.pins[name], made.chip)])
    if made.sonars:
        click.echo(
            "  the places of the range sensors are assumed: correct the section sonars of the robot's file"
        )
    click.echo(f"  {SAFETY}\n" if set(used) & set(wiring.STOP_INPUTS) else "")


def _show_row(name: str, cells: Sequence[str]) -> None:
    width = 13 if len(cells) == wiring.FRONT else 18
    click.echo(f"  {name:<22}" + "".join(f"{cell:<{width}}" for cell in cells).rstrip())


def _chosen(wheels: int, board: Optional[str]) -> str:
    entries = {name: wirings.load(name) for name in wirings.names()}
    chips = [BOARDS[board]] if board else list(BOARDS.values())
    titles = {
        name: entry.title
        for name, entry in entries.items()
        if wiring.motors(entry.pins) == wheels and entry.chip in chips
    }
    own = "your own, also two wheels on a Mega: asks for the board and each pin"
    return choose("Which wiring?", {**titles, OWN: own}, "--wiring (or --pin)")


def _words(name: str) -> str:
    return wiring.short(name).replace("_", " ")


def _label(pin: int, chip: Chip) -> str:
    return "-" if pin == NOT_CONNECTED else chip.label(pin)


def _pin(text: str, place: str, chip: Chip) -> int:
    number = NOT_CONNECTED if text.strip() == "-" else chip.number(text.strip())
    if number is None:
        raise ConfigError(f"{place} is {text!r}, expected {chip.its_pins}")
    return number


def _given(text: str, chip: Chip) -> Tuple[str, int]:
    """Return a parameter and its pin, of which the user gave the name as in a robot's file."""
    name, equals, pin = text.partition("=")
    names = {wiring.short(row.name): row.name for row in wiring.rows(chip) if row.name in wiring.PIN_NAMES}
    if name not in names or not equals:
        raise ConfigError(f"--pin is {text!r}, expected NAME=PIN with one of {', '.join(names)}")
    return names[name], _pin(pin, f"--pin {name}", chip)


def _servo_names(chip: Chip) -> Sequence[str]:
    return wiring.SERVOS[: len(wiring.servo_pins(chip))]


def _servos(texts: Sequence[str], chip: Chip) -> Dict[str, int]:
    """Return the parameters of servos on these pins."""
    names = _servo_names(chip)
    if len(texts) > len(names):
        raise ConfigError(f"--servo names {len(texts)} pins, expected at most {len(names)}")
    return dict(zip(names, (_pin(text, "--servo", chip) for text in texts)))


def _take_sonars(wired: Wired, texts: Sequence[str]) -> None:
    """Add the range sensors of `--sonar`."""
    for text in texts:
        place, _, rest = text.partition("=")
        kind, _, given = rest.partition(":")
        kind, numbers = kind.upper(), given.split(",")
        if (
            place not in SONAR_PLACES
            or place in wired.sonars
            or kind not in SONAR_WIRES
            or len(numbers) != len(SONAR_WIRES[kind])
        ):
            raise ConfigError(
                f"--sonar is {text!r}, expected PLACE=TYPE:PINS, such as front=hc-sr04:A0,A1 (trigger, echo); the type "
                f"is one of {', '.join(SONAR_WIRES).lower()}, the place, once, one of {', '.join(SONAR_PLACES)}"
            )
        for name, pin in zip(wired.add_sonar(place, kind), numbers):
            wired.pins[name] = _pin(pin, f"--sonar {place}", wired.chip)


def _conflict(wired: Wired, complete: bool = True) -> str:
    """Return the first problem in words; empty if there is none."""
    bridge, pins, chip, _ = wired
    return wiring.in_words(wiring.check(pins, bridge, chip, complete), pins, chip)


def _list(chip: Chip, able: Callable[[Pin], bool]) -> str:
    """Return the pins that can do something, in words; the serial link's are left out."""
    found = [number for number, pin in enumerate(chip.pins) if able(pin) and number not in chip.serial]
    return ", ".join(map(chip.label, found))


def _ask(wired: Wired, wheels: int) -> None:
    """Ask for what is on the pins, one after the other, and again where there is a conflict."""
    bridge, pins, chip, _ = wired
    wires = wiring.BRIDGE_WIRES[bridge]
    facts = {
        "pins": f"2 to {chip.analog - 1} and A0 to {chip.label(len(chip.pins) - 1)}",
        "pwm": _list(chip, lambda pin: pin.timer >= 0),
        "encoder": _list(chip, lambda pin: pin.interrupts and pin is not chip.pins[chip.led]),
    }
    click.echo(_PICTURE.format(*wires.inputs, bridge=bridge.upper(), **facts), err=True)
    bus = ", ".join(map(chip.label, chip.bus))
    pins[wiring.I2C] = int(
        agrees(f"Are devices on the I2C bus ({bus}), such as an IMU?", bool(pins[wiring.I2C]))
    )
    for wheel, outputs, encoder in zip(WHEELS[:wheels], wiring.OUTPUTS, wiring.ENCODERS):
        side = _words(wheel)
        for wire, (name, text) in enumerate(zip(outputs, wires.inputs)):
            _ask_pin(wired, name, f"{side} motor, {text}", wire in wires.needed)
        for name, channel in () if pins[wiring.NO_ENCODERS] else zip(encoder, "AB"):
            _ask_pin(wired, name, f"{side} encoder, {channel}", channel == "A")
    for name in wiring.ENABLES:
        _ask_pin(wired, name, "enable of its own, such as STBY or a second EN", False)
    for name in _servo_names(chip):
        _ask_pin(wired, name, _words(name), False)
        if pins[name] == NOT_CONNECTED:
            break
    _ask_pin(wired, wiring.BATTERY, "divider of the battery's voltage", False)
    _ask_sonars(wired)
    given = any(pins[name] != NOT_CONNECTED for name in wiring.STOP_INPUTS)
    if agrees("Are there bumpers, cliff sensors or an emergency stop?", given):
        click.echo(f"  each is between its pin and GND; {SAFETY}", err=True)
        for name in wiring.STOP_INPUTS:
            _ask_pin(wired, name, _words(name), False)
    else:
        pins.update(dict.fromkeys(wiring.STOP_INPUTS, NOT_CONNECTED))


def _ask_sonars(wired: Wired) -> None:
    """Ask for range sensors, if a pin is free, and for their pins."""
    taken = {*wired.chip.serial, *(wired.pins[name] for name in wiring.PIN_NAMES)}
    if taken.issuperset(range(len(wired.chip.pins))) or not agrees(
        "Are there range sensors: HC-SR04, Sharp GP2Y0A21 or GP2Y0A02?"
    ):
        return
    analog = _list(wired.chip, lambda pin: pin.channel >= 0)
    echo = _list(wired.chip, lambda pin: pin.interrupts and pin is not wired.chip.pins[wired.chip.led])
    click.echo(_SONAR_PICTURE.format(echo=echo, analog=analog), err=True)
    kinds = click.Choice([*SONAR_WIRES, "none"], case_sensitive=False)
    for place in SONAR_PLACES:
        if place in wired.sonars or not wired.free_ranges:
            continue
        kind = click.prompt(f"Range sensor, {_words(place)}", default="none", type=kinds, err=True)
        if kind != "none":
            for name, wire in wired.add_sonar(place, kind).items():
                _ask_pin(wired, name, f"{_words(place)} {kind}, {wire}", True)


def _ask_pin(wired: Wired, name: str, question: str, needed: bool) -> None:
    """Ask for a pin until it fits to the others; the default is the one that was given."""
    pins = wired.pins
    default = None if needed and pins[name] == NOT_CONNECTED else _label(pins[name], wired.chip)
    while True:
        try:
            pins[name] = _pin(click.prompt(question, default=default, err=True), question, wired.chip)
            conflict = _conflict(wired, complete=False)
        except ConfigError as error:
            conflict = str(error)
        if needed and pins[name] == NOT_CONNECTED and not conflict:
            conflict = "the bridge, the encoder or the sensor needs this pin"
        if not conflict:
            return
        print_message(conflict)
        pins[name] = NOT_CONNECTED
