"""What moves a robot: one named tuple for each kind of base, and what their YAML sections hold.

Each tells at least what a differential drive tells of its wheels, so that tools which need no more work with all.
"""

from typing import Dict, NamedTuple, Tuple, Type, Union

THREE_WHEELS_DEG = (60.0, 180.0, 300.0)
"""Where motors 1, 2 and 3 of the motor board sit in its omnidirectional mode, counter-clockwise from forward."""


class Drive(NamedTuple):
    """Differential drive as the odometry needs it: two wheels, or tracks."""

    wheel_separation_m: float
    metres_per_count: float
    """Mean of both wheels."""
    wheel_offset: float = 0.0
    """The thesis's Cm: the right wheel's metres per count less the left's, as a share of their mean."""
    turn_slip: float = 0.0
    """The thesis's Cs: share of the yaw that tracks lose to the floor in a turn."""

    @property
    def right_m_per_count(self) -> float:
        """Way of the right wheel for one count."""
        return self.metres_per_count * (1 + self.wheel_offset / 2)

    @property
    def left_m_per_count(self) -> float:
        """Way of the left wheel for one count."""
        return self.metres_per_count * (1 - self.wheel_offset / 2)

    @property
    def turning_separation_m(self) -> float:
        """Distance of wheels that do not slip and turn the robot as much."""
        return self.wheel_separation_m / (1 - self.turn_slip)


class OmniDrive(NamedTuple):
    """Three wheels with rollers, 120 deg apart, each rolling along a circle about the middle."""

    radius_m: float
    """From the middle to where a wheel touches the ground."""
    metres_per_count: float
    full_speed_m_s: float
    """Of a wheel, at the motor board's 100 %."""
    angles_deg: Tuple[float, float, float] = THREE_WHEELS_DEG
    """Where the wheels of motors 1, 2 and 3 sit, counter-clockwise from forward."""
    turn_slip: float = 0.0
    """Share of the yaw that is lost to the floor in a turn."""

    @property
    def wheel_separation_m(self) -> float:
        """That of a differential drive whose wheels run as fast when it turns."""
        return 2 * self.radius_m

    @property
    def right_m_per_count(self) -> float:
        """Way of the right wheel, and of any other, for one count."""
        return self.metres_per_count

    @property
    def left_m_per_count(self) -> float:
        """Way of the left wheel, and of any other, for one count."""
        return self.metres_per_count

    @property
    def turning_separation_m(self) -> float:
        """`wheel_separation_m` of wheels that do not slip and turn the robot as much."""
        return self.wheel_separation_m / (1 - self.turn_slip)


class MecanumDrive(NamedTuple):
    """Four wheels with rollers at 45 deg, at the corners of a rectangle."""

    half_length_m: float
    """From the middle forward to the front axle (L)."""
    half_width_m: float
    """From the middle to the left wheels (w)."""
    wheel_radius_m: float
    counts_per_turn: float
    """Encoder counts for a turn of a wheel."""
    full_speed_m_s: float
    """Of a wheel."""
    turn_slip: float = 0.0
    """Share of the yaw that is lost to the floor in a turn."""

    @property
    def metres_per_count(self) -> float:
        """Way of a wheel for one count."""
        return 6.283185307179586 * self.wheel_radius_m / self.counts_per_turn

    @property
    def wheel_separation_m(self) -> float:
        """That of a differential drive whose wheels run as fast when it turns."""
        return 2 * (self.half_length_m + self.half_width_m)

    @property
    def right_m_per_count(self) -> float:
        """Way of a right wheel, and of any other, for one count."""
        return self.metres_per_count

    @property
    def left_m_per_count(self) -> float:
        """Way of a left wheel, and of any other, for one count."""
        return self.metres_per_count

    @property
    def turning_separation_m(self) -> float:
        """`wheel_separation_m` of wheels that do not slip and turn the robot as much."""
        return self.wheel_separation_m / (1 - self.turn_slip)


Base = Union[Drive, OmniDrive, MecanumDrive]
DIFFERENTIAL, TRACKED, OMNI, MECANUM = "differential", "tracked", "omni", "mecanum"
KINDS: Dict[str, Type[tuple]] = {DIFFERENTIAL: Drive, TRACKED: Drive, OMNI: OmniDrive, MECANUM: MecanumDrive}
"""What the `kind` of a `drive` section may be."""
EXTRA = {TRACKED: ("turn_slip",)}
"""Keys that are optional in general, and that this kind needs."""


def kind_of(drive: Base) -> str:
    """Which of `KINDS` it is; tracks are those that slip."""
    if isinstance(drive, OmniDrive):
        return OMNI
    if isinstance(drive, MecanumDrive):
        return MECANUM
    return TRACKED if drive.turn_slip else DIFFERENTIAL
