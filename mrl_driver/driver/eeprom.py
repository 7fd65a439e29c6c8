"""Reads, sets and saves the parameters of a board: those in force, and those in its EEPROM."""

import contextlib
from typing import Dict, Iterable, Mapping, Optional, Tuple

from mrl_driver.errors import BoardError, BoardRefused, MrlError
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, PARAMETERS, Parameter
from mrl_driver.robot.models import COMMON_BOARD, RobotModel

from .driver import Driver

_READ, _WRITE, _SAVE, _DEFAULTS = (
    BY_NAME[name].code for name in ("read_config", "write_config", "save_config", "default_config")
)

CABLES = ("bridge", "wiring")
"""Parameters that describe the cables of one robot; `mrl calibrate wiring` sets them."""


def default_of(model: Optional[RobotModel], row: Parameter) -> Optional[int]:
    """Return a robot model's value of a parameter; the wiring belongs to the robot, unless its own file has it."""
    own = model.board if model is not None else {}
    if row.name == "wiring":
        return own.get(row.name)
    return own.get(row.name, COMMON_BOARD.get(row.name))


def differing(values: Mapping[str, int], model: RobotModel) -> Dict[str, int]:
    """Return the model's values of the parameters, by name, that differ from these values of a board."""
    defaults = {name: default_of(model, PARAMETER_BY_NAME[name]) for name in values}
    return {name: value for name, value in defaults.items() if value is not None and value != values[name]}


def can_configure(driver: Driver) -> bool:
    """Return whether the board stores a configuration; boards of 2013 do not."""
    return "config" in driver.board.capabilities


def require_config(driver: Driver) -> None:
    """Raise BoardRefused unless the board stores a configuration."""
    if not can_configure(driver):
        raise BoardRefused(
            "board firmware 1 (2013) cannot store parameters or an id; upload the current firmware with: mrl flash"
        )


def parameters(driver: Driver) -> Tuple[Parameter, ...]:
    """Return the parameters that the board uses; earlier firmware refuses the numbers of all others."""
    return tuple(row for row in PARAMETERS if row.capability in ("", *driver.board.capabilities))


def require_parameters(driver: Driver, names: Iterable[str]) -> None:
    """Raise BoardRefused unless the board uses all parameters of these names."""
    used = {row.name for row in parameters(driver)}
    for name in names:
        if name not in used:
            raise BoardRefused(
                f"the board has no parameter {name}, expected firmware with the capability "
                f"{PARAMETER_BY_NAME[name].capability}: upload it with: mrl flash"
            )


def read(driver: Driver, *names: str) -> Dict[str, int]:
    """Return the parameters in force, in units of the table.

    Raises:
        BoardRefused: the board does not have one of them.
        BoardTimeout: the board does not reply.
    """
    require_parameters(driver, names)
    return {name: driver.ask(_READ, PARAMETER_BY_NAME[name].number)[1] for name in names}


def write(driver: Driver, values: Mapping[str, int]) -> None:
    """Set parameters until the board restarts.

    Raises:
        BoardRefused: the board stores no configuration, does not have a parameter, or refused a value.
        BoardTimeout: the board does not reply.
    """
    require_config(driver)
    require_parameters(driver, values)
    for name, value in values.items():
        number = PARAMETER_BY_NAME[name].number
        if driver.ask(_WRITE, number, value) != (number, value):
            raise BoardRefused(f"the board refused {name} {value}; nothing was saved")


def save(driver: Driver) -> None:
    """Save the parameters in force to the EEPROM.

    Raises:
        BoardRefused: the board could not save them.
        BoardTimeout: the board does not reply.
    """
    if driver.ask(_SAVE, timeout_s=2.0) != (1,):
        raise BoardRefused("the board could not write its EEPROM; try again")


def save_model(driver: Driver, robot_id: int, model: RobotModel) -> None:
    """Save the id and the model's parameters (the firmware may not know this model), and check them.

    A board with an H-bridge keeps its bridge and wiring, unless the model sets them: they belong to its cables.

    Raises:
        BoardRefused: the board stores no configuration, does not have a parameter, refused a value, or restarted
            before saving.
        BoardTimeout: the board does not reply.
    """
    require_config(driver)
    require_parameters(driver, model.board)
    kept = read(driver, *CABLES) if "bridge" in driver.board.capabilities else {}
    values = {"robot_id": robot_id, **kept, **model.board}
    write(driver, {"robot_id": robot_id})
    if driver.ask(_DEFAULTS) != (1,):
        raise BoardRefused("the board refused to set its defaults; try again")
    write(driver, {name: value for name, value in values.items() if name != "robot_id"})
    save(driver)
    _require_values(driver, values)


def replace(driver: Driver, values: Mapping[str, int], saved: bool = True) -> None:
    """Set parameters, save them unless `saved` is False, and check them.  After a refusal the old ones are in force.

    Raises:
        BoardRefused: the board stores no configuration, does not have a parameter, refused a value, or restarted
            before saving.
        BoardTimeout: the board does not reply.
    """
    require_config(driver)
    old = read(driver, *values)
    try:
        write(driver, {name: value for name, value in values.items() if value != old[name]})
    except BoardError:
        with contextlib.suppress(MrlError):
            write(driver, old)
        raise
    if saved:
        save(driver)
    _require_values(driver, values)


def _require_values(driver: Driver, values: Mapping[str, int]) -> None:
    for name, found in read(driver, *values).items():
        if found != values[name]:
            raise BoardRefused(
                f"the board has {name} {found}, expected {values[name]}: it restarted before saving; try again"
            )
