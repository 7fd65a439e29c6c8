"""`mrl new`: from a few questions to a calibrated robot of your own."""

import os
import shlex
import sys
from typing import Any, Callable, Dict, Mapping, Optional, Tuple, TypeVar

import click

from mrl_driver.errors import ConfigError, PortMissing
from mrl_driver.files import replace_file
from mrl_driver.host import named_robots
from mrl_driver.protocol.table import NOT_CONNECTED, WHEELS
from mrl_driver.robot import models
from mrl_driver.robot.models import kit
from mrl_driver.robot.models.drives import DIFFERENTIAL, FOUR_WHEELS, MECANUM
from mrl_driver.robot.models.kit import Kit
from mrl_driver.robot.wiring import BRIDGE_WIRES, FRONT, NO_ENCODERS, encoder_pins

from .new_wiring import add_options, show_wires, wiring_of
from .shared import Between, complete_port, confirm, print_message, require_device, yes_option

Answer = TypeVar("Answer")
_WHEEL = """
           _____
         /       \\
        |    o    |  D    Wheel diameter D: measure across the tyre, under load.
         \\ _____ /
    --------------------- floor
"""
_AXLE = """
            front
         ___________
     ___|           |___
    |   |           |   |
    | L |  seen     | R |    Wheel separation S: from the middle of one tyre
    |   |  from     |   |    to the middle of the other, where they touch the floor.
    |___|  above    |___|
        |___________|
      |<------ S ------>|
"""
_BASE = """
            front
     [L]  |-------|  [R]   -----
          | seen  |          ^
          | from  |          W    Wheelbase W: from the front axle to the rear one.
          | above |          v
     [L]  |_______|  [R]   -----
"""
_ENCODER = """
    encoder disc --- motor --- gearbox --- wheel
      lines                    ratio

    Counts of a wheel turn = lines x 4 x ratio, such as 11 x 4 x 34.  A channel has as many pulses a motor turn as the
    disc has lines (data sheet: PPR); CPR is often lines x 4 already.  Encoders with channel A only: lines x 2 x ratio.
    Motors without encoders: begin again with --no-encoders.
"""


@click.command(short_help="Make a robot of your own: file, firmware, calibration.")
@click.argument("name", required=False)
@click.option("--port", metavar="PORT", shell_complete=complete_port, help="Serial port of the board.")
@click.option("--wheel-diameter", type=Between(*kit.DIAMETER_MM), help="Diameter of a wheel [mm].")
@click.option("--separation", type=Between(*kit.SEPARATION_MM), help="Distance between the wheels [mm].")
@click.option(
    "--kind",
    type=click.Choice([DIFFERENTIAL, *FOUR_WHEELS]),
    default=DIFFERENTIAL,
    show_default=True,
    help="Two wheels, or four on a Mega: skid steering or mecanum wheels.",
)
@click.option(
    "--wheelbase", type=Between(*kit.SEPARATION_MM), help="Distance between the axles of mecanum wheels [mm]."
)
@click.option("--counts", metavar="NUMBER", help="Encoder counts of a wheel turn, such as 1496 or 11x4x34.")
@add_options
@click.option(
    "--id", "robot_id", type=click.IntRange(kit.LEAST_ID, 32767), help="Robot id; default: a free one."
)
@click.option("--single-channel", is_flag=True, help="The encoders have channel A only.")
@click.option("--no-encoders", is_flag=True, help="The motors have no encoders: no odometry, no --counts.")
@click.option("--file-only", is_flag=True, help="Only write the robot's file.")
@click.option("--flash/--no-flash", default=True, show_default=True, help="Upload the firmware.")
@click.option("--answers", metavar="WORDS", help="As for mrl calibrate wiring, for scripts.")
@click.option("--truth", metavar="FILE", help="As for mrl calibrate wiring, for an emulated robot.")
@yes_option
def new(name: Optional[str], file_only: bool, **options: Any) -> None:
    """Make a robot of your own: two wheels, an H-bridge, an Arduino Uno, Nano or Mega; or four wheels and a Mega.

    Asks for its wheels, encoders, bridge and pins, writes the robot's file, uploads the firmware, gives the board an
    id, and goes on to mrl calibrate wiring and mrl calibrate gains.  The pins are those of a common shield or
    tutorial, or your own; a pin that cannot do what it is for is refused before anything is written.  Whether motors
    or encoders are exchanged or reversed does not matter.

    \b
    Examples:
      mrl new
      mrl new rover --wheel-diameter 65 --separation 150 --counts 11x4x34 --wiring mrl_duo --bridge tb6612
      mrl new rover --wiring pwm_d5_d6_dir_d4_d7 --pin battery=A0 --i2c --file-only
      mrl new rover --board mega --wiring own --sonar front=hc-sr04:A0,A8 --sonar left=gp2y0a21:A1
      mrl new truck --kind mecanum --wheelbase 120 --wiring mega_four_wheels
    """
    port = None if file_only else _port_of(options)
    name = _asked(name, "NAME", "", lambda: click.prompt("Name of the robot", err=True))
    path = _path_of(name)
    made = _kit(name, options)
    model, text = kit.model_of(made), kit.text_of(made)
    confirm(f"Write {path}, for {_in_words(made)}, with robot id {made.robot_id}?", options["yes"])
    try:
        os.makedirs(os.path.dirname(path), exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{path} cannot be written: {error.strerror}") from None
    replace_file(path, text)
    click.echo(f"{path} is written; all programs know the robot as --robot {model.name}")
    show_wires(made)
    if made.pins[NO_ENCODERS] and BRIDGE_WIRES[made.bridge].coasts:
        print_message(
            f"with {made.bridge} motors coast between the pulses: without encoders slow commands drive much too fast"
        )
    if port:
        _set_up(made, path, port, options)


def _port_of(options: Mapping[str, Any]) -> str:
    """Return the port of the board; raise ConfigError or PortMissing, before the questions."""
    from .flash import only_board

    outer = click.get_current_context().find_root().params.get("port") or os.environ.get("MRL_PORT")
    try:
        port: str = options["port"] or outer or only_board()
        require_device(port)
        return port
    except (ConfigError, PortMissing) as error:
        raise type(error)(f"{error}; without a board, --file-only writes the robot's file") from None


def _path_of(name: str) -> str:
    path = os.path.join(models.own_folder(), f"{name}.yaml")
    if os.path.exists(path):
        raise ConfigError(
            f"{path} already exists; give another name, delete it to begin again, or go on with: "
            f"{_next('wiring', path, None)}"
        )
    named_robots.require_name(name)
    return path


def _require_used(options: Mapping[str, Any]) -> None:
    """Refuse an option that another one leaves without a use."""
    without, kind = options["no_encoders"], options["kind"]
    for name, unused, why in (
        ("counts", without, "--no-encoders"),
        ("single_channel", without, "--no-encoders"),
        ("wheelbase", kind != MECANUM, f"--kind {kind}"),
    ):
        if unused and options[name]:
            raise ConfigError(f"--{name.replace('_', '-')} has no use with {why}; leave one of them out")


def _kit(name: str, options: Mapping[str, Any]) -> Kit:
    _require_used(options)
    diameter_mm = _number(options, "wheel_diameter", _WHEEL, "Wheel diameter [mm]", kit.DIAMETER_MM)
    separation_mm = _number(options, "separation", _AXLE, "Wheel separation [mm]", kit.SEPARATION_MM)
    counted = None if options["no_encoders"] else _asked(options["counts"], "--counts", _ENCODER, _ask_counts)
    counts = kit.NOMINAL_COUNTS if counted is None else kit.parse_counts(counted)
    kind, base_mm = options["kind"], 0.0
    if kind == MECANUM:
        base_mm = _number(options, "wheelbase", _BASE, "Wheelbase [mm]", kit.SEPARATION_MM)
    bridge, pins, chip, sonars = wiring_of(options, len(WHEELS) if kind in FOUR_WHEELS else FRONT)
    robot_id = options["robot_id"] or kit.free_id()
    _require_free(robot_id)
    return Kit(name, robot_id, diameter_mm, separation_mm, counts, bridge, pins, chip, kind, base_mm, sonars)


def _require_free(robot_id: int) -> None:
    """Refuse an id by which programs would take this robot for another one."""
    other = models.by_id(robot_id)
    if other:
        raise ConfigError(
            f"--id is {robot_id}, the id of {other}, expected a free one, such as {kit.free_id()}"
        )


def _asked(value: Optional[Answer], option: str, picture: str, ask: Callable[[], Answer]) -> Answer:
    """Return the value, or show the picture and ask for it."""
    if value is not None:
        return value
    if not sys.stdin.isatty():
        raise ConfigError(f"{option} is missing, and stdin is not a terminal to ask for it; give {option}")
    click.echo(picture, err=True)
    return ask()


def _number(
    options: Mapping[str, Any], name: str, picture: str, question: str, limits: Tuple[float, float]
) -> float:
    option, kind = f"--{name.replace('_', '-')}", Between(*limits)
    return _asked(options[name], option, picture, lambda: click.prompt(question, type=kind, err=True))


def _ask_counts() -> str:
    while True:
        text: str = click.prompt("Counts of a wheel turn", err=True)
        try:
            kit.parse_counts(text)
            return text
        except ConfigError as error:
            print_message(str(error))


def _in_words(made: Kit) -> str:
    counts = "no encoders" if made.pins[NO_ENCODERS] else f"{made.counts_per_turn:g} counts a turn"
    return (
        f"wheels of {made.wheel_diameter_mm:g} mm, {made.wheel_separation_mm:g} mm apart, {counts}, "
        f"{made.bridge.upper()}"
    )


def _set_up(made: Kit, path: str, port: str, options: Mapping[str, Any]) -> None:
    """Upload the firmware, set the id and the parameters, and calibrate wiring and gains."""
    from .flash import HBRIDGE, flash
    from .set_id import set_id

    ctx = click.get_current_context()
    commands: Any = ctx.find_root().command
    calibrate = commands.get_command(ctx, "calibrate")
    wiring, gains = (calibrate.get_command(ctx, name) for name in ("wiring", "gains"))
    robot: Dict[str, Any] = {"port": port, "robot": path, "baud": None}
    shared = {name: options[name] for name in ("truth", "yes")}
    if options["flash"]:
        ctx.invoke(flash, **robot, build=HBRIDGE, yes=options["yes"])
    ctx.invoke(set_id, **robot, robot_id=made.robot_id, yes=True)
    has_encoders = not made.pins[NO_ENCODERS]
    single = has_encoders and all(b == NOT_CONNECTED for _, b in encoder_pins(made.pins))
    single = single or options["single_channel"]
    wires = {"single_channel": single, "answers": options["answers"], "bridge": made.bridge}
    ctx.invoke(wiring, **robot, **shared, **wires)
    later = f"the wiring is stored; go on later with: {_next('gains', path, port)}"
    confirm("Put the robot on a free floor. Go on with mrl calibrate gains?", options["yes"], later)
    ctx.invoke(gains, **robot, **shared, eeprom=True)
    if has_encoders:
        others = "turn, sideways and umbmark" if made.kind == MECANUM else "turn and umbmark"
        click.echo(f"next, with a tape measure: {_next('straight', path, port)}, then {others}")


def _next(procedure: str, path: str, port: Optional[str]) -> str:
    return f"mrl calibrate {procedure} --robot {shlex.quote(path)} --port {port or 'PORT'}"
