"""Support for a base with three or four wheels: odometry from all counters, and commands to those that move sideways.
No I/O.
"""

import math
from typing import Optional, Tuple, Union

from mrl_driver.geometry import advance
from mrl_driver.protocol.table import BY_NAME

from .kinematics import Planar, kinematics_of
from .models import MecanumDrive, OmniDrive
from .models.drives import THREE_WHEELS_DEG, AnyDrive, Base, metres_per_count
from .odometry import WHEELS_BY_COUNT, AnyTwist, AnyWheels, Odometry, OmniTwist

MOVE_OMNI, MOVE_TWIST = (BY_NAME[name].code for name in ("move_omni", "move_twist"))
STREAMS = {3: "start_omni_stream", 4: "start_wheel_stream"}
"""Rows of the streams with all counters, by the number of wheels."""
_STANDING = OmniTwist(0.0, 0.0, 0.0)
_NOTHING = (0.0, 0.0, 0.0, 0.0)


class WheelOdometry(Odometry):
    """Pose and twist of a base with three or four wheels from its counters; otherwise as `Odometry`."""

    def __init__(self, drive: Base, fastest_m_s: float, exact_time: bool = True) -> None:
        super().__init__(drive, fastest_m_s, exact_time)
        self._kinematics = kinematics_of(drive)
        wheels = self._kinematics.wheels
        self._wheels = WHEELS_BY_COUNT[len(wheels)]
        self._metres = metres_per_count(drive, wheels)
        self._places = [self._wheels._fields.index(name) for name in wheels]
        self._sum = _NOTHING
        self._stood = (0,) * len(wheels)
        self.twist: AnyTwist = _STANDING
        self.travel: AnyWheels = self._wheels(*self._stood)

    def reset(self) -> None:
        """The board restarted: the next reading is a new baseline; the pose does not change."""
        super().reset()
        self.twist, self._sum = _STANDING, _NOTHING

    def update(self, right: int, left: int, time_s: float, *others: int) -> bool:
        """Integrate a reading (int16 counts) of time `time_s` [s], `others` in the order of `travel`.

        Returns:
            False if it is a new baseline or is refused.
        """
        step = self.baseline.update(right, left, *others, time_s)
        if step is None:
            return False
        *counts, dt_s = step
        rolled = any(counts)
        if rolled:
            self.travel = self._wheels(*[a + b for a, b in zip(self.travel, counts)])
        wheels_m = [counts[place] * metres for place, metres in zip(self._places, self._metres)]
        moved = self._kinematics.step(wheels_m)
        heading, gyro = self.heading, None
        if heading is not None:
            moved = moved._replace(turn=heading.turn(time_s, moved.turn, self._rolled()))
            gyro = heading if heading.in_use else None
        before = self.pose
        self.pose = advance(before, moved.forward, moved.turn, moved.left)
        if self.uncertainty is not None and (rolled or moved.turn):
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


class PlanarCommands:
    """What the wheels of a base that moves sideways reach of the commanded speeds, and their conversion to and from its
    request, `code`: `move_twist`.  The board knows nothing of slip to the side.
    """

    code = MOVE_TWIST

    def __init__(self, drive: Union[MecanumDrive, OmniDrive]) -> None:
        self._full_m_s = drive.full_speed_m_s
        self._keeps = 1 - drive.side_slip if isinstance(drive, MecanumDrive) else 1.0
        self._kinematics = kinematics_of(drive)

    def saturated(self, speeds: Tuple[float, ...]) -> OmniTwist:
        """Return the speeds, scaled down together if a wheel cannot reach its own; direction and arc stay the same."""
        linear, angular, lateral = speeds
        forward, left, turn = self._kinematics.saturated(Planar(linear, lateral, angular), self._full_m_s)
        return OmniTwist(forward, turn, left)

    def spell(self, speeds: Tuple[int, ...]) -> Tuple[int, ...]:
        """Return the request for these speeds: linear, angular, lateral [mm/s, mrad/s, mm/s]."""
        linear, angular, lateral = speeds
        return self.code, linear, round(lateral / self._keeps), angular

    def read(self, arguments: Tuple[int, ...]) -> OmniTwist:
        """Return the speeds that a request commands."""
        linear, lateral, angular = arguments
        return OmniTwist(linear / 1000, angular / 1000, lateral * self._keeps / 1000)


class OmniCommands(PlanarCommands):
    """The same for three omni wheels: `move_omni`, in the units of the motor board's omnidirectional mode."""

    code = MOVE_OMNI

    def __init__(self, drive: OmniDrive) -> None:
        super().__init__(drive)
        self._radius_m = drive.turning_separation_m / 2
        self._turned_deg = drive.angles_deg[0] - THREE_WHEELS_DEG[0]

    def spell(self, speeds: Tuple[int, ...]) -> Tuple[int, ...]:
        """Return the request for these speeds (linear, angular, lateral [mm/s, mrad/s, mm/s]), rounded to 1 % and
        1 deg.
        """
        linear, angular, lateral = speeds
        percent = 0.1 / self._full_m_s
        direction_deg = math.degrees(math.atan2(lateral, linear)) - self._turned_deg
        return (
            self.code,
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


def commands_of(drive: AnyDrive) -> Optional[PlanarCommands]:
    """Return the commands of a base that moves sideways; None for others."""
    if isinstance(drive, OmniDrive):
        return OmniCommands(drive)
    return PlanarCommands(drive) if isinstance(drive, MecanumDrive) else None
