"""`mrl experiment`: the papers' experiments, one after the other."""

import importlib
import os
import time
from typing import TYPE_CHECKING, Any, NamedTuple, Optional, Sequence

import click

from mrl_driver import figures
from mrl_driver.cli.commands.shared import confirm_motion, require_device
from mrl_driver.cli.main import registered
from mrl_driver.errors import ConfigError, MrlError

if TYPE_CHECKING:  # `mrl --help` loads this module
    from rich.table import Table

    from .experiment_report import Result
    from .experiment_robot import Setting


class Experiment(NamedTuple):
    """An experiment; its `module` has `run(setting)`, and if it can run through ROS `run(setting, live)`."""

    module: str
    text: str
    on_port: bool = False  # it can drive a real robot


EXPERIMENTS = {
    "square": Experiment("square", "square of 1 m by odometry, before and after calibration"),
    "sonar-calibration": Experiment(
        "sonar_approach", "sonar in front of a wall at 20 cm to 2 m, and its fitted curve", True
    ),
    "l-course": Experiment("l_course", "L-shaped course mapped with sonars and with a laser", True),
    "gyro": Experiment("gyro", "turns and the L-course with and without a gyro"),
    "power": Experiment("power", "circles until the battery packs are empty", True),
    "step-test": Experiment("step_test", "driving from point to point over a grid, mirrored live", True),
    "mixed-team": Experiment("mixed_team", "two real robots and a virtual one wander in one arena", True),
    "shared-waypoint": Experiment("shared_waypoint", "three robots share a waypoint", True),
    "crossing": Experiment("crossing", "two robots at a blind crossing, by radio alone"),
    "environment": Experiment("arena_sweep", "map of heat, dust and alcohol in the arena"),
    "tip-over": Experiment("tip_over", "robot with a mast that drives fast, with and without limits"),
    "turnaround": Experiment("turnaround", "time of messages between PC and motor board"),
}


@click.command("experiment", short_help="Repeat an experiment of the papers.")
@click.argument("names", nargs=-1, metavar="[NAME|all]...", type=click.Choice(["all", *EXPERIMENTS]))
@click.option("--list", "listed", is_flag=True, help="List the experiments.")
@click.option(
    "--port",
    metavar="PORT",
    help="Drive the robot on this port, if the experiment supports it; default: emulated robots.",
)
@click.option("--robot", default="traxbot", metavar="NAME|FILE", show_default=True, help="Robot model.")
@click.option(
    "--out", default="build/experiments", metavar="FOLDER", show_default=True, help="Folder for the results."
)
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0, 2**31), help="Seed of all random numbers."
)
@click.option(
    "--seeds",
    default=0,
    type=click.IntRange(0, 1000),
    help="Number of runs with random numbers of their own; default: as many as each experiment has, 10 in most.",
)
@click.option("--yes", is_flag=True, help="Drive the robot on --port without asking.")
@click.option(
    "--ros/--no-ros",
    default=None,
    help="Run the experiments about ROS through ROS in real time, or in simulated time; default: ROS if installed.",
)
def main(
    names: Sequence[str],
    listed: bool,
    port: Optional[str],
    robot: str,
    out: str,
    seed: int,
    seeds: int,
    yes: bool,
    ros: Optional[bool],
) -> None:
    """Repeat an experiment of the papers.

    Prints our figures next to the published ones, and draws a picture.  Without a NAME, lists the experiments.

    \b
    Examples:
      mrl experiment --list
      mrl experiment l-course
      mrl experiment all
    """
    if listed or not names:
        width = max(map(len, EXPERIMENTS))
        click.echo("\n".join(f"{name:{width}}  {each.text}" for name, each in EXPERIMENTS.items()))
        return
    chosen = list(EXPERIMENTS if "all" in names else dict.fromkeys(names))
    figures.require_matplotlib("mrl experiment")
    if port is not None:
        emulated = [name for name in chosen if not EXPERIMENTS[name].on_port]
        if emulated:
            text = (
                f"experiment {', '.join(emulated)} needs emulated robots, got --port {port}; leave out --port"
            )
            raise ConfigError(text)
        require_device(port)
        confirm_motion(f"The robot on {port} drives by itself ({', '.join(chosen)}). Is the floor free?", yes)
    from .experiment_robot import Setting

    _run(chosen, Setting(_folder(out), port, robot, seed, port is None and _through_ros(chosen, ros), seeds))


def _ros_experiments() -> Any:
    """The module that runs experiments through ROS; None if the bridge is not installed."""
    point = registered("mrl.experiments").get("ros")
    return point.load() if point else None


def _through_ros(chosen: Sequence[str], wanted: Optional[bool]) -> bool:
    """Whether to run through ROS; prints a line if ROS is missing, or ConfigError if it is requested."""
    ros_experiments = _ros_experiments() if wanted is not False else None
    if ros_experiments is None:
        return False
    about = [name for name in chosen if name in ros_experiments.NODES]
    if not about:
        return False
    missing = ros_experiments.missing()
    if missing and wanted:
        raise ConfigError(missing)
    if missing:
        click.echo(f"{missing}; running without ROS: {', '.join(about)}", err=True)
    return not missing


def _folder(out: str) -> str:
    try:
        os.makedirs(out, exist_ok=True)
    except OSError as error:
        raise ConfigError(
            f"--out {out} cannot be made: {error.strerror}; give a folder that can be written"
        ) from None
    if not os.access(out, os.W_OK):
        raise ConfigError(f"--out {out} is not writable; give a folder that can be written")
    return out


def _run(chosen: Sequence[str], setting: "Setting") -> None:
    """Runs experiments, and prints and saves their results; MrlError if one failed, of emulated robots at the end."""
    from rich.console import Console

    from .experiment_report import save

    console, failures = Console(), []
    for name in chosen:
        start_s = time.monotonic()
        try:
            with console.status(name):
                result = run(name, setting)
        except MrlError as error:
            if setting.port is not None:
                raise
            failures.append(error)
            continue
        save(result, setting.folder)
        console.print(_table(name, result, time.monotonic() - start_s, setting.folder))
    if failures:
        joined = MrlError("; ".join(map(str, failures)))
        joined.exit_code = failures[0].exit_code
        raise joined
    console.print(f"report: {os.path.join(setting.folder, 'report.md')}", soft_wrap=True)


def run(name: str, setting: "Setting") -> "Result":
    """Runs one experiment, in this process: any signal stops a real robot."""
    ros_experiments = _ros_experiments() if setting.ros else None
    if ros_experiments and name in ros_experiments.NODES:
        result: Result = ros_experiments.run(name, setting)
    else:
        result = importlib.import_module(f"{__package__}.{EXPERIMENTS[name].module}").run(setting)
    return result


def _table(name: str, result: "Result", seconds: float, folder: str) -> "Table":
    from rich.table import Table

    from .experiment_report import HEADINGS, cells

    files = ", ".join(os.path.join(folder, picture) for picture in result.pictures)
    table = Table(title=result.title, caption=f"{name}: {seconds:.0f} s, {files}", title_justify="left")
    for column in HEADINGS:
        table.add_column(column)
    for row in result.rows:
        table.add_row(*cells(row))
    return table
