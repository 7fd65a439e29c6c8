"""Robots by name: `lab3` instead of a port, a model and a baud rate.

The user's YAML file `path()` holds the names:

    lab3: {port: /dev/serial/by-id/usb-Arduino_8543-if00, model: traxbot, baud: 115200, id: 1}

`port` is required.  Without `model` the board's robot id selects the model; without `baud` the baud rate is 115200.
With `id` a board with another robot id is refused: a port's name may lead to another board tomorrow.  A virtual robot,
which a bare board calculates, is accepted by a name with `virtual: true` alone, and such a name accepts no real one.
"""

import os
import re
from typing import Any, Dict, Mapping, NamedTuple, Optional

from mrl_driver import folders, yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.files import replace_file
from mrl_driver.protocol.table import BAUD, INT16_MAX
from mrl_driver.robot import models
from mrl_driver.yaml_form import Flag, Text, Whole

LOWEST_BAUD, HIGHEST_BAUD = 300, 4_000_000
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
_KEYS = ("port", "model", "baud", "id", "virtual")
_TEXTS = {"port": "a serial port such as /dev/ttyACM0", "model": "auto, a model or a .yaml file"}
_HEADER = "# Robots by name; written by: mrl names add\n"


class Target(NamedTuple):
    """A robot and how to reach it."""

    port: Optional[str]
    model: str = "auto"  # `auto`, a packaged model's name, or the path of a YAML file
    baud: int = BAUD
    name: str = ""  # name in the user's file; empty if it has none
    id: Optional[int] = None  # robot id of its board; None accepts any
    virtual: Optional[bool] = None  # whether a board calculates it; None accepts both


def path() -> str:
    """Return the path of the user's file of names; the file may not exist."""
    return os.path.join(folders.config(), "robots.yaml")


def read() -> Dict[str, Target]:
    """Return all named robots, none without a file; raise ConfigError if it cannot be read, or has an error."""
    file_name = path()
    try:
        data = yaml_file.read(file_name)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ConfigError(f"{file_name} cannot be read: {error.strerror}") from None
    if data is None:
        return {}
    yaml_file.Reader(file_name).mapping("", data, "a mapping of names, each with a port")
    return {require_name(name, f"{file_name}: "): _entry(file_name, name, data[name]) for name in data}


def require_name(name: Any, where: str = "") -> str:
    """Return a valid robot name; raise ConfigError if it is not one, or is already taken by a model."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ConfigError(
            f"{where}name is {name!r}, expected a letter (a to z, A to Z) and up to 31 letters, digits, '-' or '_'"
        )
    if name == "auto" or name in models.names():
        raise ConfigError(f"{where}name {name!r} is a robot model, expected another name, such as {name}1")
    return name


def _entry(file_name: str, name: str, data: Any) -> Target:
    reader = yaml_file.Reader(file_name)
    reader.mapping(name, data, "a mapping with port, and optionally model, baud, id and virtual")
    found = {**Target("", virtual=False)._asdict(), **reader.keys(name, data, _KEYS, _KEYS[1:]), "name": name}
    for key, expected in _TEXTS.items():
        if not Text(expected).read(reader, f"{name}.{key}", found[key]).strip() or "\0" in found[key]:
            raise reader.fail(f"{name}.{key}", found[key], expected)
    if found["id"] is not None:
        Whole(1, INT16_MAX).read(reader, f"{name}.id", found["id"])
    Flag().read(reader, f"{name}.virtual", found["virtual"])
    Whole(LOWEST_BAUD, HIGHEST_BAUD).read(reader, f"{name}.baud", found["baud"])
    return Target(**found)


def write(named: Mapping[str, Target]) -> None:
    """Replace the user's file; ConfigError if its folder cannot be created, OutputError if it cannot be written."""
    import yaml

    file_name = path()
    data = {
        name: {
            key: value for key, value in each._asdict().items() if key in _KEYS and value not in (None, False)
        }
        for name, each in sorted(named.items())
    }
    try:
        os.makedirs(os.path.dirname(file_name), exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{file_name} cannot be written: {error.strerror}") from None
    text = _HEADER + (yaml.safe_dump(data, sort_keys=False) if data else "")
    replace_file(file_name, text)


def target_of(port: str) -> Target:
    """Return the robot that `port` names, else any robot on that port; ConfigError if the file of names is invalid."""
    found = read().get(port) if _NAME.fullmatch(port) else None
    return found if found is not None else Target(port)


def resolve(robot: str, port: Optional[str] = None, baud: Optional[int] = None) -> Target:
    """Return the target for `robot`: `auto`, a model, a YAML file, or a name.  `port` and `baud` take precedence.

    ConfigError if `robot` is unknown, or the file of names is invalid.
    """
    if robot == "auto" or robot.endswith((".yaml", ".yml")) or robot in models.names():
        return Target(port, robot, BAUD if baud is None else baud)
    named = read()
    if robot not in named:
        known = f"a name ({', '.join(sorted(named))})" if named else "a name (there is none yet)"
        raise ConfigError(
            f"robot {robot!r} is unknown, expected {known}, a model ({', '.join(models.names())}) or a .yaml "
            f"file; set a name with: mrl names add {robot} --port PORT"
        )
    found = named[robot]
    return found._replace(port=port or found.port, baud=found.baud if baud is None else baud)
