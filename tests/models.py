"""Robot models, and the EEPROM of boards that carry their ids: read once for all tests of a process."""

from functools import lru_cache

from mrl_driver import robots
from sim_arduino import config_store


@lru_cache(maxsize=None)
def model(name: str) -> robots.RobotModel:
    """The model of that name; nobody changes it."""
    return robots.load(name)


@lru_cache(maxsize=None)
def eeprom(robot_id: int) -> bytes:
    """The image that a board has saved which was told nothing but its id."""
    return config_store.image(config_store.defaults(robot_id))
