"""Heading from a gyro and the wheels.  No I/O: rates and counts' turns go in, turns come out.

The gyro's rate minus its bias is integrated between the readings (trapezoid).  The counts of the wheels are read at
other times; up to their time the last rate counts as constant for `HOLD_S`, and the turn by the wheels comes after
that.  The next reading corrects this in the next turn.  So the pose never jumps: each source only gives the next
increment, and a robot that loses its gyro continues with its wheels.

The bias is learned while the robot stands: its wheels do not move and the rate is steady for `STAND_S`.  It is a
random walk, estimated by a scalar Kalman filter.  While the robot stands, its heading does not change.  If a robot
is turned by hand, the rate is not steady or too far from the bias: that is a turn.  Until the first stand, the
wheels alone give the heading.
"""

import math
from typing import NamedTuple, Optional

from mrl_driver.protocol.table import BY_NAME

HOLD_S = 0.04
"""The last rate is taken as constant for at most this time after its reading [s]: two periods of the stream."""
SILENT_S = 0.1  # without a reading for longer than this, the wheels alone give the heading [s]
STAND_S, LEAST_READINGS = 0.5, 10
"""The bias is the mean of the readings in this time [s], if there are at least this many."""
STEADY_RAD_S = 0.01
"""Rates of a standing robot differ by less than this [rad/s]: ten times the noise of an MPU-6050 at 42 Hz."""
ZERO_RATE_RAD_S = math.radians(20.0)
"""Largest bias of a new chip [rad/s] (data sheet of the MPU-6050: zero-rate output)."""
BIAS_WALK = math.radians(0.001)
"""Random walk of the bias [rad/s/sqrt(s)]; estimated, mainly from its change with temperature."""
UNUSUAL_STANDS = 10
"""After this many stands in a row with a bias that is too far from the known one, the new one is learned (5 s)."""
FILTER_DELAY_S = 0.007
"""Age of the rate in a reading [s]: 4.8 ms in the filter of 42 Hz (data sheet), and half a sample of 200 Hz."""
UNSEEN_SHARE = 0.09
"""Share of the square of a bend of the rate that is an error of the angle: a sixth of it is the variance of a rate that
jitters, and about half of that jitter is too fast for readings at 50 Hz behind a filter of 42 Hz."""
UNSEEN_S = 60.0  # a restart of the board adds as much doubt about the bias as this time does
_GYRO = next(field for field in BY_NAME["read_imu"].reply if field.name == "gyro_z")
_ROUNDING = float(_GYRO.unit.split()[0]) ** 2 / 12  # variance of a rate by rounding to whole counts [rad2/s2]


class KnownBias(NamedTuple):
    """A bias that was learned while the robot stood."""

    bias_rad_s: float
    variance: float  # variance of the bias [rad2/s2]
    noise_rad2_s: float  # growth of the yaw's variance by the gyro's noise [rad2/s]


class HeadingFilter:
    """Turns of one robot by gyro and wheels.

    Times are board times [s].  Readings and turns each come in order of time, but a reading may arrive before or after
    a turn of nearly the same time.
    """

    _rate: float  # of the last reading [rad/s]
    _former: float  # of the one before [rad/s]

    def __init__(self) -> None:
        self.bias_rad_s = 0.0
        self.bias_known = False
        self.in_use = False  # the last turn is that of the gyro
        self.noise_rad2_s = 0.0
        """Growth of the yaw's variance by the gyro's noise [rad2/s]; measured at each stand."""
        self._variance = ZERO_RATE_RAD_S**2
        self.kept = 1.0
        """Share of the bias's error that its measurements have left since a user of this number set it to 1."""
        self.unseen_rad2 = 0.0
        """Variance of the yaw by motion between the readings, since a user of this number set it to 0."""
        self._angle = self._given = 0.0
        self._begin()

    def reset(self) -> None:
        """Board time begins again.  The bias stays, with more doubt."""
        self._variance = self.bias_variance + BIAS_WALK**2 * UNSEEN_S
        self._begin()

    def _begin(self) -> None:
        self._time_s: Optional[float] = None
        self._turned_s: Optional[float] = None
        self._learned_s = 0.0
        self._unusual = 0

    def resume(self, bias: "KnownBias") -> None:
        """Go on with a bias that was learned before, instead of waiting for the first stand."""
        self.bias_rad_s, self._variance, self.noise_rad2_s = bias
        self.bias_known = True

    @property
    def known_bias(self) -> Optional["KnownBias"]:
        """What `resume` needs; None before the first stand."""
        return KnownBias(self.bias_rad_s, self.bias_variance, self.noise_rad2_s) if self.bias_known else None

    def lose(self) -> None:
        """The readings are not to be believed: the wheels alone, until the next reading."""
        self._time_s = None
        self.in_use = False

    @property
    def bias_variance(self) -> float:
        """Variance of the bias [rad2/s2]; grows with the time since the last stand."""
        since_s = (self._time_s or 0.0) - self._learned_s
        return self._variance + BIAS_WALK**2 * max(0.0, since_s)

    @property
    def bias_sd_rad_s(self) -> float:
        """Standard deviation of the bias."""
        return math.sqrt(self.bias_variance)

    def on_imu(self, time_s: float, gyro_z_rad_s: float) -> None:
        """Process a reading: the rate about the vertical axis of base_link, to scale."""
        time_s -= FILTER_DELAY_S
        last_s = self._time_s
        step_s = math.inf if last_s is None else time_s - last_s
        if 0.0 < step_s <= SILENT_S:
            self._angle += ((gyro_z_rad_s + self._rate) / 2 - self.bias_rad_s) * step_s
            bend = gyro_z_rad_s - 2 * self._rate + self._former
            self.unseen_rad2 += UNSEEN_SHARE * bend * bend * step_s * step_s
        elif -SILENT_S < step_s <= 0.0:
            return  # one that has come twice, or out of order
        else:
            if step_s < 0.0:
                self.reset()  # of a board that began again
            self._joined = self._resting = False
            self._begin_stand()
            self._rate = gyro_z_rad_s
        self._time_s, self._rate, self._former, self._beyond = time_s, gyro_z_rad_s, self._rate, 0.0
        turned_s = self._turned_s
        if turned_s is None or time_s - turned_s > SILENT_S:
            self._begin_stand()  # the wheels may move unseen
        else:
            self._watch(time_s, gyro_z_rad_s)

    def turn(self, time_s: float, wheel_turn_rad: float, moved: bool) -> float:
        """Return the turn since the last call: that of the gyro, or else that of the wheels.

        `time_s` is the time of the counts, and `moved` says that a wheel has moved since the last call.
        """
        since_s, self._turned_s = self._turned_s, time_s
        if moved:
            self._resting = False
            self._begin_stand()
        read_s = self._time_s
        if read_s is None or not self.bias_known or since_s is None or abs(time_s - read_s) > SILENT_S:
            self._joined = self.in_use = False
            return wheel_turn_rad
        rate, age_s = self._rate - self.bias_rad_s, time_s - read_s
        if age_s > HOLD_S:
            if time_s > since_s:
                begin_s = max(since_s, read_s + HOLD_S)
                self._beyond += wheel_turn_rad * (time_s - begin_s) / (time_s - since_s)
            age_s = HOLD_S
        given, self._given = self._given, self._angle + rate * age_s + self._beyond
        if not self._joined:
            self._joined = True
            return wheel_turn_rad
        self.in_use = True
        if self._resting:
            self.unseen_rad2 = 0.0
            return 0.0
        return self._given - given

    # -- standing

    def _begin_stand(self) -> None:
        self._readings, self._sum, self._squares = 0, 0.0, 0.0
        self._low, self._high = math.inf, -math.inf

    def _watch(self, time_s: float, rate: float) -> None:
        """Process a reading that may belong to a stand."""
        low, high = min(self._low, rate), max(self._high, rate)
        if high - low > STEADY_RAD_S:
            self._resting = False
            self._begin_stand()
            low = high = rate
        if not self._readings:
            self._first_s = time_s
        self._low, self._high = low, high
        self._readings += 1
        off = rate - self.bias_rad_s
        self._sum += off
        self._squares += off * off
        if time_s - self._first_s >= STAND_S and self._readings >= LEAST_READINGS:
            self._stood(time_s)
            self._begin_stand()

    def _stood(self, time_s: float) -> None:
        """The rate was steady for a while: it is the bias, or a steady turn."""
        count, mean = self._readings, self._sum / self._readings
        variance = max((self._squares - count * mean * mean) / (count - 1), _ROUNDING)
        period_s = (time_s - self._first_s) / (count - 1)
        prior, doubt = self.bias_variance, max(variance / count, _ROUNDING)
        unusual = abs(mean) > max(STEADY_RAD_S, 4 * math.sqrt(prior + doubt))
        if abs(mean + self.bias_rad_s) > ZERO_RATE_RAD_S or (unusual and self._unusual < UNUSUAL_STANDS):
            self._resting = False
            self._unusual += 1
            return
        if unusual:
            prior = ZERO_RATE_RAD_S**2
        self._unusual = 0
        gain = prior / (prior + doubt)
        self.bias_rad_s += gain * mean
        self._variance, self._learned_s = (1 - gain) * prior, time_s
        self.kept *= 1 - gain
        noise = variance * period_s
        self.noise_rad2_s += (noise - self.noise_rad2_s) * (0.1 if self.bias_known else 1.0)
        self.bias_known = self._resting = True
