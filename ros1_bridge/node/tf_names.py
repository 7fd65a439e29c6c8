"""Names and positions that node and description must agree on.  Pure."""

import math
from typing import Tuple

from mrl_driver.robot.kinematics import kinematics_of
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.models.drives import Base
from mrl_driver.robot.odometry import WHEELS_BY_COUNT

SONAR_HEIGHT_M = 0.0  # Height of the sonars above base_link, which is at the axle


def wheel_radius_m(model: RobotModel) -> float:
    """True radius [m]: distance per wheel turn, from metres per count and counts per turn, divided by 2 pi."""
    counts = model.board["gearbox"] / 10 * model.board["encoder_counts"] / 10
    return model.base.metres_per_count * counts / (2 * math.pi)


def servo_joint(servo: str) -> str:
    """Joint of a servo in the description."""
    return f"{servo}_joint"


def joints_of(drive: Base) -> Tuple[str, ...]:
    """Wheel joints of the description, in the order of the counters."""
    return tuple(f"{name}_wheel_joint" for name in WHEELS_BY_COUNT[len(kinematics_of(drive).wheels)]._fields)


def sonar_frame(base_frame: str, sonar: str) -> str:
    """Frame of a sonar with the prefix of `base_frame`: robot1/base_link gives robot1/sonar_front."""
    return beside(base_frame, f"sonar_{sonar}")


def imu_frame(base_frame: str) -> str:
    """Frame of the IMU with the prefix of `base_frame`, whose axes it has: the driver rotates all readings."""
    return beside(base_frame, "imu_link")


def footprint_frame(base_frame: str) -> str:
    """Frame on the floor, with the prefix of `base_frame`."""
    return beside(base_frame, "base_footprint")


def beside(base_frame: str, name: str) -> str:
    """A frame with the prefix of `base_frame`."""
    prefix, slash, _ = base_frame.rpartition("/")
    return f"{prefix}{slash}{name}"
