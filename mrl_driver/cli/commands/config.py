"""`mrl config`: the parameters in a board's EEPROM."""

import contextlib
import difflib
import sys
from typing import TYPE_CHECKING, Any, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME, PARAMETERS, Parameter
from mrl_driver.robot.wiring import NAMES

from . import shared
from .shared import Run, completion_of, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver
    from mrl_driver.driver.parameter_file import ParameterFile

complete_parameter = completion_of(lambda: list(PARAMETER_BY_NAME))
try_option = click.option(
    "--try",
    "only_try",
    is_flag=True,
    help="Do not save: the next reset, or opening the port, undoes the change.",
)
file_argument = click.argument("file", required=False, type=click.Path(dir_okay=False))


@click.group()
def config() -> None:
    """Read and change the parameters in a board's EEPROM.

    \b
    Examples:
      mrl config get --port /dev/ttyACM0
      mrl config set kp 800 ki 350 --robot lab3
      mrl config defaults --robot lab3
      mrl config save --robot lab3
      mrl config dump board.yaml --robot lab3
    """


@config.command("get")
@click.argument("names", nargs=-1, metavar="[NAME]...", shell_complete=complete_parameter)
@run_options(shared.json_option)
def get(run: Run, names: Tuple[str, ...]) -> None:
    """Show all parameters that the board uses, or those named.

    A * marks values that differ from the robot model.

    \b
    Examples:
      mrl config get --port /dev/ttyACM0
      mrl config get kp ki kd --robot lab3 --json
    """
    rows = [_row(name) for name in names]
    with _connected(run) as driver:
        values = _values(driver, rows or driver.parameters.rows)
    run.print(values, _table(values))


@config.command("set", context_settings={"ignore_unknown_options": True})  # a value may be negative
@click.argument(
    "words", nargs=-1, required=True, metavar="NAME VALUE [NAME VALUE]...", shell_complete=complete_parameter
)
@run_options(shared.yes_option, shared.json_option)
@try_option
def set_(run: Run, words: Tuple[str, ...], only_try: bool) -> None:
    """Change parameters and save them.

    They take effect at once and are saved in the EEPROM.  Values are whole numbers in the unit that mrl config
    get shows.  Set the robot id with mrl set-id.

    \b
    Examples:
      mrl config set linear_ceiling 500 --port /dev/ttyACM0
      mrl config set kp 800 ki 350 --robot lab3 --yes
    """
    wanted = parse(words)
    with _connected(run) as driver:
        changes = _changes(driver.parameters.read(*wanted), wanted)
        run.confirm(f"Change {changes} on robot {driver.board.robot_id}?")
        unknown = driver.parameters.replace(wanted, saved=not only_try)
        values = _values(driver, [PARAMETER_BY_NAME[name] for name in wanted])
    run.print(values, f"{changes}: {_kept(only_try)}")
    shared.report_unknown_wiring(unknown, run.target.port)


@config.command("save")
@run_options(shared.yes_option)
def save_(run: Run) -> None:
    """Save the parameters in force to the EEPROM.

    Works on boards that do not reset when their port is opened.  An Uno resets, and loses what --try changed.
    """
    with _connected(run) as driver:
        run.confirm(f"Save the parameters in force on robot {driver.board.robot_id}?")
        driver.parameters.save()
    click.echo("saved")


@config.command()
@run_options(shared.yes_option)
def defaults(run: Run) -> None:
    """Save the robot model's values of all parameters but the id.

    \b
    Example:
      mrl config defaults --robot lab3
    """
    with _connected(run) as driver:
        assert driver.model is not None
        robot_id, model = driver.board.robot_id, driver.model
        run.confirm(f"Set all parameters of robot {robot_id} but its id to those of the model {model.name}?")
        unknown = driver.parameters.save_model(robot_id, model)
    click.echo("the defaults are saved")
    shared.report_unknown_wiring(unknown, run.target.port)


@config.command()
@file_argument
@run_options(shared.yes_option)
def dump(run: Run, file: Optional[str]) -> None:
    """Write all parameters to a YAML file, or print them.

    The file also has the board's id and firmware, and the meaning and unit of each parameter.  mrl config load writes
    it back, and mrl config diff compares it with a board.

    \b
    Examples:
      mrl config dump board.yaml --robot lab3
      mrl config dump --port /dev/ttyACM0
    """
    from mrl_driver.driver import parameter_file
    from mrl_driver.files import replace_file

    run.confirm_overwrite(file)
    with _connected(run) as driver:
        found = parameter_file.of_driver(driver)
    if file is None:
        click.echo(parameter_file.text_of(found), nl=False)
        return
    replace_file(file, parameter_file.text_of(found))
    click.echo(f"{file} has {len(found.values)} parameters of robot {found.robot_id}")


@config.command()
@click.argument("file", type=click.Path(dir_okay=False))
@run_options(shared.yes_option)
@try_option
@click.option("--other-robot", is_flag=True, help="Accept the file of another robot or model.")
def load(run: Run, file: str, only_try: bool, other_robot: bool) -> None:
    """Set and save all parameters of a dumped file.

    The whole file is checked before the first parameter is set, and the board afterwards.  The robot id stays: a new
    board first gets it with mrl set-id.  The file must be of this robot, unless --other-robot is given; the board
    then keeps its bridge, pins and wiring, which belong to the cables.

    \b
    Examples:
      mrl config load board.yaml --robot lab3
      mrl config load board.yaml --robot lab4 --other-robot --try
    """
    from mrl_driver.driver import parameter_file

    wanted = parameter_file.read(file)
    with _connected(run) as driver:
        parameter_file.require_kind(wanted, file, driver, other_robot)
        values = parameter_file.values_for(driver.board.robot_id, wanted)
        driver.parameters.require(values)
        old = parameter_file.of_driver(driver).values
        listed = _changes(old, {name: value for name, value in values.items() if value != old[name]})
        if listed:
            run.confirm(f"Change {listed} on robot {driver.board.robot_id}?")
        driver.parameters.replace(values, saved=not only_try)
    left = [name for name in old if name not in values]
    kept = ", ".join([name for name in left if name not in NAMES] + ["pins"] * (NAMES[0] in left))
    if kept:
        shared.print_message(f"the board keeps its own {kept}")
    click.echo(f"{listed or 'no parameter differs'}: {_kept(only_try)}")


@config.command()
@file_argument
@run_options(shared.json_option)
def diff(run: Run, file: Optional[str]) -> None:
    """Compare the parameters with a file or the model.

    The exit code is 1 if a parameter differs, 0 if none does.

    \b
    Examples:
      mrl config diff board.yaml --robot lab3
      mrl config diff --robot lab3               with the robot model
    """
    from mrl_driver.driver import parameter_file
    from mrl_driver.driver.parameters import differing

    wanted = parameter_file.read(file) if file else None
    with _connected(run) as driver:
        found, model = parameter_file.of_driver(driver), driver.model
    if wanted is not None:
        board, expected = ({"robot_id": each.robot_id, **each.values} for each in (found, wanted))
        names: Iterable[str] = (
            row.name for row in PARAMETERS if board.get(row.name) != expected.get(row.name)
        )
    else:
        board, expected = found.values, differing(found.values, model) if model else {}
        names = expected
    differences = [
        {
            "name": name,
            "board": board.get(name),
            "expected": expected.get(name),
            "unit": PARAMETER_BY_NAME[name].unit,
        }
        for name in names
    ]
    run.print(differences, _difference_table(differences, found, file or f"the model {found.model}"))
    if differences:
        sys.exit(1)


def _difference_table(differences: Sequence[Mapping[str, Any]], found: "ParameterFile", name: str) -> str:
    if not differences:
        return f"robot {found.robot_id} has the parameters of {name}"
    lines = [f"{'parameter':<20}{'board':>7} {'expected':>8} {'unit':<9} meaning; expected: {name}"]
    for each in differences:
        board, expected = ("-" if each[key] is None else each[key] for key in ("board", "expected"))
        text = PARAMETER_BY_NAME[each["name"]].text
        lines.append(f"{each['name']:<20}{board:>7} {expected:>8} {each['unit']:<9} {text}".rstrip())
    return "\n".join(lines)


def parse(words: Sequence[str]) -> Dict[str, int]:
    """Return the values of alternating names and values, by name."""
    if len(words) % 2:
        raise ConfigError(
            f"{words[-1]!r} has no value, expected names and values in turn, such as: kp 800 ki 350"
        )
    found: Dict[str, int] = {}
    for name, text in zip(words[::2], words[1::2]):
        row = _row(name)
        if name == "robot_id":
            raise ConfigError("robot_id cannot be set here; use: mrl set-id ID")
        if name in found:
            raise ConfigError(f"{name} is given twice, expected each name once")
        found[name] = _number(row, text)
    return found


def _number(row: Parameter, text: str) -> int:
    from mrl_driver.driver import parameter_file

    try:
        value = BRIDGES.index(text) if row.name == "bridge" and text in BRIDGES else int(text)
    except ValueError:
        value = row.high + 1
    if not row.low <= value <= row.high:
        unit = f" [{row.unit}]" if row.unit else ""
        raise ConfigError(
            f"{row.name} is {text!r}, expected a whole number from {row.low} to {row.high}{unit}"
        )
    if row.name == "radio_hold":
        parameter_file.require_hold(value, row.name)
    return value


def _row(name: str) -> Parameter:
    if name not in PARAMETER_BY_NAME:
        near = difflib.get_close_matches(name, PARAMETER_BY_NAME, 3, 0.5)
        expected = ", ".join(near or PARAMETER_BY_NAME)
        raise ConfigError(f"parameter {name!r} is unknown, expected {expected}")
    return PARAMETER_BY_NAME[name]


@contextlib.contextmanager
def _connected(run: Run) -> Iterator["Driver"]:
    """Connect for the block to a board that keeps its parameters."""
    with run.connected() as driver:
        driver.parameters.require_eeprom()
        yield driver


def _changes(old: Mapping[str, int], wanted: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {old[name]} to {value}" for name, value in wanted.items())


def _kept(only_try: bool) -> str:
    return "in force until the next reset" if only_try else "saved"


def _values(driver: "Driver", rows: Sequence[Parameter]) -> List[Dict[str, Any]]:
    """Return what a board holds, for JSON; the default is that of the model, None if it has none."""
    from mrl_driver.driver.parameters import default_of

    found = driver.parameters.read(*(row.name for row in rows))
    return [
        {
            "name": row.name,
            "value": found[row.name],
            "unit": row.unit,
            "default": default_of(driver.model, row),
            "low": row.low,
            "high": row.high,
        }
        for row in rows
    ]


def _table(values: Sequence[Mapping[str, Any]]) -> str:
    """Return parameters as a table; `*` marks values that differ from the model."""
    lines = [f"{'parameter':<20}{'value':>7} {'unit':<9}{'':<9} meaning"]
    for each in values:
        name, value = each["name"], each["value"]
        mark = f"* {each['default']}" if each["default"] not in (None, value) else ""
        chip = f"{BRIDGES[value]}: " if name == "bridge" else ""
        text = PARAMETER_BY_NAME[name].text
        lines.append(f"{name:<20}{value:>7} {each['unit']:<9}{mark:<9} {chip}{text}".rstrip())
    if any(each["default"] not in (None, each["value"]) for each in values):
        lines.append("* differs from the robot model; its value follows the *")
    return "\n".join(lines)
