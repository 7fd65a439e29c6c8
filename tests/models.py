"""Robot models, and the EEPROM of boards that carry their ids: read once for all tests of a process."""

from functools import lru_cache
from typing import Mapping

from mrl_driver.protocol.table import BRIDGES, PARAMETERS, SETTINGS
from mrl_driver.robot import models, wiring
from sim_arduino.board import parameter_store


@lru_cache(maxsize=None)
def model(name: str) -> models.RobotModel:
    """The model of that name; nobody changes it."""
    return models.load(name)


@lru_cache(maxsize=None)
def eeprom(robot_id: int) -> bytes:
    """The image that a board has saved which was told nothing but its id."""
    return parameter_store.image(parameter_store.defaults(robot_id))


ENCODER_PINS = wiring.encoder_pins(model("duo").board)
"""Pins of a duo's encoders."""
DUO_PINS = {name: model("duo").board[name] for name in wiring.NAMES}
"""The wiring of a duo, by the names of its parameters."""


def wired_eeprom(robot_id: int = 1, pins: Mapping[str, int] = DUO_PINS, **settings: int) -> bytes:
    """The image of an H-bridge board that knows its id, its wiring and some settings; other pins are not connected."""
    values = dict(zip((row.name for row in SETTINGS), parameter_store.defaults(robot_id)))
    values.update({**wiring.EMPTY, **pins, **settings})
    return parameter_store.image([values[row.name] for row in PARAMETERS])


def bridged(bridge: str = "tb6612", **board: int) -> models.RobotModel:
    """A duo with this bridge, a divider of 4 at A3, and these other numbers of its board."""
    base = model("duo")
    return base._replace(
        board={**base.board, "battery_divider": 4000, "bridge": BRIDGES.index(bridge), **board}
    )
