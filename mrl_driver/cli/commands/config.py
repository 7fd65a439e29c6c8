"""`mrl config`: the parameters in a board's EEPROM."""

import difflib
import sys
from typing import TYPE_CHECKING, Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host.named_robots import Target
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME, PARAMETERS, Parameter

from .shared import (
    complete_parameter,
    confirm,
    confirm_overwrite,
    connected,
    json_option,
    print_json,
    print_message,
    robot_options,
    yes_option,
)

if TYPE_CHECKING:
    from mrl_driver.driver import Driver
    from mrl_driver.driver.parameter_file import ParameterFile


try_option = click.option(
    "--try",
    "only_try",
    is_flag=True,
    help="Do not save: the next reset, or opening the port, undoes the change.",
)


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
      mrl config dump lab3.yaml --robot lab3
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

    rows = [_row(name) for name in names]
    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        values = [_value(driver, row) for row in rows or driver.parameters.rows]
    if as_json:
        print_json([_plain(each) for each in values])
    else:
        show(values)


@config.command("set", context_settings={"ignore_unknown_options": True})  # a value may be negative
@click.argument(
    "words", nargs=-1, required=True, metavar="NAME VALUE [NAME VALUE]...", shell_complete=complete_parameter
)
@robot_options
@try_option
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

    wanted = parse(words)
    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        old = driver.parameters.read(*(row.name for row, _ in wanted))
        changes = ", ".join(f"{row.name} {old[row.name]} to {value}" for row, value in wanted)
        confirm(f"Change {changes} on robot {driver.board.robot_id}?", yes)
        driver.parameters.write({row.name: value for row, value in wanted})
        if not only_try:
            driver.parameters.save()
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

    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        confirm(f"Save the parameters in force on robot {driver.board.robot_id}?", yes)
        driver.parameters.save()
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

    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        assert driver.model is not None
        robot_id, model = driver.board.robot_id, driver.model
        confirm(f"Set all parameters of robot {robot_id} but its id to those of the model {model.name}?", yes)
        driver.parameters.save_model(robot_id, model)
    click.echo("the defaults are saved")


class Difference(NamedTuple):
    """A parameter that differs between a board and a file or robot model."""

    row: Parameter
    board: Optional[int]
    """None if the board does not have it."""
    other: Optional[int]
    """Value in the file or model; None if it has none."""


@config.command()
@click.argument("file", required=False, type=click.Path(dir_okay=False))
@robot_options
@yes_option
def dump(target: Target, file: Optional[str], yes: bool) -> None:
    """Write all parameters to a YAML file, or print them.

    The file also has the board's id and firmware, and the meaning and unit of each parameter.  mrl config load writes
    it back, and mrl config diff compares it with a board.

    \b
    Examples:
      mrl config dump lab3.yaml --robot lab3
      mrl config dump --port /dev/ttyACM0
    """
    from mrl_driver.driver import parameter_file
    from mrl_driver.files import replace_file

    confirm_overwrite(file, yes)
    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        found = parameter_file.of_driver(driver)
    if file is None:
        click.echo(parameter_file.text_of(found), nl=False)
        return
    replace_file(file, parameter_file.text_of(found))
    click.echo(f"{file} has {len(found.values)} parameters of robot {found.robot_id}")


@config.command()
@click.argument("file", type=click.Path(dir_okay=False))
@robot_options
@try_option
@click.option("--other-robot", is_flag=True, help="Accept the file of another robot or model.")
@yes_option
def load(target: Target, file: str, only_try: bool, other_robot: bool, yes: bool) -> None:
    """Set and save all parameters of a dumped file.

    The whole file is checked before the first parameter is set, and the board afterwards.  The robot id stays: a new
    board first gets it with mrl set-id.  The file must be of this robot, unless --other-robot is given; the board
    then keeps its bridge and wiring, which belong to the cables.

    \b
    Examples:
      mrl config load lab3.yaml --robot lab3
      mrl config load lab3.yaml --robot lab4 --other-robot --try
    """
    from mrl_driver.driver import parameter_file

    wanted = parameter_file.read(file)
    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        parameter_file.require_kind(wanted, file, driver, other_robot)
        values = parameter_file.values_for(driver.board.robot_id, wanted)
        driver.parameters.require(values)
        old = parameter_file.of_driver(driver).values
        listed = ", ".join(
            f"{name} {old[name]} to {value}" for name, value in values.items() if value != old[name]
        )
        if listed:
            confirm(f"Change {listed} on robot {driver.board.robot_id}?", yes)
        driver.parameters.replace(values, saved=not only_try)
    kept = ", ".join(name for name in old if name not in values)
    if kept:
        print_message(f"the board keeps its own {kept}")
    done = "in force until the next reset" if only_try else "saved"
    click.echo(f"{listed or 'no parameter differs'}: {done}")


@config.command()
@click.argument("file", required=False, type=click.Path(dir_okay=False))
@robot_options
@json_option
def diff(target: Target, file: Optional[str], as_json: bool) -> None:
    """Compare the parameters with a file or the model.

    The exit code is 1 if a parameter differs, 0 if none does.

    \b
    Examples:
      mrl config diff lab3.yaml --robot lab3
      mrl config diff --robot lab3               with the robot model
    """
    from mrl_driver.driver import parameter_file

    wanted = parameter_file.read(file) if file else None
    with connected(target, ignore_battery=True) as driver:
        driver.parameters.require_eeprom()
        found, model = parameter_file.of_driver(driver), driver.model
    if wanted is not None:
        differences = _differences(found, wanted)
    else:
        from mrl_driver.driver.parameters import differing

        expected = differing(found.values, model) if model else {}
        differences = [
            Difference(PARAMETER_BY_NAME[name], found.values[name], value) for name, value in expected.items()
        ]
    name = file or f"the model {found.model}"
    if as_json:
        print_json([_plain_difference(each) for each in differences])
    else:
        _show_differences(differences, found, name)
    if differences:
        sys.exit(1)


def _differences(found: "ParameterFile", wanted: "ParameterFile") -> List[Difference]:
    """Return what differs between a board and a file; the robot id counts too."""
    board, file = ({"robot_id": each.robot_id, **each.values} for each in (found, wanted))
    compared = [Difference(row, board.get(row.name), file.get(row.name)) for row in PARAMETERS]
    return [each for each in compared if each.board != each.other]


def _plain_difference(each: Difference) -> Dict[str, Any]:
    return {"name": each.row.name, "board": each.board, "expected": each.other, "unit": each.row.unit}


def _show_differences(differences: Sequence[Difference], found: "ParameterFile", name: str) -> None:
    if not differences:
        click.echo(f"robot {found.robot_id} has the parameters of {name}")
        return
    click.echo(f"{'parameter':<16}{'board':>7} {'expected':>8} {'unit':<9} meaning; expected: {name}")
    for row, board, other in differences:
        cells = ["-" if value is None else str(value) for value in (board, other)]
        click.echo(f"{row.name:<16}{cells[0]:>7} {cells[1]:>8} {row.unit:<9} {row.text}".rstrip())


def parse(words: Sequence[str]) -> List[Tuple[Parameter, int]]:
    """Parse alternating names and values.

    Raises:
        ConfigError: a name is unknown or repeated, or a value is missing, not a whole number or out of range.
    """
    if len(words) % 2:
        raise ConfigError(
            f"{words[-1]!r} has no value, expected names and values in turn, such as: kp 800 ki 350"
        )
    from mrl_driver.driver import parameter_file

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
        if name == "radio_hold":
            parameter_file.require_hold(value, name)
        found[name] = (row, value)
    return list(found.values())


def _row(name: str) -> Parameter:
    if name not in PARAMETER_BY_NAME:
        near = difflib.get_close_matches(name, PARAMETER_BY_NAME, 3, 0.5)
        expected = ", ".join(near or PARAMETER_BY_NAME)
        raise ConfigError(f"parameter {name!r} is unknown, expected {expected}")
    return PARAMETER_BY_NAME[name]


def _value(driver: "Driver", row: Parameter) -> ParameterValue:
    from mrl_driver.driver.parameters import default_of

    return ParameterValue(row, driver.parameters.read(row.name)[row.name], default_of(driver.model, row))


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
