"""Reads, sets and saves the parameters of the board."""

from typing import Dict, Mapping, Protocol, Tuple

from mrl_driver.errors import BoardRefused
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.session.handshake import Board

_READ, _WRITE, _SAVE = (BY_NAME[name].code for name in ("read_config", "write_config", "save_config"))


class Configurable(Protocol):
    """The part of a driver that this module needs."""

    @property
    def board(self) -> Board: ...  # noqa: D102
    def ask(self, code: int, *args: int, timeout_s: float = ...) -> Tuple[int, ...]: ...  # noqa: D102


def can_configure(robot: Configurable) -> bool:
    """Whether the board stores a configuration; boards of 2013 do not."""
    return "config" in robot.board.capabilities


def read(robot: Configurable, *names: str) -> Dict[str, int]:
    """Parameters in force, in units of the table.

    Raises:
        BoardTimeout: the board does not reply.
    """
    return {name: robot.ask(_READ, PARAMETER_BY_NAME[name].number)[1] for name in names}


def write(robot: Configurable, values: Mapping[str, int]) -> None:
    """Set parameters until the board restarts.

    Raises:
        BoardRefused: the board stores no configuration, or refused a value.
        BoardTimeout: the board does not reply.
    """
    if not can_configure(robot):
        raise BoardRefused(
            "board firmware 1 (2013) cannot store parameters; only the robot's YAML file was written; see mrl flash"
        )
    for name, value in values.items():
        number = PARAMETER_BY_NAME[name].number
        if robot.ask(_WRITE, number, value) != (number, value):
            raise BoardRefused(f"the board refused {name} {value}")


def save(robot: Configurable) -> None:
    """Save the parameters in force to the EEPROM.

    Raises:
        BoardRefused: the board could not save them.
        BoardTimeout: the board does not reply.
    """
    if robot.ask(_SAVE, timeout_s=2.0) != (1,):
        raise BoardRefused("the board could not write its EEPROM; try again")
