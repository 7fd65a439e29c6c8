"""`mrl set-id`: set a board's robot id."""

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.host.named_robots import Target
from mrl_driver.robot import models

from .shared import confirm, connected, report_unknown_wiring, robot_options, yes_option


@click.command("set-id")
@robot_options
@click.argument("robot_id", type=click.IntRange(1, 32767))
@yes_option
def set_id(target: Target, robot_id: int, yes: bool) -> None:
    """Set a board's robot id.

    Sets the default parameters of that robot too, and saves both in the EEPROM.

    \b
    Example:
      mrl set-id 1 --port /dev/ttyACM0          TraxBot 1-3, StingBot 4-5, Pioneer 6-10
    """
    name = target.model if target.model != "auto" else models.by_id(robot_id)
    if not name:
        raise ConfigError(f"no packaged model lists robot id {robot_id}; give a model file with --robot")
    model = models.load(name)
    if robot_id not in model.ids:
        raise ConfigError(
            f"robot id {robot_id} is not an id of {model.name}, expected {', '.join(map(str, model.ids))}"
        )
    with connected(target, model, ignore_battery=True, any_id=True, identify=True) as driver:
        there = driver.board.robot_id
        if there:
            confirm(f"The board is robot {there}. Store id {robot_id} and parameters of {model.name}?", yes)
        unknown = driver.parameters.save_model(robot_id, model)
    if target.name:
        named = named_robots.read()
        named_robots.write({**named, target.name: named[target.name]._replace(id=robot_id)})
    click.echo(f"robot id {robot_id} is set")
    report_unknown_wiring(unknown, target.port)
