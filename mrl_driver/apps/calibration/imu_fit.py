"""Evaluates what an IMU measured while its robot stood, drove straight and turned: mounting angles, scale of the gyro.

Readings are arrays (N, 8) with the columns `TIME`, `STAMP`, `GYRO`, `ACCEL`: board time [s], time of the host [s], and
rates [rad/s] and accelerations [m/s2] in the axes of the chip.
"""

import math
from typing import NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import GRAVITY_M_S2
from mrl_driver.robot.models import ImuMount

TIME, STAMP, GYRO, ACCEL = 0, 1, slice(2, 5), slice(5, 8)
LEAST_READINGS = 50
STILL_RAD_S, STILL_M_S2 = math.radians(0.5), 0.3
"""Largest standard deviation of the readings of a robot at rest: ten times the noise in the data sheet."""
STEADY_RAD_S = math.radians(0.3)  # largest change of the mean rate from one half of a rest to the other
BIAS_RAD_S = math.radians(25.0)  # largest bias of a gyro; the data sheet of the MPU-6050 says 20 deg/s
GRAVITY_WITHIN_M_S2 = 1.5
"""Largest error of the acceleration at rest; zero offset and scale in the data sheet add up to 1.1."""
LONGEST_GAP_S = 0.25  # longest pause between two readings; over a longer one the angle is not known
FASTEST_RAD_S = math.radians(495.0)  # faster rates may be beyond the range of 500 deg/s
SCALE_WITHIN = 0.1
"""Largest difference of the gyro's scale from 1; three times the tolerance in the data sheet."""
AGREE_WITHIN = 0.02  # largest difference of the scales of two turns
LEAST_SD = 2e-4
"""Smallest standard deviation of the scale: one degree Celsius changes it by as much (data sheet: 2 % from -40 to
85)."""
YAW_SD_RAD, PUSH_WITHIN = math.radians(5.0), 0.5
"""Largest standard deviation of a useful yaw, and largest difference of the measured acceleration from that of the
wheels, as a share of it."""
_LAG_S, _GRID_S = 0.25, 0.01


class Rest(NamedTuple):
    """Means of the readings while the robot stood still, and standard deviations of one reading."""

    time_s: float  # board time in the middle
    gyro_rad_s: np.ndarray
    gyro_sd_rad_s: np.ndarray
    accel_m_s2: np.ndarray
    readings: int

    @property
    def bias_variance(self) -> float:
        """Variance of the mean rate [rad2/s2], of the noisiest axis."""
        return float(self.gyro_sd_rad_s.max()) ** 2 / self.readings


class Turned(NamedTuple):
    """One turn in place, positive counter-clockwise [rad]."""

    gyro_rad: float  # by the gyro, without its bias and before its scale
    sd_rad: float  # standard deviation of `gyro_rad` from the bias
    wheels_rad: float
    true_rad: float

    @property
    def scale(self) -> float:
        """True angle over measured angle."""
        return self.true_rad / self.gyro_rad

    def error_rad(self, scale: float) -> float:
        """Angle of a gyro with this scale minus the true one [rad]."""
        return scale * self.gyro_rad - self.true_rad


def is_still(rows: np.ndarray) -> bool:
    """Return whether the readings are those of a robot at rest."""
    if len(rows) < 2:
        return False
    first, second = np.array_split(rows, 2)
    change = np.abs(first[:, GYRO].mean(axis=0) - second[:, GYRO].mean(axis=0)).max()
    noise = rows.std(axis=0)
    return bool(noise[GYRO].max() < STILL_RAD_S and noise[ACCEL].max() < STILL_M_S2 and change < STEADY_RAD_S)


def rest_of(rows: np.ndarray) -> Rest:
    """Return the means of readings at rest; ConfigError if they are too few, all the same, in motion, or impossible."""
    if len(rows) < LEAST_READINGS:
        raise ConfigError(f"the IMU sent {len(rows)} readings at rest, expected at least {LEAST_READINGS}")
    if not is_still(rows):
        raise ConfigError("the robot moved, expected it to stand still; repeat the calibration")
    if not np.ptp(rows[:, 2:], axis=0).any():
        raise ConfigError("the IMU repeats one reading; check its wires, and switch the robot off and on")
    rest = Rest(
        float(rows[:, TIME].mean()),
        rows[:, GYRO].mean(axis=0),
        rows[:, GYRO].std(axis=0),
        rows[:, ACCEL].mean(axis=0),
        len(rows),
    )
    bias = float(np.abs(rest.gyro_rad_s).max())
    if bias > BIAS_RAD_S:
        raise ConfigError(
            f"the gyro measures {math.degrees(bias):.1f} deg/s at rest, expected at most "
            f"{math.degrees(BIAS_RAD_S):.0f}: the chip is faulty"
        )
    pull = float(np.linalg.norm(rest.accel_m_s2))
    if abs(pull - GRAVITY_M_S2) > GRAVITY_WITHIN_M_S2:
        raise ConfigError(
            f"the IMU measures {pull:.1f} m/s2 at rest, expected {GRAVITY_M_S2:.1f} within {GRAVITY_WITHIN_M_S2:g}: "
            "without gravity its vertical is unknown; the chip is faulty"
        )
    return rest


def levelled(mount: ImuMount, accel_m_s2: Sequence[float]) -> ImuMount:
    """Return the mount with the roll and pitch that turn this acceleration at rest straight up."""
    x, y, z = (float(each) for each in accel_m_s2)
    roll_deg, pitch_deg = math.degrees(math.atan2(y, z)), math.degrees(math.atan2(-x, math.hypot(y, z)))
    return mount._replace(roll_deg=round(roll_deg, 2), pitch_deg=round(pitch_deg, 2))


# -- turns


def angle(
    rows: np.ndarray, mount: ImuMount, before: Rest, after: Optional[Rest] = None
) -> Tuple[float, float]:
    """Return the turn about the vertical without the bias, and its standard deviation from the bias [rad].

    The bias changes evenly from the first rest to the second, and wanders about that line; without a second rest it
    stays as it was.  ConfigError if the board restarted, readings are missing, or the robot was turned too fast.
    """
    times_s, fastest = rows[:, TIME], float(np.abs(rows[:, GYRO]).max())
    if fastest > FASTEST_RAD_S:
        raise ConfigError(
            f"the gyro measured {math.degrees(fastest):.0f} deg/s, the end of its range; repeat the calibration, and "
            "turn the robot more slowly by hand"
        )
    gaps_s = np.diff(times_s)
    if gaps_s.min() <= 0 or gaps_s.max() > LONGEST_GAP_S:
        what = "board time went back" if gaps_s.min() <= 0 else f"readings are {gaps_s.max():.2f} s apart"
        raise ConfigError(
            f"the IMU was interrupted ({what}, expected at most {LONGEST_GAP_S:g} s); repeat the calibration"
        )
    up = np.array([mount.rotate(axis)[2] for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))])
    biases = [float(rest.gyro_rad_s @ up) for rest in (before, after or before)]
    middles_s = (before.time_s, after.time_s if after else times_s[-1])
    rates = rows[:, GYRO] @ up - np.interp(times_s, middles_s, biases)
    turned = float(((rates[1:] + rates[:-1]) / 2 * gaps_s).sum())
    seconds = times_s[-1] - times_s[0]
    wander = (biases[1] - biases[0]) ** 2 / 12  # of a random walk between its two ends
    noise = (before.bias_variance + after.bias_variance) / 4 if after else before.bias_variance
    return turned, float(seconds * math.sqrt(noise + wander))


def true_angle(gyro_rad: float, heading_rad: float, scale: float) -> float:
    """Return the angle with this heading at its end that is nearest to the gyro's [rad]."""
    return heading_rad + math.tau * round((scale * gyro_rad - heading_rad) / math.tau)


def require_agreement(turn: Turned, earlier: Sequence[Turned], heading_sd_rad: float, name: str) -> None:
    """Raise ConfigError if a turn contradicts the wheels, the data sheet, or earlier turns."""
    degrees = [math.degrees(each) for each in (turn.gyro_rad, turn.wheels_rad, turn.true_rad)]
    if turn.gyro_rad * turn.wheels_rad <= 0 or abs(turn.gyro_rad) < abs(turn.wheels_rad) / 2:
        raise ConfigError(
            f"{name}: the gyro turned {degrees[0]:.0f} deg and the wheels {degrees[1]:.0f} deg, expected the same "
            "direction; run mrl calibrate wiring"
        )
    doubt = 3 * math.hypot(turn.sd_rad, heading_sd_rad) / abs(turn.gyro_rad)
    expected, within = (
        (scale_of(earlier, heading_sd_rad)[0], AGREE_WITHIN) if earlier else (1.0, SCALE_WITHIN)
    )
    if abs(turn.scale - expected) > within + doubt:
        raise ConfigError(
            f"{name}: the gyro turned {degrees[0]:.1f} deg and the robot {degrees[2]:.1f} deg, a scale of "
            f"{turn.scale:.3f}, expected {expected:.3f} within {within + doubt:.3f}; the heading is positive "
            "counter-clockwise"
        )


def scale_of(turns: Sequence[Turned], heading_sd_rad: float) -> Tuple[float, float]:
    """Return the scale of the gyro and its standard deviation, from turns whose ends were measured so well.

    The deviation is that of the measurements, or that of the turns among each other if it is larger.
    """
    gyro = np.array([turn.gyro_rad for turn in turns])
    scales = np.array([turn.scale for turn in turns])
    weights = gyro**2 / (heading_sd_rad**2 + np.array([turn.sd_rad for turn in turns]) ** 2)
    scale, variance = float(np.average(scales, weights=weights)), float(1 / weights.sum())
    if len(turns) > 1:
        among = float(weights @ (scales - scale) ** 2) / (len(turns) - 1) / weights.sum()
        variance = max(variance, float(among))
    return scale, max(LEAST_SD, math.sqrt(variance))


# -- straight drives


class Push(NamedTuple):
    """Smoothed accelerations of a straight drive from rest to rest: (M,) by the wheels, (M, 2) by the IMU [m/s2]."""

    wheels_m_s2: np.ndarray
    imu_m_s2: np.ndarray  # along x and y, after roll and pitch


def push_of(rows: np.ndarray, mount: ImuMount, way: np.ndarray) -> Push:
    """Return the accelerations of a straight drive, smoothed in the same way; the yaw of the mount does not matter.

    `way` is (K, 2): host's time [s], and distance by the wheels, forward positive [m].
    """
    flat = mount._replace(yaw_deg=0.0)
    level = np.array([flat.rotate((x, y, z))[:2] for x, y, z in rows[:, ACCEL].tolist()])
    stamps_s = rows[:, STAMP]
    begin_s, end_s = max(stamps_s[0], way[0, 0]), min(stamps_s[-1], way[-1, 0])
    fine_s = np.arange(begin_s, end_s, _GRID_S)
    speeds = np.stack(
        [_integral(np.interp(fine_s, stamps_s, axis)) for axis in (level - level.mean(axis=0)).T]
    )
    ways_m = [np.interp(fine_s, way[:, 0], way[:, 1]), *(_integral(speed) for speed in speeds)]
    wheels, x, y = (_second_difference(each) for each in ways_m)
    return Push(wheels, np.stack((x, y), axis=1))


def _integral(values: np.ndarray) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum((values[1:] + values[:-1]) / 2))) * _GRID_S


def _second_difference(values: np.ndarray) -> np.ndarray:
    """Return the second derivative, averaged over `_LAG_S` to both sides with the weights of a triangle."""
    lag = round(_LAG_S / _GRID_S)
    found: np.ndarray = (values[2 * lag :] - 2 * values[lag:-lag] + values[: -2 * lag]) / _LAG_S**2
    return found


def yaw_of(pushes: Sequence[Push]) -> Tuple[float, float]:
    """Return the yaw of the mount and its standard deviation [rad]: the IMU accelerates where the wheels do.

    Raise ConfigError if the IMU measured another acceleration than the wheels, or too much besides.
    """
    wheels, imu = (np.concatenate([push[i] for push in pushes]) for i in (0, 1))
    power = float(wheels @ wheels)
    along = wheels @ imu / max(power, 1e-9)
    share = float(np.hypot(*along))
    rest = imu - wheels[:, None] * along
    spread = math.sqrt(float((rest**2).mean()) * (_LAG_S / _GRID_S) / max(power, 1e-9)) / max(share, 1e-9)
    if abs(share - 1) > PUSH_WITHIN or spread > YAW_SD_RAD:
        raise ConfigError(
            f"the IMU measured {share:.2f} of the wheels' acceleration, expected 1 within {PUSH_WITHIN:g}, and the yaw "
            f"of its mount to {math.degrees(spread):.0f} deg, expected {math.degrees(YAW_SD_RAD):.0f}"
        )
    return -math.atan2(along[1], along[0]), spread
