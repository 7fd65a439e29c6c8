"""`mrl calibrate gains` for motors without encoders: dead zone and full speed, from three drives and a tape measure."""

import math
from typing import Dict

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from mrl_driver.robot.models import RobotModel

from . import manoeuvres
from .ground_truth import Ruler
from .manoeuvres import MOVE

LOW_PERCENT, HIGH_PERCENT = 40, 80  # of full duty
SHORT_S, LONG_S = 1.0, 2.5
"""Times of two drives at the larger duty [s]: their difference has its speed, without what a drive loses while the
robot speeds up and stops.  The drive at the smaller duty takes as long as the longer one."""
LEAST_M, LEAST_M_S = 0.05, 0.02


def measure(robot: Driver, model: RobotModel, ruler: Ruler) -> Dict[str, int]:
    """Drive forward, back and forward again, without a ramp; return the parameters `friction_duty` and `full_speed`.

    ConfigError if the robot hardly moved, or was not faster at the larger duty.
    """
    short_m, long_m = _way(robot, ruler, HIGH_PERCENT, SHORT_S), _way(robot, ruler, -HIGH_PERCENT, LONG_S)
    high_m_s = max(LEAST_M_S, (long_m - short_m) / (LONG_S - SHORT_S))
    lost_s = min(SHORT_S, max(0.0, LONG_S - long_m / high_m_s))
    low_m_s = _way(robot, ruler, LOW_PERCENT, LONG_S) / (LONG_S - lost_s)
    if high_m_s <= low_m_s:
        raise ConfigError(
            f"the robot drove {high_m_s:.2f} m/s at {HIGH_PERCENT} % of full duty, expected more than "
            f"{low_m_s:.2f} m/s, its speed at {LOW_PERCENT} %: measure again, and check the battery"
        )
    per_percent = (high_m_s - low_m_s) / (HIGH_PERCENT - LOW_PERCENT)
    dead_percent = max(0.0, LOW_PERCENT - low_m_s / per_percent)
    full_m_s = high_m_s + per_percent * (100 - HIGH_PERCENT)
    full_rpm = full_m_s * 60 / (2 * math.pi * model.board["wheel_radius"] / 1e5)
    found = {"friction_duty": round(10 * dead_percent), "full_speed": round(full_rpm)}
    for name, value in found.items():
        low, high = PARAMETER_BY_NAME[name].low, PARAMETER_BY_NAME[name].high
        if not low <= value <= high:
            raise ConfigError(f"{name} is {value} by these drives, expected {low} to {high}: measure again")
    return found


def _way(robot: Driver, ruler: Ruler, percent: int, seconds: float) -> float:
    """Return the way of a straight drive at this share of full duty, back if it is negative [m]."""
    sign, words = (1, "forward") if percent > 0 else (-1, "back")
    name = f"straight {words} for {seconds:g} s at {abs(percent)} % of full duty"
    manoeuvres.settle(robot)
    ruler.begin(name)
    manoeuvres.spin_motors(robot, MOVE, (percent, percent), seconds)
    manoeuvres.settle(robot)
    return sign * ruler.end(name, lambda pose: _require_way(sign * pose.x_m, name)).x_m


def _require_way(way_m: float, name: str) -> None:
    if way_m < LEAST_M:
        raise ConfigError(
            f"{name}: the robot drove {way_m:.3f} m, expected at least {LEAST_M:g} m; check the battery, and run "
            "mrl calibrate wiring"
        )
