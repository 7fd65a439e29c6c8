"""The parameters of a board as a YAML file: what `mrl config dump` writes, and `load` and `diff` read."""

import datetime
import json
from typing import Any, Dict, List, NamedTuple, Tuple

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.navigation.radio_holder import FRESH_S
from mrl_driver.protocol.table import BRIDGES, INT16_MAX, PARAMETER_BY_NAME, PARAMETERS, Parameter
from mrl_driver.yaml_file import Reader
from mrl_driver.yaml_form import Form, Keys, Text, Whole

from .driver import Driver
from .parameters import CABLES

LEAST_HOLD = round(FRESH_S / 0.1)
"""Smallest `radio_hold` but 0: below it, a board's host may release it while its holder still counts it as held."""
SETTABLE: Tuple[Parameter, ...] = tuple(row for row in PARAMETERS if row.name != "robot_id")
"""All parameters but the robot id, which `mrl set-id` sets."""


_MOTORS = {True: "an H-bridge", False: "a motor board"}


class ParameterFile(NamedTuple):
    """The content of a file."""

    robot_id: int
    model: str  # name of the robot's model
    firmware: int
    protocol: int
    capabilities: Tuple[str, ...]  # of the board, sorted
    values: Dict[str, int]  # parameters but the id, by name, in units of the table


def of_driver(driver: Driver) -> ParameterFile:
    """Return the parameters in force of a connected board.

    Raises:
        BoardTimeout: the board does not reply.
    """
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
    theirs, ours = (_MOTORS["bridge" in each.capabilities] for each in (file, board))
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


class _Bridge(Form):
    """A bridge by the name of its chip, or by its number."""

    def read(self, reader: Reader, key: str, value: Any) -> int:
        if isinstance(value, str) and value in BRIDGES:
            return BRIDGES.index(value)
        if isinstance(value, str):
            raise reader.fail(key, value, ", ".join(BRIDGES))
        return reader.whole(key, value, 0, len(BRIDGES) - 1)


class _Hold(Whole):
    """The time after which a holder counts as silent."""

    def read(self, reader: Reader, key: str, value: Any) -> int:
        found = super().read(reader, key, value)
        require_hold(found, f"{reader.path}: {key}")
        return found


class _Names(Form):
    """A list of names."""

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[str, ...]:
        if not isinstance(value, list):
            raise reader.fail(key, value, "a list of names")
        return tuple(Text().read(reader, key, each) for each in value)


def _form(row: Parameter) -> Form:
    if row.name == "bridge":
        return _Bridge()
    return (_Hold if row.name == "radio_hold" else Whole)(row.low, row.high)


def parse(data: Any, path: str) -> ParameterFile:
    """Return the file described by parsed YAML; `path` names it in errors.

    Raises:
        ConfigError: a key is missing, unknown, of the wrong type or out of range.
    """
    reader, number = Reader(path), Whole(0, INT16_MAX)
    forms: Dict[str, Form] = {
        "robot_id": number,
        "model": Text(),
        "firmware": number,
        "protocol": number,
        "capabilities": _Names(),
    }
    known = (*forms, "parameters")
    found = reader.keys("", data, known)
    head = Keys(forms).read(reader, "", {name: found[name] for name in forms})
    others = [row.name for row in SETTABLE if row.capability not in ("", *head["capabilities"])]
    parameters = Keys({row.name: _form(row) for row in SETTABLE}, others)
    return ParameterFile(**head, values=parameters.read(reader, "parameters", found["parameters"]))


def read(path: str) -> ParameterFile:
    """Return the content of a file.

    Raises:
        ConfigError: it cannot be opened or is not YAML, or as `parse`.
    """
    return parse(yaml_file.read_expected(path, "a file of mrl config dump"), path)


def text_of(file: ParameterFile) -> str:
    """Return the text of a file, with unit and meaning of each parameter."""
    moment = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    lines = [
        f"# Parameters of robot {file.robot_id}, by mrl config dump at {moment}; for mrl config load and diff.",
        f"robot_id: {file.robot_id}",
        f"model: {_quoted(file.model)}",
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
            rows.append(f"  {row.name + ':':<17}{value:<8} # {unit}{row.text}")
    return rows


def _quoted(name: str) -> str:
    """Return a text as YAML reads it back, in double quotes: a name may look like a number."""
    return json.dumps(name, ensure_ascii=False)
