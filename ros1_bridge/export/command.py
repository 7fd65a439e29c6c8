"""`mrl export`: a recording as a bag, an MCAP file or a table."""

import os
import re
import shlex
from typing import TYPE_CHECKING, Callable, Dict, Optional

import click

from mrl_driver.cli.commands.progress import progress
from mrl_driver.cli.commands.shared import complete_robot, confirm_overwrite, print_message, yes_option
from mrl_driver.errors import ConfigError
from mrl_driver.files import replacing
from mrl_driver.host.named_robots import resolve

if TYPE_CHECKING:
    from mrl_driver.driver.recorded import RecordedDriver

ENDINGS = (".bag", ".mcap", ".csv")
_NAMESPACE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")


@click.command(short_help="Convert a recording for other tools: bag, MCAP, CSV.")
@click.argument("file", type=click.Path())
@click.argument("output", type=click.Path())
@click.option(
    "--robot",
    metavar="ROBOT",
    default="auto",
    shell_complete=complete_robot,
    help="Robot model; by default that of the recording, or the one that lists the board's id.",
)
@click.option(
    "--name", metavar="NAME", default="", help="Namespace of topics and prefix of frames, such as robot1."
)
@click.option("--odom-frame", metavar="FRAME", help="Frame of the pose.  [default: odom, after the name]")
@click.option(
    "--base-frame", metavar="FRAME", help="Frame of the robot.  [default: base_link, after the name]"
)
@yes_option
def main(file: str, output: str, robot: str, name: str, yes: bool, **frames: Optional[str]) -> None:
    """Convert a recording for other tools; the ending of OUTPUT says to what.

    .bag and .mcap get the topics of robot_node with their types, frames and stamps, and the topic frames with all bytes
    of the serial line.  .csv is a table with a row for each telemetry, for spreadsheets and pandas.

    \b
    Examples:
      mrl export drive.mrl drive.bag
      mrl export drive.mrl drive.mcap --name robot1
      mrl export drive.mrl drive.csv
    """
    ending, name = os.path.splitext(output)[1].lower(), name.strip("/")
    _check(file, output, ending, name, bool(name or any(frames.values())))
    from mrl_driver.driver.recorded import RecordedDriver

    recorded = RecordedDriver(file, resolve(robot).model)
    confirm_overwrite(output, yes)
    with replacing(output) as temporary, progress(f"reading {os.path.basename(file)}", 1.0) as advance:
        if ending == ".csv":
            from . import table

            count, what = table.write(recorded, temporary, advance), "rows"
        else:
            count, what = _write_messages(recorded, temporary, output, name, frames, advance), "messages"
        if not count:
            raise ConfigError(
                f"{file} holds nothing for {output}, expected frames of a robot; check it with: "
                f"mrl replay {shlex.quote(file)}"
            )
    click.echo(f"{output}: {count} {what}")
    for number, reason in recorded.recording.skipped.items():
        print_message(f"{file}:{number}: skipped: {reason}")


def _check(file: str, output: str, ending: str, name: str, names: bool) -> None:
    """Raise ConfigError for what cannot be exported; `names`: topics or frames were named."""
    if ending not in ENDINGS:
        raise ConfigError(f"OUTPUT is {output!r}, expected a file that ends in {', '.join(ENDINGS)}")
    if os.path.exists(output) and os.path.exists(file) and os.path.samefile(output, file):
        raise ConfigError(f"OUTPUT is the recording {file!r} itself; give another file")
    if ending == ".csv" and names:
        raise ConfigError(
            "--name, --odom-frame or --base-frame is given with .csv, which has neither topics nor frames; leave it out"
        )
    if name and not _NAMESPACE.fullmatch(name):
        raise ConfigError(
            f"--name is {name!r}, expected a namespace of ROS: words that begin with a letter, of letters, "
            "digits and _, with / between the words"
        )


def _write_messages(
    recorded: "RecordedDriver",
    path: str,
    output: str,
    name: str,
    frames: Dict[str, Optional[str]],
    advance: Callable[[float], None],
) -> int:
    """Play a recording into a file of messages, which will be named `output`; return their number."""
    from . import message_classes

    message_classes.provide()
    from ros1_bridge.node.robot_parameters import check

    from . import message_files
    from .recorded_topics import RecordedTopics, now_ns

    prefix, namespace = (f"{name}/", f"/{name}") if name else ("", "")
    usual = {"odom_frame": f"{prefix}odom", "base_frame": f"{prefix}base_link"}
    parameters = check({"port": "recording", **{key: frames[key] or usual[key] for key in usual}}, "export")
    ending = os.path.splitext(output)[1].lower()
    file = message_files.make(ending, path, output, namespace, lambda: now_ns(recorded))
    RecordedTopics(recorded, file, parameters)
    recorded.play(advance)
    file.close()
    return file.count
