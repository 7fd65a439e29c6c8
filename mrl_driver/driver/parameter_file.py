"""The parameters of a board as a YAML file: what `mrl config dump` writes, and `load` and `diff` read."""

import datetime
import json
from typing import Any, Dict, List, NamedTuple, Tuple

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.navigation.radio_holder import FRESH_S
from mrl_driver.protocol.table import (
    BRIDGES,
    INT16_MAX,
    PARAMETER_BY_NAME,
    PARAMETERS,
    PINS,
    PINS_328P,
    Parameter,
)
from mrl_driver.yaml_file import Reader
from mrl_driver.yaml_form import Text, Whole

from .driver import Driver
from .parameters import CABLES, MOTORS

LEAST_HOLD = round(FRESH_S / 0.1)
"""Smallest `radio_hold` but 0: below it, a board's host may release it while its holder still counts it as held."""
SETTABLE: Tuple[Parameter, ...] = tuple(row for row in PARAMETERS if row.name != "robot_id")
"""All parameters but the robot id, which `mrl set-id` sets."""


class ParameterFile(NamedTuple):
    """The content of a file."""

    robot_id: int
    model: str  # name of the robot's model
    firmware: int
    protocol: int
    capabilities: Tuple[str, ...]  # of the board, sorted
    values: Dict[str, int]  # parameters but the id, by name, in units of the table


def of_driver(driver: Driver) -> ParameterFile:
    """Return the parameters in force of a connected board; raise BoardTimeout if it does not reply."""
    board, model = driver.board, driver.model
    used = [row.name for row in driver.parameters.rows if row in SETTABLE]
    return ParameterFile(
        board.robot_id,
        model.name if model else "unknown",
        board.version,
        board.protocol,
        tuple(sorted(board.capabilities)),
        driver.parameters.read(*used),
    )


def require_kind(file: ParameterFile, path: str, driver: Driver, other_robot: bool = False) -> None:
    """Check that the parameters of a file are for this board; `other_robot` accepts those of another robot or model.

    Raises:
        ConfigError: they are not; or they are for other motors, where the same numbers mean something else.
    """
    board = driver.board
    theirs, ours = (MOTORS["bridge" in each.capabilities] for each in (file, board))
    if theirs != ours:
        raise ConfigError(
            f"{path} is of a board with {theirs}, but this board has {ours}: the same numbers mean other things there"
        )
    name = driver.model.name if driver.model else "unknown"
    if (file.robot_id, file.model) != (board.robot_id, name) and not other_robot:
        raise ConfigError(
            f"{path} is of robot {file.robot_id} ({file.model}), but this is robot {board.robot_id} ({name}); give "
            "--other-robot to load it all the same"
        )


def values_for(robot_id: int, file: ParameterFile) -> Dict[str, int]:
    """Return the parameters of a file for a board with this id: cables are those of the file's own robot alone."""
    others = CABLES if robot_id != file.robot_id else ()
    return {name: value for name, value in file.values.items() if name not in others}


def require_hold(value: int, place: str) -> None:
    """Check a value of `radio_hold` in the range of its row; `place` begins the error.

    Raises:
        ConfigError: a holder of this board could count it as held too long.
    """
    if 0 < value < LEAST_HOLD:
        row = PARAMETER_BY_NAME["radio_hold"]
        raise ConfigError(
            f"{place} is {value}, expected 0 or {LEAST_HOLD} to {row.high} [{row.unit}]: "
            f"a holder counts an answer for {FRESH_S:g} s"
        )


def _value(reader: Reader, row: Parameter, value: Any) -> int:
    """Return a parameter's value; a bridge may have the name of its chip."""
    key = f"parameters.{row.name}"
    if row.name == "bridge" and isinstance(value, str):
        if value not in BRIDGES:
            raise reader.fail(key, value, ", ".join(BRIDGES))
        return BRIDGES.index(value)
    number: int = Whole(row.low, row.high).read(reader, key, value)
    if row.name == "radio_hold":
        require_hold(number, f"{reader.path}: {key}")
    return number


def parse(data: Any, path: str) -> ParameterFile:
    """Return the file that parsed YAML describes; raise ConfigError, with `path`, if a key is wrong or missing."""
    reader = Reader(path)
    found = reader.keys("", data, ParameterFile._fields[:-1] + ("parameters",))
    capabilities = found["capabilities"]
    if not isinstance(capabilities, list):
        raise reader.fail("capabilities", capabilities, "a list of names")
    names = tuple(Text().read(reader, "capabilities", each) for each in capabilities)
    others = [row.name for row in SETTABLE if row.capability not in ("", *names) or row in PINS[PINS_328P:]]
    values = reader.keys("parameters", found["parameters"], [row.name for row in SETTABLE], others)
    robot_id, firmware, protocol = (
        Whole(0, INT16_MAX).read(reader, key, found[key]) for key in ("robot_id", "firmware", "protocol")
    )
    return ParameterFile(
        robot_id,
        Text().read(reader, "model", found["model"]),
        firmware,
        protocol,
        names,
        {row.name: _value(reader, row, values[row.name]) for row in SETTABLE if row.name in values},
    )


def read(path: str) -> ParameterFile:
    """Return the content of a file; raise ConfigError if it cannot be opened or is not YAML, or as `parse`."""
    return parse(yaml_file.read_expected(path, "a file of mrl config dump"), path)


def text_of(file: ParameterFile) -> str:
    """Return the text of a file, with unit and meaning of each parameter."""
    moment = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    lines = [
        f"# Parameters of robot {file.robot_id}, by mrl config dump at {moment}; for mrl config load and diff.",
        f"robot_id: {file.robot_id}",
        f"model: {json.dumps(file.model, ensure_ascii=False)}",  # quoted: a name may look like a number
        f"firmware: {file.firmware}",
        f"protocol: {file.protocol}",
        f"capabilities: [{', '.join(file.capabilities)}]",
        "parameters:",
    ]
    return "\n".join([*lines, *_rows(file.values)]) + "\n"


def _rows(values: Dict[str, int]) -> List[str]:
    rows = []
    for row in SETTABLE:
        if row.name in values:
            value = BRIDGES[values[row.name]] if row.name == "bridge" else str(values[row.name])
            unit = f"[{row.unit}] " if row.unit else ""
            rows.append(f"  {row.name + ': ':<21}{value:<8} # {unit}{row.text}")
    return rows
