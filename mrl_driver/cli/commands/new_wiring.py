"""The wiring of a new robot: from the catalogue, from options, or asked pin by pin; checked before it is written."""

from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import NOT_CONNECTED
from mrl_driver.robot import wiring, wirings
from mrl_driver.robot.chips import ATMEGA328P as CHIP

from .shared import choose, print_message

CHIPS = {
    "vnh5019": "Pololu's VNH5019 shield or carrier, VNH2SP30: inputs INA, INB, PWM",
    "cytron": "Cytron's MD10C, MD13S, MDD10A, shields with an L298P: inputs PWM, DIR, and perhaps a brake",
    "l298n": "modules with an L298N and PWM on IN1: inputs EN, IN1, IN2; remove the jumpers of EN",
    "l298n_enable": "the same with PWM on EN",
    "tb6612": "carriers of the TB6612FNG: inputs PWM, IN1, IN2; connect STBY to 5 V",
    "drv8833": "carriers of the DRV8833: two inputs a motor",
    "bts7960": "modules with two BTS7960 (IBT-2), Cytron's MDD3A: inputs RPWM, LPWM",
}
"""What each bridge is sold as."""
OWN = "own"
_PICTURE = """
    Arduino     bridge {bridge}
      pin ----- {0:<7}---+--------+
      pin ----- {1:<7}---|        |---- motor        pin ----- A ---+---------+
      pin ----- {2:<7}---+--------+                  pin ----- B ---| encoder |   B is optional
                                                                +---------+
    Pins are 2 to 13 and A0 to A5.  D0 and D1 are the USB link.  PWM: {pwm}.  Enter or -: not connected.
"""


def add_options(command: Any) -> Any:
    """Add the options of the wiring to a command."""
    for option in (
        click.option("--i2c", is_flag=True, help="Devices are on the I2C bus, A4 and A5."),
        click.option("--servo", type=str, multiple=True, metavar="PIN", help="Keep a pin free for a servo."),
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
            "--bridge", type=click.Choice(list(CHIPS), case_sensitive=False), help="Kind of the H-bridge."
        ),
    ):
        command = option(command)
    return command


def wiring_of(options: Mapping[str, Any]) -> Tuple[str, Dict[str, int]]:
    """Return bridge and wiring; raise ConfigError, with pin and reason, if the board cannot do that."""
    name = options["wiring"] or ("" if options["pin"] else _chosen())
    entry = wirings.load(name) if name not in ("", OWN) else None
    bridge = options["bridge"] or (entry.bridge if entry else "")
    bridge = (bridge or choose("Which H-bridge drives the motors?", CHIPS, "--bridge")).lower()
    pins = {**wiring.EMPTY, **(entry.pins if entry else {}), **dict(map(_given, options["pin"]))}
    pins[wiring.I2C] |= int(options["i2c"])
    servos = [_pin(text, "--servo") for text in options["servo"]]
    conflict = _conflict(pins, bridge, servos, complete=name != OWN)
    if name == OWN and not conflict:
        _ask(pins, bridge, servos)
        conflict = _conflict(pins, bridge, servos)
    if conflict:
        raise ConfigError(f"{conflict}; nothing was written")
    return bridge, pins


def show_wires(bridge: str, pins: Mapping[str, int]) -> None:
    """Print which pin of the Arduino leads to which input of the bridge, and to the encoders."""
    inputs = wiring.BRIDGE_WIRES[bridge].inputs
    left, right = wiring.output_pins(pins)
    click.echo(f"\n  {'input of ' + bridge.upper():<22}left motor   right motor")
    for row in zip(inputs, left, right):
        if set(row[1:]) != {NOT_CONNECTED}:
            click.echo(f"  {row[0]:<22}{_label(row[1]):<13}{_label(row[2])}")
    first, second = (", ".join(map(_label, each)) for each in wiring.encoder_pins(pins))
    click.echo(f"  {'encoder A, B':<22}{first:<13}{second}\n")


def _chosen() -> str:
    titles = {name: wirings.load(name).title for name in wirings.names()}
    return choose("Which wiring?", {**titles, OWN: "your own: asks for each pin"}, "--wiring (or --pin)")


def _label(pin: int) -> str:
    return "-" if pin == NOT_CONNECTED else CHIP.label(pin)


def _pin(text: str, place: str) -> int:
    number = NOT_CONNECTED if text.strip() == "-" else CHIP.number(text.strip())
    if number is None:
        raise ConfigError(f"{place} is {text!r}, expected a pin of the {CHIP.board}, such as 5 or A4")
    return number


def _given(text: str) -> Tuple[str, int]:
    """Return a parameter and its pin, of which the user gave the name as in a robot's file."""
    name, equals, pin = text.partition("=")
    names = {wiring.short(each): each for each in wiring.NAMES if each != wiring.I2C}
    if name not in names or not equals:
        raise ConfigError(f"--pin is {text!r}, expected NAME=PIN with one of {', '.join(names)}")
    return names[name], _pin(pin, f"--pin {name}")


def _conflict(pins: Mapping[str, int], bridge: str, servos: Sequence[int], complete: bool = True) -> str:
    """Return the first problem in words, also with servos; empty if there is none."""
    problem = wiring.check(pins, bridge, CHIP, complete)
    servo = next((each for each in servos if wiring.servo_conflict(each, pins, bridge, CHIP)), None)
    if problem == wiring.SOUND and servo is not None:
        return f"servo on {CHIP.label(servo)}: {wiring.servo_conflict(servo, pins, bridge, CHIP)}"
    return wiring.in_words(problem, pins, CHIP)


def _ask(pins: Dict[str, int], bridge: str, servos: List[int]) -> None:
    """Ask for what is on the pins, one after the other, and again where there is a conflict."""
    wires = wiring.BRIDGE_WIRES[bridge]
    with_pwm = ", ".join(CHIP.label(number) for number, pin in enumerate(CHIP.pins) if pin.timer >= 0)
    click.echo(_PICTURE.format(*wires.inputs, bridge=bridge.upper(), pwm=with_pwm), err=True)
    pins[wiring.I2C] |= int(click.confirm("Are devices on the I2C bus (A4, A5), such as an IMU?", err=True))
    while True:
        text: str = click.prompt("Pins of servos, such as 9 10", default="-", err=True)
        try:
            asked = [_pin(each, "servo") for each in text.split() if each != "-"]
            conflict = _conflict(pins, bridge, [*servos, *asked], complete=False)
        except ConfigError as error:
            conflict = str(error)
        if not conflict:
            break
        print_message(conflict)
    servos += asked
    for side, outputs, encoder in zip(wiring.SIDES, wiring.OUTPUTS, wiring.ENCODERS):
        for wire, (name, text) in enumerate(zip(outputs, wires.inputs)):
            _ask_pin(pins, bridge, servos, name, f"{side} motor, {text}", wire in wires.needed)
        for name, channel in zip(encoder, "AB"):
            _ask_pin(pins, bridge, servos, name, f"{side} encoder, {channel}", channel == "A")
    _ask_pin(pins, bridge, servos, "pin_battery", "divider of the battery's voltage", False)


def _ask_pin(
    pins: Dict[str, int], bridge: str, servos: Sequence[int], name: str, question: str, needed: bool
) -> None:
    """Ask for a pin until it fits to those before it."""
    default: Optional[str] = None if needed else "-"
    while True:
        try:
            pins[name] = _pin(click.prompt(question, default=default, err=True), question)
            conflict = _conflict(pins, bridge, servos, complete=False)
        except ConfigError as error:
            conflict = str(error)
        if needed and pins[name] == NOT_CONNECTED and not conflict:
            conflict = "the bridge or the encoder needs this pin"
        if not conflict:
            return
        print_message(conflict)
        pins[name] = NOT_CONNECTED
