"""`mrl set-id`: set a board's robot id."""

from typing import TYPE_CHECKING

import click

from mrl_driver.errors import BoardRefused, ConfigError
from mrl_driver.host.named_robots import Target
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot import models

from .shared import confirm, connected, robot_options, yes_option

if TYPE_CHECKING:
    from mrl_driver.driver import Driver
    from mrl_driver.robot.models import RobotModel


@click.command("set-id")
@robot_options
@click.argument("robot_id", type=click.IntRange(1, 32767))
@yes_option
def set_id(target: Target, robot_id: int, yes: bool) -> None:
    """Set a board's robot id.

    Sets the default parameters of that robot too, and saves both in the EEPROM.

    \b
    Example:
      mrl set-id 1 --port /dev/ttyACM0          TraxBot 1-3, StingBot 4-5
    """
    model = models.load(
        target.model if target.model != "auto" else models.by_id(robot_id) or _no_model(robot_id)
    )
    if robot_id not in model.ids:
        raise ConfigError(
            f"robot id {robot_id} is not an id of {model.name}, expected {', '.join(map(str, model.ids))}"
        )
    with connected(target, model, ignore_battery=True, any_id=True) as driver:
        confirm(f"Change the robot id from {driver.board.robot_id} to {robot_id}?", yes)
        write_parameters(driver, robot_id, model)
    click.echo(f"robot id {robot_id} is set")


def _no_model(robot_id: int) -> str:
    raise ConfigError(f"no packaged model lists robot id {robot_id}; give a model file with --robot")


def require_config(driver: "Driver") -> None:
    """Raise BoardRefused unless the board keeps a configuration."""
    if "config" not in driver.board.capabilities:
        raise BoardRefused(
            "board firmware 1 (2013) cannot store parameters or an id; upload the current firmware with: mrl flash"
        )


def save(driver: "Driver") -> None:
    """Write the board's parameters to its EEPROM.

    Raises:
        BoardRefused: the board could not save them.
        BoardTimeout: the board does not answer.
    """
    if driver.ask(BY_NAME["save_config"].code, timeout_s=2.0) != (1,):
        raise BoardRefused("the board could not write its EEPROM; try again")


def write_parameters(driver: "Driver", robot_id: int, model: "RobotModel") -> None:
    """Write the id and the model's parameters (the firmware may not know this model), and save all.

    Raises:
        BoardRefused: the board keeps no configuration, or refused a value.
        BoardTimeout: the board does not answer.
    """
    require_config(driver)
    _write(driver, "robot_id", robot_id)
    if driver.ask(BY_NAME["default_config"].code) != (1,):
        raise BoardRefused("the board refused to set its defaults; try again")
    for name, value in model.board.items():
        _write(driver, name, value)
    save(driver)
    for name, value in {"robot_id": robot_id, **model.board}.items():
        _require(driver, name, value)


def _write(driver: "Driver", name: str, value: int) -> None:
    index = PARAMETER_BY_NAME[name].number
    if driver.ask(BY_NAME["write_config"].code, index, value) != (index, value):
        raise BoardRefused(f"the board refused {name} {value}")


def _require(driver: "Driver", name: str, value: int) -> None:
    """Check that the board has the value: it loses the value if it restarts before saving.

    Raises:
        BoardRefused: the board has another value.
    """
    index = PARAMETER_BY_NAME[name].number
    answer = driver.ask(BY_NAME["read_config"].code, index)
    if answer != (index, value):
        raise BoardRefused(
            f"the board has {name} {answer[-1]}, expected {value}: it restarted before saving; try again"
        )
