"""The limits of a robot that keep it from tipping over, in its file."""

import math
from typing import Any, Dict

from mrl_driver.apps.calibration.calibration_files import write_model
from mrl_driver.errors import ConfigError
from mrl_driver.robot import models

from .margin import Situation, drive_limits


def write_limits(situation: Situation, reserve_rad: float, robot: str) -> Dict[str, Any]:
    """Write the limits of a drive to a robot's file; return what was written, or raise ConfigError or OutputError.

    Braking is not faster than the board's own ramp.  Else a speed would be left at the end of each braking, which the
    board takes away with its brake at once.
    """
    path, model = models.path_of(robot), models.load(robot)
    model.require_motors()
    if models.is_packaged(path):
        raise ConfigError(
            f"--limits is {robot}, which belongs to the package, expected a copy such as my{robot}.yaml"
        )
    own, ramp_s = model.limits, model.board["ramp_time"] / 1000
    found = drive_limits(situation, (own.angular_rad_s, own.angular_acceleration_rad_s2), reserve_rad)
    board_m_s2 = model.board["linear_ceiling"] / 1000 / ramp_s if ramp_s else math.inf
    values = {
        "linear_acceleration_m_s2": min(own.linear_acceleration_m_s2, found.along_m_s2),
        "braking_m_s2": min(board_m_s2, found.along_m_s2),
        "curve_m_s2": found.curve_m_s2,
    }
    note = f"mrl tip-over, {math.degrees(reserve_rad):g} deg kept"
    kept = write_model(path, path, {("limits", name): value for name, value in values.items()}, note)
    return {"file": path, "kept": kept, **values}
