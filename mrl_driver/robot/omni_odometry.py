"""A robot with three wheels across, as the driver needs it: odometry of three counters, and commands in the units of
the motor board's omnidirectional mode.  Pure.
"""

import math
from typing import Tuple

from mrl_driver.protocol.table import BY_NAME

from .kinematics import Planar, advanced, kinematics_of
from .models import OmniDrive, RobotModel
from .models.drives import THREE_WHEELS_DEG
from .odometry import ORIGIN, TWIST_INTERVAL_S, Odometry, OmniTwist, OmniWheels, Pose

MOVE_OMNI = BY_NAME["move_omni"].code
STREAM = "start_omni_stream"
_FASTEST = 1e6
"""Beyond this [m/s, rad/s] a command is cut before it is scaled, which would overflow near the largest numbers."""
_STANDING = OmniTwist(0.0, 0.0, 0.0)
_NOTHING = (0.0, 0.0, 0.0, 0.0)


class OmniOdometry(Odometry):
    """Pose and twist of three wheels across from their counters, as `Odometry` does it for two."""

    def __init__(
        self, drive: OmniDrive, fastest_m_s: float, exact_time: bool = True, pose: Pose = ORIGIN
    ) -> None:
        super().__init__(drive, fastest_m_s, exact_time, pose)
        self._metres = drive.metres_per_count
        self._kinematics = kinematics_of(drive)
        self._least_s = 0.0 if exact_time else TWIST_INTERVAL_S
        self._sum = _NOTHING
        self.twist = _STANDING
        self.travel: OmniWheels = OmniWheels(0, 0, 0)

    def reset(self) -> None:
        """The board restarted: the next reading primes; the pose stays where it is."""
        self.baseline.reset()
        self.twist, self._sum = _STANDING, _NOTHING

    def update(self, right: int, left: int, time_s: float, rear: int = 0) -> bool:
        """Integrate one reading (int16 counts) taken at `time_s` [s]; False where it primes or is refused."""
        step = self.baseline.update(right, left, rear, time_s)
        if step is None:
            return False
        right, left, rear, dt_s = step
        travel, metres = self.travel, self._metres
        if right or left or rear:
            self.travel = OmniWheels(travel[0] + right, travel[1] + left, travel[2] + rear)
        moved = self._kinematics.step((left * metres, rear * metres, right * metres))
        self.pose = advanced(self.pose, moved)
        self._speeds(moved, dt_s)
        return True

    def _speeds(self, moved: Planar, dt_s: float) -> None:
        """Form speeds, together with the readings that were too close for it."""
        forward, left, turn, time_s = (a + b for a, b in zip(self._sum, (*moved, dt_s)))
        if time_s <= self._least_s:
            self._sum = (forward, left, turn, time_s)
            return
        self._sum = _NOTHING
        self.twist = OmniTwist(forward / time_s, turn / time_s, left / time_s)


class OmniCommands:
    """Speeds that a robot may be told, and how row 43 spells them."""

    def __init__(self, model: RobotModel, drive: OmniDrive) -> None:
        self._limits, self._full_m_s = model.limits, drive.full_speed_m_s
        self._kinematics = kinematics_of(drive)
        self._radius_m = drive.turning_separation_m / 2
        self._turned_deg = drive.angles_deg[0] - THREE_WHEELS_DEG[0]

    def limited(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float) -> OmniTwist:
        """The speeds, scaled down together where they exceed a limit of the model or what a wheel can do; the
        direction and the arc stay the same.
        """
        speeds = (linear_m_s, angular_rad_s, lateral_m_s)
        linear, angular, lateral = (max(-_FASTEST, min(_FASTEST, speed)) for speed in speeds)
        limits = self._limits
        excess = max(
            math.hypot(linear, lateral) / limits.linear_m_s,
            abs(lateral) / (limits.lateral_m_s or limits.linear_m_s),
            abs(angular) / limits.angular_rad_s,
            1.0,
        )
        wanted = Planar(linear / excess, lateral / excess, angular / excess)
        forward, left, turn = self._kinematics.saturated(wanted, self._full_m_s)
        return OmniTwist(forward, turn, left)

    def spell(self, speeds: Tuple[int, ...]) -> Tuple[int, ...]:
        """The request for these speeds, linear, angular, lateral [mm/s, mrad/s, mm/s]: to 1 % and 1 deg."""
        linear, angular, lateral = speeds
        percent = 0.1 / self._full_m_s
        direction_deg = math.degrees(math.atan2(lateral, linear)) - self._turned_deg
        return (
            MOVE_OMNI,
            min(100, round(math.hypot(linear, lateral) * percent)),
            max(-100, min(100, round(angular * self._radius_m * percent))),
            round(direction_deg) % 360,
        )

    def read(self, arguments: Tuple[int, ...]) -> OmniTwist:
        """The speeds that a request of row 43 asks for."""
        share, rotation, direction_deg = arguments
        way_m_s, heading = share * self._full_m_s / 100, math.radians(direction_deg + self._turned_deg)
        turn_rad_s = rotation * self._full_m_s / 100 / self._radius_m
        return OmniTwist(way_m_s * math.cos(heading), turn_rad_s, way_m_s * math.sin(heading))
