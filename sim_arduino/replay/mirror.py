"""`mrl mirror`: a real robot appears in a shared world at its odometry pose, where emulated robots meet it.

The poses are JSON lines `{"x_m": 0.1, "y_m": 0.0, "yaw_rad": 0.0}`, or such an object under the key `pose`.
"""

import json
import math
import sys
from contextlib import closing
from typing import Iterable, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.mirror import Mirror
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World


def follow(mirror: Mirror, lines: Iterable[str]) -> None:
    """Moves a mirror as JSON lines come; raises ConfigError if a line is not a pose; the message has its number."""
    for number, line in enumerate(lines, 1):
        if line.strip():
            mirror.moved(*_pose(number, line))


def _pose(number: int, line: str) -> Tuple[float, float, float]:
    from sim_arduino.world.world_file import FAR_M

    try:
        row = json.loads(line)
        pose = row.get("pose", row)
        x, y, yaw = (float(pose[key]) for key in Pose._fields)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        x = y = yaw = math.nan
    if not (abs(x) <= FAR_M and abs(y) <= FAR_M and abs(yaw) <= 1e6):
        raise ConfigError(
            f"line {number} is {line.strip()[:80]!r}, expected JSON with {', '.join(Pose._fields)} "
            f"within {FAR_M:g} m"
        )
    return x, y, yaw


@click.command("mirror", short_help="Place a real robot in the world of emulated ones.")
@click.option("--world-name", required=True, metavar="NAME", help="Name of the shared world.")
@click.option("--name", required=True, help="Name of the robot in that world.")
@click.option("--robot", default="traxbot", metavar="NAME|FILE", show_default=True, help="Robot model.")
@click.option(
    "--pose", metavar="X,Y,YAW", help="Start pose of its odometry in the world, in metres and degrees."
)
def main(world_name: str, name: str, robot: str, pose: str) -> None:
    """Place a real robot in the world of emulated ones.

    Reads the poses of the robot as JSON lines from stdin, as mrl monitor --json prints them.

    \b
    Example:
      mrl monitor --robot lab3 --json | mrl mirror --world-name lab1 --name lab3 --pose 1,0.5,90
    """
    from sim_arduino.world.world_file import parse_pose

    model = models.load(robot)
    model.require_motors()
    footprint = footprint_for(model)
    assert footprint
    world = World()
    world.registry = SharedRegistry(world_name)
    with closing(Mirror(world, name, footprint, parse_pose(pose, ORIGIN))) as mirror:
        mirror.moved(*ORIGIN)
        follow(mirror, sys.stdin)
