"""The data of a calibration: drives between two standstills, and the measured end of each."""

import math
from typing import Any, Dict, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose, wrap_angles
from mrl_driver.robot.kinematics import kinematics_of
from mrl_driver.robot.models import Noise
from mrl_driver.robot.models.drives import Base, metres_per_count
from mrl_driver.robot.odometry import WHEELS_BY_COUNT

MIN_LENGTH_M = 0.02
LEFT, RIGHT, NEITHER = "counter-clockwise", "clockwise", "straight"


class Trial(NamedTuple):
    """One drive.

    `steps` (N, W) int, columns as of `WHEELS_BY_COUNT`: counts between readings, in order.  `end` is the pose at the
    end in the frame of the start pose (x forward, y left); values that were not measured are NaN.
    """

    steps: np.ndarray
    end: Pose


def _rolled(drive: Base, steps: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the distances of the wheels (N, W) [m], and the body's step for a step of each, (W, 3) as of `Planar`."""
    kinematics = kinematics_of(drive)
    names = WHEELS_BY_COUNT[len(kinematics.wheels)]._fields
    if steps.shape[1] != len(names):
        raise ConfigError(
            f"a run has counts of {steps.shape[1]} wheels, expected {len(names)}: start again with --restart"
        )
    columns = dict(zip(kinematics.wheels, kinematics.columns))
    return steps * metres_per_count(drive, names), np.array([columns[name] for name in names])


def path(drive: Base, steps: np.ndarray) -> np.ndarray:
    """(N + 1, 3) poses by exact arcs, from (0, 0, 0); columns x y yaw [m m rad], yaw without wrap.

    As `geometry.advance`, for all steps at once: a fit computes the whole path hundreds of times.
    """
    wheels_m, columns = _rolled(drive, steps)
    forward, left, turn = (wheels_m @ columns).T
    poses = np.zeros((len(steps) + 1, 3))
    np.cumsum(turn, out=poses[1:, 2])
    heading, chord = poses[1:, 2] - turn / 2, np.sinc(turn / (2 * np.pi))
    cos, sin = chord * np.cos(heading), chord * np.sin(heading)
    np.cumsum(forward * cos - left * sin, out=poses[1:, 0])
    np.cumsum(forward * sin + left * cos, out=poses[1:, 1])
    return poses


def length_m(drive: Base, run: Trial) -> float:
    """Distance travelled by a wheel, mean of all [m]; forward and back both count."""
    wheels_m, _ = _rolled(drive, run.steps)
    return float(np.abs(wheels_m).sum()) / wheels_m.shape[1]


def errors(drive: Base, runs: List[Trial]) -> np.ndarray:
    """(R, 3) measured end minus end by counts, columns x y yaw [m m rad], yaw in (-pi, pi]; NaN if not measured."""
    found = np.array([np.subtract(run.end, path(drive, run.steps)[-1]) for run in runs]).reshape(-1, 3)
    found[:, 2] = wrap_angles(found[:, 2])
    return found


def unit_spreads(drive: Base, steps: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Covariances (3, 3) of the end for unit `Noise`: that of the wheels, and that of the turns."""
    poses = path(drive, steps)
    turn = np.diff(poses[:, 2])
    heading = poses[1:, 2] - turn / 2
    middle = (poses[1:, :2] + poses[:-1, :2]) / 2
    to_end = poses[-1, :2] - middle
    turned = np.stack((-to_end[:, 1], to_end[:, 0], np.ones(len(steps))))
    cos, sin, wheels = np.cos(heading), np.sin(heading), np.zeros((3, 3))
    wheels_m, columns = _rolled(drive, steps)
    for way_m, (forward, left, turns) in zip(np.abs(wheels_m).T, columns):
        ahead = np.stack((forward * cos - left * sin, forward * sin + left * cos, np.zeros(len(steps))))
        by_wheel = ahead + turns * turned
        wheels += (by_wheel * way_m) @ by_wheel.T
    return wheels, (turned * np.abs(turn)) @ turned.T


def spread(drive: Base, steps: np.ndarray, noise: Noise) -> np.ndarray:
    """Covariance (3, 3) of the end of these steps, as `robot.covariance` computes it from zero."""
    wheels, turns = unit_spreads(drive, steps)
    return noise.wheel_m2_per_m * wheels + noise.turn_rad2_per_rad * turns


def sense(drive: Base, run: Trial) -> str:
    """Direction in which a run turned: `LEFT`, `RIGHT`, or `NEITHER` for less than an eighth of a turn."""
    turned = float(path(drive, run.steps)[-1, 2])
    return NEITHER if abs(turned) < math.pi / 4 else LEFT if turned > 0 else RIGHT


def require_sense(drive: Base, run: Trial, expected: str, name: str) -> None:
    """Raise ConfigError for a run that went in the wrong direction, or hardly moved."""
    if length_m(drive, run) < MIN_LENGTH_M and expected == NEITHER:
        raise ConfigError(
            f"{name}: the counts hardly changed, expected a drive; check the plugs of the encoders"
        )
    found = sense(drive, run)
    if found != expected:
        raise ConfigError(f"{name} went {found}, expected {expected}; drive it again in the right direction")


def require_plausible(drive: Base, run: Trial, name: str) -> None:
    """Raise ConfigError for an end more than 0.05 m and a fifth of the distance from the end by the counts."""
    off = errors(drive, [run])[0]
    most_m = max(0.05, 0.2 * length_m(drive, run))
    if float(np.hypot(*np.nan_to_num(off[:2]))) > most_m:
        x, y = (run.end.x_m, run.end.y_m)
        raise ConfigError(
            f"{name}: x {x:.3f} y {y:.3f} m is {np.hypot(*off[:2]):.2f} m from the end by the counts, "
            f"expected at most {most_m:.2f} m: measure from the start, x forward, y left, in metres"
        )


def require_heading(run: Trial, name: str) -> None:
    """Raise ConfigError for a run without a heading: of a turn in place, x and y say next to nothing."""
    if math.isnan(run.end.yaw_rad):
        raise ConfigError(
            f"{name} has no heading, expected x y [m] and the heading [deg]: it alone says how far the robot turned"
        )


def as_json(run: Trial) -> Dict[str, Any]:
    """A run for the state file."""
    end = [None if math.isnan(value) else value for value in run.end]
    return {"end": end, "steps": run.steps.tolist()}


def from_json(data: Any) -> Trial:
    """The run written by `as_json`; raise ConfigError if the data is damaged."""
    try:
        steps = np.array(data["steps"], dtype=np.int64).reshape(len(data["steps"]), -1)
        x, y, yaw = (math.nan if value is None else float(value) for value in data["end"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ConfigError("a run in the state file is damaged; start again with --restart") from None
    return Trial(steps, Pose(x, y, yaw))
