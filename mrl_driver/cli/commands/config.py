"""`mrl config`: the parameters in a board's EEPROM."""

import difflib
from typing import TYPE_CHECKING, Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host.named_robots import Target
from mrl_driver.navigation.radio_holder import FRESH_S
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME, Parameter
from mrl_driver.robot.models import COMMON_BOARD, RobotModel

from .shared import complete_parameter, confirm, connected, json_option, print_json, robot_options, yes_option

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


LEAST_HOLD = round(FRESH_S / 0.1)
"""Smallest `radio_hold` but 0: below it, a board's host may release it while its holder still counts it as held."""


class ParameterValue(NamedTuple):
    """One parameter of a board, in the unit of its row."""

    row: Parameter
    value: int
    default: Optional[int]
    """Default of the model; None if it has none, and for the robot id."""


@click.group()
def config() -> None:
    """Read and change the parameters in a board's EEPROM.

    \b
    Examples:
      mrl config get --port /dev/ttyACM0
      mrl config set kp 800 ki 350 --robot lab3
      mrl config defaults --robot lab3
      mrl config save --robot lab3
    """


@config.command("get")
@click.argument("names", nargs=-1, metavar="[NAME]...", shell_complete=complete_parameter)
@robot_options
@json_option
def get(target: Target, names: Tuple[str, ...], as_json: bool) -> None:
    """Show all parameters that the board uses, or those named.

    A * marks values that differ from the robot model.

    \b
    Examples:
      mrl config get --port /dev/ttyACM0
      mrl config get kp ki kd --robot lab3 --json
    """
    from mrl_driver.driver import eeprom

    rows = [_row(name) for name in names]
    with connected(target, ignore_battery=True) as driver:
        eeprom.require_config(driver)
        values = [_value(driver, row) for row in rows or eeprom.parameters(driver)]
    if as_json:
        print_json([_plain(each) for each in values])
    else:
        show(values)


@config.command("set", context_settings={"ignore_unknown_options": True})  # a value may be negative
@click.argument(
    "words", nargs=-1, required=True, metavar="NAME VALUE [NAME VALUE]...", shell_complete=complete_parameter
)
@robot_options
@click.option(
    "--try",
    "only_try",
    is_flag=True,
    help="Do not save: the next reset, or opening the port, undoes the change.",
)
@yes_option
@json_option
def set_(target: Target, words: Tuple[str, ...], only_try: bool, yes: bool, as_json: bool) -> None:
    """Change parameters and save them.

    They take effect at once and are saved in the EEPROM.  Values are whole numbers in the unit that mrl config
    get shows.  Set the robot id with mrl set-id.

    \b
    Examples:
      mrl config set linear_ceiling 500 --port /dev/ttyACM0
      mrl config set kp 800 ki 350 --robot lab3 --yes
    """
    from mrl_driver.driver import eeprom

    wanted = parse(words)
    with connected(target, ignore_battery=True) as driver:
        eeprom.require_config(driver)
        old = eeprom.read(driver, *(row.name for row, _ in wanted))
        changes = ", ".join(f"{row.name} {old[row.name]} to {value}" for row, value in wanted)
        confirm(f"Change {changes} on robot {driver.board.robot_id}?", yes)
        eeprom.write(driver, {row.name: value for row, value in wanted})
        if not only_try:
            eeprom.save(driver)
        values = [_value(driver, row) for row, _ in wanted]
    if as_json:
        print_json([_plain(each) for each in values])
    else:
        click.echo(f"{changes}: {'in force until the next reset' if only_try else 'saved'}")


@config.command("save")
@robot_options
@yes_option
def save_(target: Target, yes: bool) -> None:
    """Save the parameters in force to the EEPROM.

    Works on boards that do not reset when their port is opened.  An Uno resets, and loses what --try changed.
    """
    from mrl_driver.driver import eeprom

    with connected(target, ignore_battery=True) as driver:
        eeprom.require_config(driver)
        confirm(f"Save the parameters in force on robot {driver.board.robot_id}?", yes)
        eeprom.save(driver)
    click.echo("saved")


@config.command()
@robot_options
@yes_option
def defaults(target: Target, yes: bool) -> None:
    """Save the robot model's values of all parameters but the id.

    \b
    Example:
      mrl config defaults --robot lab3
    """
    from mrl_driver.driver import eeprom

    with connected(target, ignore_battery=True) as driver:
        eeprom.require_config(driver)
        assert driver.model is not None
        robot_id, model = driver.board.robot_id, driver.model
        confirm(f"Set all parameters of robot {robot_id} but its id to those of the model {model.name}?", yes)
        eeprom.save_model(driver, robot_id, model)
    click.echo("the defaults are saved")


def parse(words: Sequence[str]) -> List[Tuple[Parameter, int]]:
    """Parse alternating names and values.

    Raises:
        ConfigError: a name is unknown or repeated, or a value is missing, not a whole number or out of range.
    """
    if len(words) % 2:
        raise ConfigError(
            f"{words[-1]!r} has no value, expected names and values in turn, such as: kp 800 ki 350"
        )
    found: Dict[str, Tuple[Parameter, int]] = {}
    for name, text in zip(words[::2], words[1::2]):
        row = _row(name)
        if name == "robot_id":
            raise ConfigError("robot_id cannot be set here; use: mrl set-id ID")
        if name in found:
            raise ConfigError(f"{name} is given twice, expected each name once")
        try:
            value = BRIDGES.index(text) if name == "bridge" and text in BRIDGES else int(text)
        except ValueError:
            value = row.high + 1
        if not row.low <= value <= row.high:
            unit = f" [{row.unit}]" if row.unit else ""
            raise ConfigError(
                f"{name} is {text!r}, expected a whole number from {row.low} to {row.high}{unit}"
            )
        if name == "radio_hold" and 0 < value < LEAST_HOLD:
            raise ConfigError(
                f"radio_hold is {value}, expected 0 or {LEAST_HOLD} to {row.high} [{row.unit}]: "
                f"a holder counts an answer for {FRESH_S:g} s"
            )
        found[name] = (row, value)
    return list(found.values())


def _row(name: str) -> Parameter:
    if name not in PARAMETER_BY_NAME:
        near = difflib.get_close_matches(name, PARAMETER_BY_NAME, 3, 0.5)
        expected = ", ".join(near or PARAMETER_BY_NAME)
        raise ConfigError(f"parameter {name!r} is unknown, expected {expected}")
    return PARAMETER_BY_NAME[name]


def _value(driver: "Driver", row: Parameter) -> ParameterValue:
    from mrl_driver.driver import eeprom

    return ParameterValue(row, eeprom.read(driver, row.name)[row.name], default_of(driver.model, row))


def default_of(model: Optional[RobotModel], row: Parameter) -> Optional[int]:
    """Return a robot model's value of a parameter; the wiring belongs to the robot, unless its own file has it."""
    own = model.board if model is not None else {}
    if row.name == "wiring":
        return own.get(row.name)
    return own.get(row.name, COMMON_BOARD.get(row.name))


def _plain(each: ParameterValue) -> Dict[str, Any]:
    row = each.row
    return {
        "name": row.name,
        "value": each.value,
        "unit": row.unit,
        "default": each.default,
        "low": row.low,
        "high": row.high,
    }


def show(values: Sequence[ParameterValue]) -> None:
    """Print parameters as a table; `*` marks values that differ from the model."""
    click.echo(f"{'parameter':<16}{'value':>7} {'unit':<9}{'':<9} meaning")
    for each in values:
        row = each.row
        differs = each.default is not None and each.default != each.value
        mark = f"* {each.default}" if differs else ""
        chip = f"{BRIDGES[each.value]}: " if row.name == "bridge" else ""
        click.echo(f"{row.name:<16}{each.value:>7} {row.unit:<9}{mark:<9} {chip}{row.text}".rstrip())
    if any(each.default not in (None, each.value) for each in values):
        click.echo("* differs from the robot model; its value follows the *")
