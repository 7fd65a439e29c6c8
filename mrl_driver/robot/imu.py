"""Readings of an IMU next to the motor board: turned into base_link, checked, given to the heading filter.  No I/O."""

import math
from typing import FrozenSet, NamedTuple, Optional, Tuple

from mrl_driver.geometry import wrap_angle
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.table import INT16_MAX
from mrl_driver.session.events import GYRO_RAD_S, ImuChanged, ImuReading

from .heading import SILENT_S, HeadingFilter
from .models import RobotModel
from .odometry import Odometry

ABSENT, OFF, WAITING, LEARNING, IN_USE = "absent", "off", "waiting", "learning bias", "in use"
SILENT, FROZEN, OUT_OF_SCALE, TILTED = "silent", "frozen", "out of scale", "tilted"
_UNUSED = (
    (ABSENT, "imu_dead", "the board reports no IMU any more"),
    (SILENT, "imu_dead", "no reading of the IMU for 0.1 s"),
    (FROZEN, "imu_frozen", "the IMU repeats the same reading"),
    (OUT_OF_SCALE, "imu_wrong", "the IMU's reading is out of scale"),
    (TILTED, "imu_tilted", "gravity is more than 30 deg from the IMU's vertical axis"),
)
"""States in which the gyro is not used, with their codes in `problems` and their causes."""
CODES = {state: code for state, code, _ in _UNUSED}
CAUSES = {state: cause for state, _, cause in _UNUSED}
REASONS = {state: f"{cause}: {PROBLEMS[code].remedy}" for state, code, cause in _UNUSED}
"""Why the gyro is not used, and what to do."""
STATES = (OFF, WAITING, LEARNING, IN_USE, *REASONS)
"""`absent`: the board reports no IMU.  `off`: its stream is not started (option `imu_period_ms`, or no checksums).
`waiting`: no reading yet.  `learning bias`: the wheels give the heading until the robot has stood still for half a
second.  `in use`: the heading comes from gyro and wheels.  The others are the reasons why the gyro is not used."""

REPEATS = 2
"""A reading that repeats this many times in all six numbers is frozen: noise changes some number of each reading."""
FULL_SCALE_RAD_S = INT16_MAX * GYRO_RAD_S
_GOOD = (LEARNING, IN_USE)
LEAST_M_S2, MOST_M_S2 = 5.0, 15.0  # bounds of the mean acceleration, which is that of gravity (9.8 m/s2)
UPRIGHT = math.cos(math.radians(30))
"""The mean acceleration is at most 30 deg from the vertical: an inverted chip reverses the turns."""
MEAN_S = 1.0  # time constant of the mean acceleration [s]: longer than the robot's own accelerations
START_S = 1.0  # the first reading comes within this time [s]
RECOVERY_S = 0.5  # after a problem, the readings must be good for this time before they are used again [s]

Vector = Tuple[float, float, float]


class Imu(NamedTuple):
    """One reading of the IMU in the axes of base_link, and the heading."""

    stamp_s: float  # time of the reading [s, clock of `time.monotonic()`]
    angular_velocity_rad_s: Vector  # as measured: the bias is in it; z has the scale of the model
    linear_acceleration_m_s2: Vector  # as measured: at rest that of gravity, upward
    yaw_rad: float
    """Heading of gyro and wheels at `stamp_s`, in the odom frame; of the wheels alone while the gyro is not used."""
    yaw_variance_rad2: float
    bias_rad_s: float  # bias of the gyro about the vertical axis, learned while the robot stands
    bias_sd_rad_s: float  # standard deviation of `bias_rad_s`
    bias_known: bool  # the robot has stood still once, so that `bias_rad_s` is measured
    state: str  # one of `STATES`
    reading: ImuReading  # the reading itself, in the axes of the chip


class ImuTracker:
    """Checks the readings of one IMU and gives the good ones to the heading filter."""

    def __init__(self, model: RobotModel) -> None:
        self._mount = model.imu
        self._turned = any((model.imu.roll_deg, model.imu.pitch_deg, model.imu.yaw_deg))
        self.heading = HeadingFilter()  # the filter; its `turn` is called by the odometry
        self.state = WAITING  # one of `STATES`
        self.last: Optional[Imu] = None  # the last reading; None before the first
        self._told = IN_USE
        self.changed: Optional[ImuChanged] = None  # the event of the last reading; None if there is none
        self._values: Tuple[Vector, Vector] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._repeats = 0
        self._mean: Optional[Vector] = None
        self._time_s = self._good_s = -math.inf
        """Board time of the last reading, and since when the readings are good [s]; infinity while they are not."""

    def reset(self) -> None:
        """The board restarted: its time begins again.  The odometry resets `heading`."""
        self.state = WAITING
        self._repeats, self._mean = 0, None
        self._time_s = self._good_s = -math.inf

    def update(self, reading: ImuReading, counted_s: float, odometry: Odometry) -> Imu:
        """Process a reading; `counted_s` is the board time of the odometry's last reading."""
        rate, accel = reading.gyro_rad_s, reading.accel_m_s2
        if self._turned:
            rate, accel = self._mount.rotate(rate), self._mount.rotate(accel)
        rate = (rate[0], rate[1], rate[2] * self._mount.gyro_scale)
        time_s = reading.time_s
        problem = self._problem(reading, accel, time_s - self._time_s)
        self._time_s = time_s
        if problem:
            self._fail(problem)
        elif self.state not in _GOOD:
            self._recover(time_s)
        heading, yaw_rad, uncertainty = self.heading, odometry.pose.yaw_rad, odometry.uncertainty
        if self.state in _GOOD:
            heading.on_imu(time_s, rate[2])
            self.state = IN_USE if heading.bias_known else LEARNING
        if self.state == IN_USE:
            ahead_s = time_s - counted_s
            if -SILENT_S < ahead_s < SILENT_S:  # the odometry is some milliseconds older or newer
                yaw_rad += (rate[2] - heading.bias_rad_s) * ahead_s
        self.last = Imu(
            reading.stamp_s,
            rate,
            accel,
            wrap_angle(yaw_rad),
            uncertainty.spread[5] if uncertainty is not None else math.inf,
            heading.bias_rad_s,
            math.sqrt(heading.bias_variance),
            heading.bias_known,
            self.state,
            reading,
        )
        self.changed = None if self.state in (self._told, LEARNING) else self._news()
        return self.last

    def check(self, time_s: float) -> Optional[ImuChanged]:
        """Notice that the readings have ended; `time_s` is the present board time."""
        age_s = time_s - self._time_s
        if age_s <= SILENT_S or self.state not in (*_GOOD, WAITING):
            return None
        if age_s == math.inf:
            self._time_s = time_s
        elif self.state != WAITING or age_s > START_S:
            self._fail(SILENT)
            return self._news()
        return None

    def end(self) -> Optional[ImuChanged]:
        """The board reports no IMU any more, or does not read it."""
        if self.state == ABSENT:
            return None
        self._fail(ABSENT)
        return self._news()

    def _news(self) -> Optional[ImuChanged]:
        """Return an event if the gyro is not used, or for another reason, or again, unlike before."""
        state = self.state
        if state in (WAITING, LEARNING, self._told):
            return None
        self._told = state
        if state == IN_USE:
            return ImuChanged(True, state, "the heading comes from gyro and wheels again")
        return ImuChanged(False, state, f"the heading comes from the wheels alone: {REASONS[state]}")

    def _recover(self, time_s: float) -> None:
        """A good reading after a problem, or the first one."""
        if self._good_s == math.inf:
            self._good_s = time_s
        if time_s - self._good_s >= RECOVERY_S:
            self.state = LEARNING

    def _fail(self, problem: str) -> None:
        if self.state in _GOOD:
            self.heading.lose()
        self.state, self._good_s = problem, math.inf

    def _problem(self, reading: ImuReading, accel: Vector, dt_s: float) -> str:
        """Return what is wrong with a reading, or with the mean of the acceleration, or an empty string.

        `accel` is that of the reading in base_link, `dt_s` the time since the last reading.
        """
        values = reading[3:]
        self._repeats = self._repeats + 1 if values == self._values else 0
        self._values = values
        if self._repeats >= REPEATS:
            return FROZEN
        x, y, z = reading.gyro_rad_s
        full = FULL_SCALE_RAD_S
        if not (-full < x < full and -full < y < full and -full < z < full):
            return OUT_OF_SCALE
        x, y, z = self._mean or accel
        share = min(1.0, max(0.0, dt_s) / MEAN_S)
        x, y, z = x + share * (accel[0] - x), y + share * (accel[1] - y), z + share * (accel[2] - z)
        self._mean = x, y, z
        length = math.sqrt(x * x + y * y + z * z)
        if not LEAST_M_S2 <= length <= MOST_M_S2:
            return OUT_OF_SCALE
        return "" if z >= UPRIGHT * length else TILTED


def state_of(tracker: Optional[ImuTracker], capabilities: FrozenSet[str]) -> str:
    """Return the state of the IMU of a board with these capabilities, one of `STATES`."""
    if tracker is not None:
        return tracker.state
    return OFF if "imu" in capabilities else ABSENT
