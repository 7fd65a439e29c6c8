"""Support for a base with three omni wheels: odometry from three counters, and commands in the units of the motor
board's omnidirectional mode.  No I/O.
"""

import math
from typing import Tuple

from mrl_driver.geometry import advance
from mrl_driver.protocol.table import BY_NAME

from .kinematics import Planar, kinematics_of
from .models import OmniDrive
from .models.drives import THREE_WHEELS_DEG
from .odometry import Odometry, OmniTwist, OmniWheels

MOVE_OMNI = BY_NAME["move_omni"].code
STREAM = "start_omni_stream"
_STANDING = OmniTwist(0.0, 0.0, 0.0)
_NOTHING = (0.0, 0.0, 0.0, 0.0)


class OmniOdometry(Odometry):
    """Pose and twist of a base with three omni wheels from its counters; otherwise as `Odometry`."""

    def __init__(self, drive: OmniDrive, fastest_m_s: float, exact_time: bool = True) -> None:
        super().__init__(drive, fastest_m_s, exact_time)
        self._metres = drive.metres_per_count
        self._kinematics = kinematics_of(drive)
        self._sum = _NOTHING
        self._stood = (0, 0, 0)
        self.twist = _STANDING
        self.travel: OmniWheels = OmniWheels(0, 0, 0)

    def reset(self) -> None:
        """The board restarted: the next reading is a new baseline; the pose does not change."""
        super().reset()
        self.twist, self._sum = _STANDING, _NOTHING

    def update(self, right: int, left: int, time_s: float, rear: int = 0) -> bool:
        """Integrate a reading (int16 counts) of time `time_s` [s]; False if it is a new baseline or is refused."""
        step = self.baseline.update(right, left, rear, time_s)
        if step is None:
            return False
        right, left, rear, dt_s = step
        travel, metres = self.travel, self._metres
        if right or left or rear:
            self.travel = OmniWheels(travel[0] + right, travel[1] + left, travel[2] + rear)
        wheels_m = (left * metres, rear * metres, right * metres)
        moved = self._kinematics.step(wheels_m)
        heading, gyro = self.heading, None
        if heading is not None:
            moved = moved._replace(turn=heading.turn(time_s, moved.turn, self._rolled()))
            gyro = heading if heading.in_use else None
        before = self.pose
        self.pose = advance(before, moved.forward, moved.turn, moved.left)
        if self.uncertainty is not None and (right or left or rear or moved.turn):
            self.uncertainty.update(before, self.pose, wheels_m, moved.turn, dt_s, gyro)
        elif self.uncertainty is not None:
            self.uncertainty.stand(dt_s, gyro)
        self._speeds(moved, dt_s)
        return True

    def _speeds(self, moved: Planar, dt_s: float) -> None:
        """Compute the speeds, together with earlier readings that were too close in time."""
        forward, left, turn, time_s = (a + b for a, b in zip(self._sum, (*moved, dt_s)))
        if time_s <= self._interval_s:
            self._sum = (forward, left, turn, time_s)
            return
        self._sum = _NOTHING
        self.twist = OmniTwist(forward / time_s, turn / time_s, left / time_s)


class OmniCommands:
    """What the wheels reach of the commanded speeds, and their conversion to and from `move_omni` (command 43)."""

    def __init__(self, drive: OmniDrive) -> None:
        self._full_m_s = drive.full_speed_m_s
        self._kinematics = kinematics_of(drive)
        self._radius_m = drive.turning_separation_m / 2
        self._turned_deg = drive.angles_deg[0] - THREE_WHEELS_DEG[0]

    def saturated(self, speeds: Tuple[float, ...]) -> OmniTwist:
        """Return the speeds, scaled down together if a wheel cannot reach its own; direction and arc stay the same."""
        linear, angular, lateral = speeds
        forward, left, turn = self._kinematics.saturated(Planar(linear, lateral, angular), self._full_m_s)
        return OmniTwist(forward, turn, left)

    def spell(self, speeds: Tuple[int, ...]) -> Tuple[int, ...]:
        """Return the request for these speeds (linear, angular, lateral [mm/s, mrad/s, mm/s]), rounded to 1 % and
        1 deg.
        """
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
        """Return the speeds that a `move_omni` request (command 43) commands."""
        share, rotation, direction_deg = arguments
        speed_m_s, heading = share * self._full_m_s / 100, math.radians(direction_deg + self._turned_deg)
        turn_rad_s = rotation * self._full_m_s / 100 / self._radius_m
        return OmniTwist(speed_m_s * math.cos(heading), turn_rad_s, speed_m_s * math.sin(heading))
