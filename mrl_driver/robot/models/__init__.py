"""Robot models: one YAML file each, in this folder, in the user's own folder, or anywhere by path.

A model holds geometry, limits, sonar poses, default board parameters, and the robot ids that it accepts.  The files
name the sources of the numbers.
"""

import logging
import os
from functools import lru_cache
from typing import Any, Dict, List, Optional

from mrl_driver import folders, yaml_file
from mrl_driver.errors import ConfigError, shortages
from mrl_driver.protocol.table import PARAMETERS

from .drives import Drive, MecanumDrive, OmniDrive, kind_of
from .range_sensors import (
    ANALOG,
    CHAIN_S,
    ECHO_INPUTS,
    HC_SR04,
    MB1300,
    RANGE_KINDS,
    RangeKind,
    SonarMount,
    cycle_s,
    echo_cycle_s,
)
from .robot_file import RobotFile
from .robot_model import (
    BOARD_KEYS,
    BUILDS,
    COMMON_BOARD,
    CONTROLLED,
    CURVE_KEYS,
    ENVIRONMENT,
    OF_CONTROL,
    ON_TRACKS,
    ON_WHEELS,
    SENSOR_BOARD_IDS,
    SONAR,
    Battery,
    Body,
    ImuMount,
    LaserMount,
    Limits,
    Noise,
    RobotModel,
    ServoMount,
    beyond_control,
    full_speeds,
    has_environment,
    require_supported,
    with_build,
)

_FOLDER = os.path.dirname(os.path.abspath(__file__))
SCHEMA = os.path.join(_FOLDER, "robot.schema.json")
"""Path of the JSON Schema of a robot's file; rendered by `make generate`."""


def packaged() -> List[str]:
    """Return the names of the models that come with the package."""
    return _names_in(_FOLDER)


def own_folder() -> str:
    """Return the folder for the user's own models, one YAML file each; it may not exist."""
    return os.path.join(folders.config(), "robots")


def names() -> List[str]:
    """Return the names of all models: the packaged ones and the user's own."""
    return sorted({*packaged(), *_names_in(own_folder())})


def _names_in(folder: str) -> List[str]:
    try:
        with shortages(f"{folder} cannot be read", ConfigError):
            return sorted(f[:-5] for f in os.listdir(folder) if f.endswith(".yaml"))
    except OSError:
        return []


def path_of(name_or_path: str) -> str:
    """Return the path of the user's own file with this name, otherwise of the packaged one; a path as it is."""
    if name_or_path.endswith((".yaml", ".yml")):
        return name_or_path
    own = os.path.join(own_folder(), f"{name_or_path}.yaml")
    return own if os.path.isfile(own) else os.path.join(_FOLDER, f"{name_or_path}.yaml")


def is_packaged(path: str) -> bool:
    """Return whether the file with this path belongs to the package."""
    return os.path.dirname(path) == _FOLDER


def is_virtual(model: RobotModel) -> Optional[bool]:
    """Return whether this is the model of a virtual robot, or of a real one; None if both may have it.

    Both may have a packaged one with an H-bridge, unchanged.  The model of a user's file is that of a real robot unless
    it says otherwise.
    """
    shared = model.name in packaged() and model == load_packaged(model.name) and model.board.get("bridge")
    return None if shared else model.virtual


def load(name_or_path: str) -> RobotModel:
    """Return the model with this name, or from this YAML file.  The user's own model hides a packaged one of the same
    name.  ConfigError if there is no such model, or a key is missing, unknown, of the wrong type or out of range.
    """
    path = path_of(name_or_path)
    try:
        return _packaged(path) if is_packaged(path) else parse(yaml_file.read(path), path)
    except OSError as error:
        why = f": {error.strerror}" if path == name_or_path else " is unknown"
        raise ConfigError(
            f"robot {name_or_path!r}{why}, expected {', '.join(names())} "
            f"or the path of a .yaml file; files in {own_folder()} are known by name"
        ) from None


@lru_cache(maxsize=None)
def _packaged(path: str) -> RobotModel:
    """Return the model in a file of the package.  It is read once: a greeting asks each model for its ids."""
    return parse(yaml_file.read(path), path)


def parse(data: Any, path: str) -> RobotModel:
    """Return the model that parsed YAML describes; raise ConfigError, with `path`, if a key is wrong or missing."""
    return RobotFile().read(yaml_file.Reader(path), "", data)


def by_id(robot_id: int) -> str:
    """Return the name of the model that lists `robot_id`, the user's own first; empty if none does.

    An invalid file in the user's folder is logged and skipped; it raises ConfigError if it has the name of the packaged
    model that lists the id.  So do two files there that list it.
    """
    own = _names_in(own_folder())
    found = [name for name in own if _lists(name, robot_id)]
    if len(found) > 1:
        raise ConfigError(
            f"robot id {robot_id} is listed by the models {' and '.join(found)}, expected one: change ids in "
            f"{own_folder()}, or name the robot with --robot"
        )
    ordered = (*found, *(name for name in packaged() if name not in own and _lists(name, robot_id)))
    return next(iter(ordered), "")


def _lists(name: str, robot_id: int) -> bool:
    try:
        return robot_id in load(name).ids
    except ConfigError as error:
        if name in packaged() and robot_id in load_packaged(name).ids:
            raise
        _log_once(f"robot model ignored: {error}")
        return False


@lru_cache(maxsize=None)
def _log_once(text: str) -> None:
    logging.getLogger(__name__).warning(text)


def load_packaged(name: str) -> RobotModel:
    """Return the packaged model with this name and ignore the user's own: the firmware knows only packaged ones."""
    return load(os.path.join(_FOLDER, f"{name}.yaml"))


def driven_models() -> List[RobotModel]:
    """Return the packaged models with motors, sorted by id.  A board with another id uses the defaults of the first."""
    found = [load_packaged(name) for name in packaged()]
    return sorted((model for model in found if model.drives), key=lambda model: min(model.ids))


def firmware_defaults(model: RobotModel) -> Dict[str, int]:
    """Return the defaults that the firmware has for the ids of one of `driven_models`: all parameters but the id.

    The others of `model.board`, such as its bridge, reach a board only over the wire: by `mrl set-id`.
    """
    own = {row.name: model.board[row.name] for row in PARAMETERS if row.number in BOARD_KEYS}
    return {**COMMON_BOARD, **own}
