"""Robot models, and the EEPROM of boards that carry their ids: read once for all tests of a process."""

import math
from functools import lru_cache

from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import models
from sim_arduino.board import parameter_store


@lru_cache(maxsize=None)
def model(name: str) -> models.RobotModel:
    """The model of that name; nobody changes it."""
    return models.load(name)


@lru_cache(maxsize=None)
def eeprom(robot_id: int) -> bytes:
    """The image that a board has saved which was told nothing but its id."""
    return parameter_store.image(parameter_store.defaults(robot_id))


def bridged(bridge: str = "tb6612", **board: int) -> models.RobotModel:
    """A kit with two wheels of 65 mm on this bridge, 1496 counts a turn and 170 turns a minute."""
    base = model("stingbot")
    numbers = {"gearbox": 340, "encoder_counts": 440, "full_speed": 170, "battery_divider": 4000}
    return base._replace(
        drive=base.differential._replace(metres_per_count=math.pi * 0.065 / 1496.0),
        board={**base.board, **numbers, "bridge": BRIDGES.index(bridge), **board},
    )
