"""Robot models, and the EEPROM of boards that carry their ids: read once for all tests of a process."""

from functools import lru_cache

from mrl_driver.protocol.table import BRIDGES
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


def bridged(bridge: str = "tb6612", **board: int) -> models.RobotModel:
    """A duo with this bridge, a divider of 4 at A3, and these other numbers of its board."""
    base = model("duo")
    return base._replace(
        board={**base.board, "battery_divider": 4000, "bridge": BRIDGES.index(bridge), **board}
    )
