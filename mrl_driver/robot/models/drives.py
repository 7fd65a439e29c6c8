"""Drive types: one named tuple each, with the keys of its YAML section.

Those that a board moves have `wheel_separation_m`, `turning_separation_m`, `metres_per_count` and `turn_slip`.
"""

from typing import Dict, List, NamedTuple, Sequence, Tuple, Type, Union

THREE_WHEELS_DEG = (60.0, 180.0, 300.0)
"""Angles of motors 1, 2 and 3 in the motor board's omnidirectional mode, counter-clockwise from forward."""


class Drive(NamedTuple):
    """Differential drive with two wheels or two tracks."""

    wheel_separation_m: float
    """From the ground contact of one wheel, or track, to that of the other."""
    metres_per_count: float
    """Distance of a wheel per encoder count, mean of both wheels."""
    wheel_offset: float = 0.0
    """Cm of (Araujo 2012): the right wheel's metres per count minus the left's, as a share of their mean."""
    turn_slip: float = 0.0
    """Cs of (Araujo 2012): share of the yaw that tracks lose to slip in a turn."""

    @property
    def right_m_per_count(self) -> float:
        """Distance of the right wheel per count [m]."""
        return self.metres_per_count * (1 + self.wheel_offset / 2)

    @property
    def left_m_per_count(self) -> float:
        """Distance of the left wheel per count [m]."""
        return self.metres_per_count * (1 - self.wheel_offset / 2)

    @property
    def turning_separation_m(self) -> float:
        """Separation of wheels without slip that would turn the robot by the same angle [m]."""
        return self.wheel_separation_m / (1 - self.turn_slip)


class SkidDrive(Drive):
    """Two driven wheels on each side, which slide sideways in a turn; otherwise as a differential drive."""

    __slots__ = ()


class OmniDrive(NamedTuple):
    """Three omni wheels, 120 deg apart, each rolling along a circle about the centre."""

    radius_m: float
    """Distance from the centre to a wheel's ground contact point."""
    metres_per_count: float
    """Distance of a wheel per encoder count."""
    full_speed_m_s: float
    """Speed of a wheel at the motor board's 100 %."""
    angles_deg: Tuple[float, float, float] = THREE_WHEELS_DEG
    """Angles of the wheels of motors 1, 2 and 3, counter-clockwise from forward."""
    turn_slip: float = 0.0
    """Share of the yaw that is lost to slip in a turn."""

    @property
    def wheel_separation_m(self) -> float:
        """Separation of a differential drive whose wheels would run as fast in a turn [m]."""
        return 2 * self.radius_m

    @property
    def turning_separation_m(self) -> float:
        """`wheel_separation_m` of wheels without slip that would turn the robot by the same angle [m]."""
        return self.wheel_separation_m / (1 - self.turn_slip)


class MecanumDrive(NamedTuple):
    """Four wheels with rollers at 45 deg, at the corners of a rectangle."""

    half_length_m: float
    """Distance from the centre forward to the front axle (L)."""
    half_width_m: float
    """Distance from the centre to the left wheels (w)."""
    wheel_radius_m: float
    counts_per_turn: float
    """Encoder counts per turn of a wheel."""
    full_speed_m_s: float
    """Speed of a wheel."""
    turn_slip: float = 0.0
    """Share of the yaw that is lost to slip in a turn."""
    side_slip: float = 0.0
    """Share of the distance that is lost to slip of the rollers in a drive sideways."""
    wheel_offset: float = 0.0
    """The right wheels' size minus the left ones', as a share of the mean."""
    rear_offset: float = 0.0
    """The same of the rear wheels and those in front."""
    cross_offset: float = 0.0
    """The same of the front right and rear left wheels and the other two."""

    def size_of(self, wheel: str) -> float:
        """Return the size of a wheel, as a share of the mean."""
        right, rear = "right" in wheel, "rear" in wheel
        offsets = (self.wheel_offset, right), (self.rear_offset, rear), (self.cross_offset, right != rear)
        return 1 + sum(offset if more else -offset for offset, more in offsets) / 2

    @property
    def metres_per_count(self) -> float:
        """Distance of a wheel per count, mean of all [m]."""
        return 6.283185307179586 * self.wheel_radius_m / self.counts_per_turn

    @property
    def wheel_separation_m(self) -> float:
        """Separation of a differential drive whose wheels would run as fast in a turn [m]."""
        return 2 * (self.half_length_m + self.half_width_m)

    @property
    def turning_separation_m(self) -> float:
        """`wheel_separation_m` of wheels without slip that would turn the robot by the same angle [m]."""
        return self.wheel_separation_m / (1 - self.turn_slip)


class NoDrive(NamedTuple):
    """The board has sensors and no motors: it sits on a robot that something else drives."""


Base = Union[Drive, OmniDrive, MecanumDrive]
AnyDrive = Union[Base, NoDrive]
DIFFERENTIAL, TRACKED, OMNI, NONE = "differential", "tracked", "omni", "none"
SKID, MECANUM = FOUR_WHEELS = ("skid", "mecanum")
KINDS: Dict[str, Type[tuple]] = {
    DIFFERENTIAL: Drive,
    TRACKED: Drive,
    OMNI: OmniDrive,
    SKID: SkidDrive,
    MECANUM: MecanumDrive,
}
"""Values of `kind` in a `drive` section."""
EXTRA = {TRACKED: ("turn_slip",)}
"""Keys with a default that this kind requires."""


def kind_of(drive: AnyDrive) -> str:
    """Return the kind of a drive, one of `KINDS` or `NONE`; a differential drive with slip counts as tracked."""
    if isinstance(drive, NoDrive):
        return NONE
    if isinstance(drive, OmniDrive):
        return OMNI
    if isinstance(drive, MecanumDrive):
        return MECANUM
    if isinstance(drive, SkidDrive):
        return SKID
    return TRACKED if drive.turn_slip else DIFFERENTIAL


def metres_per_count(drive: Base, wheels: Sequence[str]) -> List[float]:
    """Return the distances of these wheels per count [m]."""
    if isinstance(drive, OmniDrive):
        return [drive.metres_per_count] * len(wheels)
    if isinstance(drive, MecanumDrive):
        return [drive.metres_per_count * drive.size_of(name) for name in wheels]
    return [drive.right_m_per_count if "right" in name else drive.left_m_per_count for name in wheels]


def moves_sideways(drive: AnyDrive) -> bool:
    """Return whether a base can move sideways."""
    return isinstance(drive, (OmniDrive, MecanumDrive))
