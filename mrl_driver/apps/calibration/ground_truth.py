"""Measures the true pose of a robot before and after each run: by the emulator, or by a person at the terminal."""

import json
import math
import os
import sys
from typing import Callable, NamedTuple, Optional, Protocol

import click

from mrl_driver.errors import ConfigError
from mrl_driver.files import open_plain
from mrl_driver.geometry import ORIGIN, Pose, wrap_angle

NOT_MEASURED = Pose(math.nan, math.nan, math.nan)
_TAIL_BYTES = 4096
Check = Callable[[Pose], None]  # raises ConfigError for an impossible end


class Ruler(Protocol):
    """Measures the end of a run in the frame of its start: x forward, y left [m], yaw [rad]; NaN if not measured."""

    def begin(self, run: str) -> None:
        """The robot is at the start of `run`."""

    def end(self, run: str, check: Check) -> Pose:
        """The pose at the end, accepted by `check`; raise ConfigError if it is not, and cannot be measured again."""


class Truth:
    """A ruler for emulated robots, whose true pose is known; it announces each run."""

    def __init__(self, pose: Callable[[], Pose], announce: Callable[[str], None] = lambda run: None) -> None:
        self._pose, self._announce = pose, announce
        self._start = ORIGIN

    def begin(self, run: str) -> None:
        """Store the robot's pose."""
        self._announce(run)
        self._start = self._pose()

    def end(self, run: str, check: Check) -> Pose:
        """The robot's pose now, relative to the start."""
        pose = self._pose().relative_to(self._start)
        check(pose)
        return pose


def truth_file(path: str) -> Callable[[], Pose]:
    """A function that reads the newest pose of a file written by `mrl-sim --truth`.

    Raise ConfigError if there is no such file; the function raises it if the file holds no pose.
    """
    if not os.path.isfile(path):
        raise ConfigError(f"--truth {path} does not exist, expected the file that mrl-sim --truth writes")
    return lambda: _last_pose(path)


def _last_pose(path: str) -> Pose:
    with open_plain(path) as file:
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - _TAIL_BYTES))
        whole = file.read().rpartition(b"\n")[0].rsplit(b"\n", 1)[-1]
    try:
        line = json.loads(whole)
        pose = Pose(float(line["x"]), float(line["y"]), float(line["yaw"]))
        if not all(map(math.isfinite, pose)):
            raise ValueError
        return pose
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise ConfigError(f"--truth {path} ends with {whole[:60]!r}, expected a pose as JSON") from None


def parse_pose(text: str) -> Pose:
    """Parse `x y heading` in metres and degrees, separated by spaces or commas; the heading is optional."""
    parts = text.replace(",", " ").split()
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise ConfigError(
            f"got {text!r}, expected x y [m] and optionally the heading [deg], such as: 0.012 -0.034 1.5"
        )
    if max(abs(numbers[0]), abs(numbers[1])) > 100:
        raise ConfigError(f"got {text!r}, expected x and y in metres, not centimetres")
    yaw_rad = wrap_angle(math.radians(numbers[2])) if len(numbers) == 3 else math.nan
    return Pose(numbers[0], numbers[1], yaw_rad)


# -- a person


def tell(text: str) -> None:
    """Print progress, which goes to stderr as questions do; results go to stdout."""
    click.echo(text, err=True)


class ByHand(NamedTuple):
    """A ruler that asks the user to measure."""

    mark: str  # what to do before a run
    question: str  # what to answer after it
    parse: Callable[[str], Pose]  # the pose of an answer
    kept: str = ""  # what the user should know before Ctrl-C
    default: Optional[str] = None  # answer for only Enter; without it there must be one

    def begin(self, run: str) -> None:
        """Ask for the mark on the floor."""
        click.secho(f"\n{run}", bold=True, err=True)
        tell(f"{self.mark} on the floor, and clear its path.")
        click.prompt("Press Enter to drive", default="", show_default=False, err=True)

    def end(self, run: str, check: Check) -> Pose:
        """Ask until the answer is plausible; the robot may be turned by hand before the answer."""
        while True:
            text = click.prompt(self.question, default=self.default, show_default=False, err=True)
            try:
                pose = self.parse(text)
                check(pose)
                return pose
            except ConfigError as error:
                tell(f"{error}; measure again, or end with Ctrl-C{self.kept}")


TAPE_MEASURE = ByHand(
    "Mark the robot's position and heading",
    "Measure from the mark: x ahead and y to the left [m], and the heading [deg] if you can; a turn in place needs it",
    parse_pose,
    ": earlier runs are kept",
)


def _heading(text: str) -> Pose:
    """Parse a heading [deg]; return it as a pose without a position, in (-pi, pi]."""
    try:
        heading_rad = wrap_angle(math.radians(float(text)))
    except ValueError:
        heading_rad = math.nan
    if math.isnan(heading_rad):
        raise ConfigError(f"got {text!r}, expected a heading in degrees, such as -1.5, or only Enter")
    return NOT_MEASURED._replace(yaw_rad=heading_rad)


HEADING_MARK = ByHand(
    "Align a side of the robot with a straight line",
    "Turn the robot slowly by hand until the same side lies along the line again, and press Enter; or type its heading "
    "[deg], counter-clockwise from the start",
    _heading,
    default="0",
)


def require_terminal(instead: str) -> None:
    """Raise ConfigError if stdin is not a terminal."""
    if not sys.stdin.isatty():
        raise ConfigError(f"stdin is not a terminal; give {instead}")


def ruler_for(truth: Optional[str], heading_only: bool = False) -> Ruler:
    """Return a ruler: the emulator's ground truth, or a user with a tape or a line on the floor."""
    if truth is not None:
        return Truth(truth_file(truth), tell)
    if heading_only:
        require_terminal("--truth FILE for an emulated robot")
        return HEADING_MARK
    require_terminal("--truth FILE for an emulated robot, or --run FILE:X,Y,HEADING for recordings")
    return TAPE_MEASURE
