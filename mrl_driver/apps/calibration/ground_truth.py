"""Measures the true pose of a robot before and after each run."""

import json
import math
import os
from typing import Callable, Protocol

from mrl_driver.errors import ConfigError
from mrl_driver.files import open_plain
from mrl_driver.geometry import ORIGIN, Pose, wrap_angle

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
