"""Pose and twist from wheel counts, and from the turn by a gyro if there is one, by exact arcs.  No I/O: counts and
seconds go in, poses come out.

Poses are in the odom frame (x forward at the start, y left, yaw counter-clockwise); twists are in base_link.
"""

import math
from typing import Any, Dict, NamedTuple, Optional, Sequence, Tuple, Type, Union

from mrl_driver.geometry import ORIGIN, Pose, advance
from mrl_driver.protocol.frames import to_int16

from .covariance import AT_START, TWIST_INTERVAL_S, Spread, Uncertainty
from .heading import HeadingFilter
from .kinematics import kinematics_of
from .models import RobotModel
from .models.drives import Base, metres_per_count

SPEED_MARGIN = 1.5  # counts are refused if a wheel seems faster than the board's ceilings times this factor
QUANTUM_COUNTS = 3
"""Counts that a wheel may move in zero time: rounding of both readings, and one count of jitter."""
SLACK_S = {True: 0.002, False: 0.1}
"""The true time between two readings may exceed the stated one by this [s]; key: the times come from the board."""
NEAR_S = 0.02  # arrival times cannot show a time shorter than this [s]
RESTART_S = 0.06
"""The motor board may have lost its power, and its counters, in a gap between two readings that is longer than this and
the slack [s]; the slowest stream has a frame every 0.05 s."""
CONFIRMATIONS = 3
"""This many readings in a row that agree with each other, but not with the baseline, make a new baseline."""
DITHER_COUNTS = 1  # the counter of a wheel that stands may change by this much


class Twist(NamedTuple):
    """Speeds in base_link."""

    linear_m_s: float
    angular_rad_s: float

    @property
    def lateral_m_s(self) -> float:
        """Speed to the left: always zero, because the wheels prevent it."""
        return 0.0


class OmniTwist(NamedTuple):
    """Speeds in base_link of a robot that can also move sideways."""

    linear_m_s: float
    angular_rad_s: float
    lateral_m_s: float  # speed to the left


class Wheels(NamedTuple):
    """One number for each wheel; the unit depends on the use."""

    right: float
    left: float


class OmniWheels(NamedTuple):
    """One number for each of three wheels."""

    right: float
    left: float
    rear: float


class FourWheels(NamedTuple):
    """One number for each of four wheels."""

    right: float
    left: float
    rear_left: float
    rear_right: float


AnyTwist = Union[Twist, OmniTwist]
AnyWheels = Union[Wheels, OmniWheels, FourWheels]
WHEELS_BY_COUNT: Dict[int, Type[AnyWheels]] = {2: Wheels, 3: OmniWheels, 4: FourWheels}


_NOTHING = (0.0, 0.0, 0.0)
_new = tuple.__new__  # a named tuple without a call in Python

Reading = Tuple[Any, ...]  # counters of all wheels (int16), and the time of the reading [s]
Step = Tuple[Any, ...]
"""Movement of all wheels between two accepted readings [count], and the time between them [s]."""


def fastest_wheel_m_s(linear_m_s: float, angular_rad_s: float, wheel_separation_m: float) -> float:
    """Return the speed that no wheel exceeds [m/s]: both ceilings of the board together, times `SPEED_MARGIN`."""
    return SPEED_MARGIN * (linear_m_s + angular_rad_s * wheel_separation_m / 2)


class Baseline:
    """Decides which readings of two or more counters are used.

    The first reading is the baseline.  A reading that no wheel could have reached is refused and the baseline stays,
    so the next good reading covers the gap.  If `CONFIRMATIONS` readings in a row agree with each other instead (a
    counter was preset, the motor board restarted), they become the baseline and the jump is never integrated.  The same
    holds after a gap for counters that are near zero again, also if the wheels could have turned back in this time.

    Two more rules apply to arrival times (`slack_s` above `NEAR_S`).  Frames may arrive in bursts, so a jump within the
    slack is integrated after it is confirmed, except a jump to near zero, which is a restart.  If a reading returns to
    the value before the last one, the last one was wrong; any single reading without a checksum may be wrong.
    """

    def __init__(self, metres_per_count: float, fastest_m_s: float, slack_s: float) -> None:
        self._counts_per_s = fastest_m_s / metres_per_count
        self._slack = self._counts_per_s * slack_s
        self._bunched, self._gap_s = slack_s > NEAR_S, RESTART_S + slack_s
        self._base: Optional[Reading] = None
        self._former: Optional[Reading] = None
        self._rival: Optional[Reading] = None
        self._agreed = 0
        self.coast_s = math.inf  # the wheels stand still at most this long after the last reading [s]
        self.refused = 0  # number of refused readings
        self.primed = 0  # number of new baselines; the movement before a new baseline is unknown

    def reset(self) -> None:
        """Use the next reading as the new baseline."""
        self._base = self._former = self._rival = None

    def update(self, *reading: Any) -> Optional[Step]:
        """Return the movement since the last accepted reading; None if this one is a new baseline or is refused.

        A reading is the counters, followed by their time [s].
        """
        base = self._base
        if base is None:
            self._base = reading
            self.primed += 1
            return None
        dt_s = reading[-1] - base[-1]
        reach = self._counts_per_s * (dt_s if dt_s < self.coast_s else self.coast_s)
        moved = []
        for new, old in zip(reading[:-1], base):
            moved.append(((new - old + 0x8000) & 0xFFFF) - 0x8000)
        step: Optional[Step]
        if dt_s > self._gap_s and self._begins_again(base, reading):
            step = self._doubt(base, reading)
        elif dt_s >= 0.0 and -reach <= min(moved) and max(moved) <= reach < 0x8000:  # well within any bound
            step = (*moved, dt_s)
        else:
            step = self._step(base, reading) or self._way_back(base, reading) or self._doubt(base, reading)
        if step is not None:
            self._former, self._base, self._rival = base, reading, None
        return step

    def _begins_again(self, base: Reading, reading: Reading) -> bool:
        """Return whether the counters may have begun at zero again between two readings, after a gap."""
        largest, before = max(map(abs, reading[:-1])), max(map(abs, base[:-1]))
        return largest < before - QUANTUM_COUNTS and largest <= QUANTUM_COUNTS + self._counts_per_s * NEAR_S

    def _reach(self, dt_s: float) -> float:
        """Return the largest distance of a wheel in a time [count]; infinity if its counter may have wrapped."""
        reach = self._counts_per_s * min(max(dt_s, 0.0), self.coast_s)
        return reach if reach < 0x8000 else math.inf

    def _bound(self, dt_s: float) -> float:
        """Return the largest allowed distance between two readings [count]; -inf if a counter may have wrapped."""
        reach = self._reach(dt_s)
        if reach == math.inf:
            return -math.inf
        return QUANTUM_COUNTS + (
            max(reach, self._counts_per_s * NEAR_S) if self._bunched else reach + self._slack
        )

    def _step(self, base: Reading, reading: Reading) -> Optional[Step]:
        """Return the movement since `base`; None if no wheel could have made it."""
        step = _between(base, reading)
        return step if _largest(step) <= self._bound(step[-1]) else None

    def _way_back(self, base: Reading, reading: Reading) -> Optional[Step]:
        """Return the movement since `base` if `base` was a single wrong reading; otherwise None."""
        if not self._bunched or self._former is None:
            return None
        step, since_former = _between(base, reading), _between(self._former, reading)
        return step if _largest(since_former) <= self._bound(step[-1]) else None

    def _doubt(self, base: Reading, reading: Reading) -> Optional[Step]:
        """Refuse an impossible reading, unless it is the last of several that agree with each other."""
        self.refused += 1
        agrees = self._rival is not None and self._step(self._rival, reading) is not None
        self._agreed = self._agreed + 1 if agrees else 1
        self._rival = reading
        if self._agreed < CONFIRMATIONS:
            return None
        step = _between(base, reading)
        reach, near = self._reach(step[-1]), self._bound(step[-1])
        restarted = max(map(abs, reading[:-1])) <= near
        if self._bunched and not restarted and _largest(step) <= reach + self._slack < 0x8000:
            return step
        self.reset()
        self._base = reading
        self.primed += 1
        return None


def _between(base: Reading, reading: Reading) -> Step:
    """Return movement and time from one reading to another; counters may wrap."""
    *counts, time_s = reading
    moved = [to_int16(new - old) for new, old in zip(counts, base)]
    return (*moved, time_s - base[-1])


def _largest(step: Step) -> int:
    """Return the distance of the wheel that moved farthest [count]."""
    return max(map(abs, step[:-1]))


class Odometry:
    """Pose and twist of a differential drive from its counters.

    `exact_time` says that the times come from the board; otherwise they are arrival times, which come in bursts.
    """

    def __init__(self, drive: Base, fastest_m_s: float, exact_time: bool = True) -> None:
        self._forward = Wheels(*(each / 2 for each in metres_per_count(drive, Wheels._fields)))
        self._turning = Wheels(*(2 * half_m / drive.turning_separation_m for half_m in self._forward))
        self._interval_s = 0.0 if exact_time else TWIST_INTERVAL_S
        self._waiting = _NOTHING
        self.baseline = Baseline(drive.metres_per_count, fastest_m_s, SLACK_S[exact_time])
        self.pose = ORIGIN
        self.heading: Optional[HeadingFilter] = None
        """Filter that fuses the turn by the wheels with a gyro's; None without a gyro."""
        self.uncertainty: Optional[Uncertainty] = None
        """Estimates the covariance of pose and twist; None if nobody needs it."""
        self._stood: Sequence[float] = (0, 0)
        self.twist: AnyTwist = Twist(0.0, 0.0)
        self.travel: AnyWheels = Wheels(0, 0)  # counts of each wheel since the start, without wrap

    def reset(self) -> None:
        """The board restarted: the next reading is a new baseline; the pose does not change."""
        self.baseline.reset()
        self.twist = Twist(0.0, 0.0)
        self._waiting = _NOTHING
        if self.heading is not None:
            self.heading.reset()

    def set_pose(self, pose: Pose, spread: Spread = AT_START) -> None:
        """Continue from `pose`, which has the covariance `spread`; counters and speeds do not change."""
        self.pose = pose
        if self.uncertainty is not None:
            self.uncertainty.reset(spread)

    def update(self, right: int, left: int, time_s: float, *_: int) -> bool:
        """Integrate a reading (int16 counts) of time `time_s` [s]; False if it is a new baseline or is refused."""
        step = self.baseline.update(right, left, time_s)
        if step is None:
            return False
        right, left, dt_s = step
        if right or left:
            travel = self.travel
            self.travel = _new(Wheels, (travel[0] + right, travel[1] + left))
            ds = right * self._forward[0] + left * self._forward[1]
            turn = right * self._turning[0] - left * self._turning[1]
        else:
            ds = turn = 0.0
        heading, gyro = self.heading, None
        if heading is not None:
            turn = heading.turn(time_s, turn, self._rolled())
            gyro = heading if heading.in_use else None
        before, uncertainty = self.pose, self.uncertainty
        if ds or turn:
            self.pose = advance(before, ds, turn)
        if uncertainty is not None and (right or left or turn):
            wheels_m = 2 * right * self._forward[0], 2 * left * self._forward[1]
            uncertainty.update(before, self.pose, wheels_m, turn, dt_s, gyro)
        elif uncertainty is not None:
            uncertainty.stand(dt_s, gyro)
        if dt_s > self._interval_s and self._waiting is _NOTHING:
            self.twist = _new(Twist, (ds / dt_s, turn / dt_s))
        else:
            self._differentiate(ds, turn, dt_s)
        return True

    def _rolled(self) -> bool:
        """Return whether a wheel has moved since the last call; a counter between two values may change by one."""
        for now, stood in zip(self.travel, self._stood):
            if not -DITHER_COUNTS <= now - stood <= DITHER_COUNTS:
                self._stood = self.travel
                return True
        return False

    def _differentiate(self, ds: float, turn: float, dt_s: float) -> None:
        """Compute the speeds, together with earlier readings that were too close in time."""
        ds, turn, dt_s = self._waiting[0] + ds, self._waiting[1] + turn, self._waiting[2] + dt_s
        if dt_s <= self._interval_s:
            self._waiting = (ds, turn, dt_s)
            return
        self._waiting = _NOTHING
        self.twist = Twist(ds / dt_s, turn / dt_s)


class NoOdometry(Odometry):
    """What is known of motors without encoders: pose, speeds and counts are NaN."""

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model.base, math.inf)
        self.pose = Pose(math.nan, math.nan, math.nan)
        self.twist = Twist(math.nan, math.nan)
        wheels = len(kinematics_of(model.base).wheels)
        self.travel = WHEELS_BY_COUNT[wheels](*wheels * (math.nan,))
        self.uncertainty = Uncertainty(model, (math.nan,) * 6)
        self.uncertainty.variances = (math.nan,) * 3

    def reset(self) -> None:
        """Nothing was known before either."""

    def update(self, right: int, left: int, time_s: float, *_: int) -> bool:
        """Accept the reading of counters that do not count."""
        return True
