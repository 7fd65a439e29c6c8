"""`mrl plot`: draw a recording."""

import os
from typing import Optional, Tuple

import click

from mrl_driver.cli.commands.progress import progress
from mrl_driver.cli.commands.shared import complete_robot, json_option, print_json, print_message
from mrl_driver.host.named_robots import resolve


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
@click.option(
    "--robot",
    metavar="ROBOT",
    default="auto",
    shell_complete=complete_robot,
    help="Robot model; by default the one that lists the recorded board's id.",
)
@json_option
def plot(file: str, output: Optional[str], parts: Tuple[str, ...], robot: str, as_json: bool) -> None:
    """Draw a recording: path, commanded and measured speeds, ranges, other sensors, battery.

    \b
    Examples:
      mrl plot drive.mrl
      mrl plot drive.mrl --part path -o path.svg
    """
    from mrl_driver import figures
    from mrl_driver.apps.review import drive_data, drive_plot
    from mrl_driver.driver.recorded import RecordedDriver

    picture = output or f"{os.path.splitext(file)[0]}.png"
    figures.require_writable(picture, "picture")
    recorded = RecordedDriver(file, resolve(robot).model)
    with progress(f"reading {os.path.basename(file)}", 1.0) as advance:
        found = drive_data.read(recorded, advance)
    drawn = parts or drive_plot.PARTS
    drive_plot.draw(found, picture, drawn)
    known = found.board is not None and found.board.capabilities
    if found.ranges and not known and {"path", "ranges"} & set(drawn):
        print_message(
            f"warning: {file} does not say whether the board has sonars; if it has environment sensors, the ranges "
            "are false: give --robot a model file with build: environment"
        )
    path_length_m = round(drive_plot.path_length_m(found), 3)
    if as_json:
        end = float(found.poses.time_s[-1]), *found.poses.values[-1].tolist()
        print_json(
            {
                "picture": picture,
                "robot": found.model.name,
                "path_m": path_length_m,
                "end": dict(zip(("time_s", "x_m", "y_m", "yaw_rad"), end)),
                "skipped_lines": found.skipped_lines,
            }
        )
        return
    click.echo(picture)
    for number, reason in recorded.recording.skipped.items():
        click.echo(f"{file}:{number}: skipped: {reason}", err=True)
