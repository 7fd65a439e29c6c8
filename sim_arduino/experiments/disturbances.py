"""Errors of the robots in all experiments, and the options that give one robot its errors.

A robot has systematic errors, which its model does not know and which stay the same in a drive, and random ones, which
are new in each step.  A robot is one name with one seed: the same seed gives the same errors.  The sources of their
sizes are in docs/experiments.md; the `_SD` are standard deviations, divided by the model's value if they have no unit.
"""

import math
import random
from typing import Dict, List, Tuple

from mrl_driver.apps.calibration import fit
from mrl_driver.geometry import Pose, wrap_angle

WHEEL_M2_PER_M, TURN_RAD2_PER_RAD = 1e-6, 1e-4
"""Variance of a wheel's distance per distance, and of the yaw per angle turned."""
WHEEL_RATIO_SD, AXLE_SD, WHEEL_SIZE_SD = 0.005, 0.005, 0.002
MAX_SLIP = 0.02  # largest mean share of a turn that a robot loses; each robot has its own
PLACED_M, PLACED_RAD = 0.005, math.radians(1.0)
"""Standard deviations, along each axis and in heading, of a robot that a person puts on a mark."""
SONAR_NOISE_M = 0.01  # standard deviation of a range
CURVE_GAIN_SD, CURVE_EXPONENT_SD, CURVE_OFFSET_SD_M = 0.05, 0.02, 0.005
"""Of a sonar's own curve from the published one: factor, exponent and constant."""
GYRO_SCALE_SD = 0.0003
"""Error of the gyro's scale after `mrl calibrate imu`: five turns to a mark that is read to 0.01 rad."""
PACK_CAPACITY_SD, PACK_RESISTANCE_SD = 0.05, 0.2  # assumed
BATTERY_NOISE_V = 0.03
"""Standard deviation of a reading of the battery, from ripple and a converter of 10 bits.  Assumed."""

WANDER = f"noise={WHEEL_M2_PER_M:g},turn_noise={TURN_RAD2_PER_RAD:g}"
"""The random errors alone, in the form of `factory.Options.error`."""
SONAR = f"noise={SONAR_NOISE_M:g}"  # errors of all sonars, in the form of `factory.Options.sonar`

SLIP = 0.01
"""Share by which both wheels of a robot in a mixed team slip, on the straight and in turns, unknown to its odometry.
Assumed."""


def wander(slip: float = 0.0) -> str:
    """The random errors and a slip of both wheels, in the form of `factory.Options.error`."""
    return option(wheel_size=1.0 - slip, noise=WHEEL_M2_PER_M, turn_noise=TURN_RAD2_PER_RAD)


def error(seed: int, name: str = "", **given: float) -> str:
    """All errors of a robot's wheels and turns, in the form of `factory.Options.error`.

    Robots of a team need a `name`: their seeds are next to each other.  `given` are values that are not drawn, such as
    `slip=0.0`.
    """
    rng = _random("wheels", seed, name)
    drawn = {
        "wheel_ratio": rng.gauss(1.0, WHEEL_RATIO_SD),
        "wheel_size": rng.gauss(1.0, WHEEL_SIZE_SD),
        "axle": rng.gauss(1.0, AXLE_SD),
        "slip": rng.uniform(0.0, MAX_SLIP),
        "noise": WHEEL_M2_PER_M,
        "turn_noise": TURN_RAD2_PER_RAD,
    }
    return option(**{**drawn, **given})


def sonar_curve(seed: int) -> Dict[str, float]:
    """The curve of a robot's sonars, as keys of `factory.Options.sonar` and their values."""
    rng = _random("sonars", seed, "")
    return {
        "gain": rng.gauss(1.0, CURVE_GAIN_SD),
        "exponent": rng.gauss(1.0, CURVE_EXPONENT_SD),
        "offset": rng.gauss(0.0, CURVE_OFFSET_SD_M),
    }


def option(**values: float) -> str:
    """Errors in the form of an option of the emulator, `key=value,...`."""
    return ",".join(f"{key}={value:.6g}" for key, value in values.items())


def placed(mark: Pose, seed: int, name: str = "") -> Pose:
    """The true pose of a robot that a person put on a mark; its odometry begins with the mark's pose."""
    return _near(mark, _random("start", seed, name), fit.Measured(PLACED_M, PLACED_RAD))


def packs(seed: int) -> Tuple[float, float]:
    """Capacity and resistance of a robot's battery packs, divided by the model's."""
    rng = _random("packs", seed, "")
    return rng.gauss(1.0, PACK_CAPACITY_SD), max(0.1, rng.gauss(1.0, PACK_RESISTANCE_SD))


def measured(pose: Pose, rng: random.Random) -> Pose:
    """A pose as a person measures it with a tape."""
    return _near(pose, rng, fit.BY_TAPE)


def _near(pose: Pose, rng: random.Random, spread: fit.Measured) -> Pose:
    off: List[float] = [rng.gauss(0.0, math.sqrt(variance)) for variance in spread.variances]
    return Pose(pose.x_m + off[0], pose.y_m + off[1], wrap_angle(pose.yaw_rad + off[2]))


def _random(what: str, seed: int, name: str) -> random.Random:
    return random.Random(f"disturbed {what} {seed} {name}")
