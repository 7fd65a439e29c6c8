"""`mrl plot`: draw a recording."""

import os
from typing import Optional, Tuple

import click

from mrl_driver.cli.commands.shared import json_option, print_json, print_message

from .command import read_drive, robot_option


@click.command(short_help="Draw a recording: path, speeds, ranges, sensors, battery.")
@click.argument("file", type=click.Path())
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    metavar="PICTURE",
    help="Picture to write: PNG, PDF or SVG.  [default: FILE.png]",
)
@click.option(
    "--part",
    "parts",
    multiple=True,
    type=click.Choice(["path", "speeds", "ranges", "sensors", "battery"]),
    help="Draw only this part; may be repeated.  [default: all]",
)
@robot_option
@json_option
def plot(file: str, output: Optional[str], parts: Tuple[str, ...], robot: str, as_json: bool) -> None:
    """Draw a recording: path, commanded and measured speeds, ranges, other sensors, battery.

    \b
    Examples:
      mrl plot drive.mrl
      mrl plot drive.mrl --part path -o path.svg
    """
    from mrl_driver import figures
    from mrl_driver.apps.review import drive_plot

    picture = output or f"{os.path.splitext(file)[0]}.png"
    figures.require_writable(picture, "picture")
    recorded, drive = read_drive(file, robot)
    drawn = parts or drive_plot.PARTS
    drive_plot.draw(drive, picture, drawn)
    known = drive.board is not None and drive.board.capabilities
    if drive.ranges and not known and {"path", "ranges"} & set(drawn):
        print_message(
            f"warning: {file} does not say whether the board has sonars; if it has environment sensors, the ranges "
            "are false: give --robot a model file with build: environment"
        )
    if as_json:
        end = float(drive.poses.time_s[-1]), *drive.poses.values[-1].tolist()
        print_json(
            {
                "picture": picture,
                "robot": drive.model.name,
                "path_m": round(drive.path_length_m, 3),
                "end": dict(zip(("time_s", "x_m", "y_m", "yaw_rad"), end)),
                "skipped_lines": drive.skipped_lines,
            }
        )
        return
    click.echo(picture)
    for number, reason in recorded.recording.skipped.items():
        click.echo(f"{file}:{number}: skipped: {reason}", err=True)
