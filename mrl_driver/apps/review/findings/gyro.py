"""Findings from the IMU: that it failed, and where its gyro and the wheels disagree."""

import math
from typing import Any, Iterator, NamedTuple, Optional, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.robot.heading import STEADY_RAD_S
from mrl_driver.robot.imu import CODES
from mrl_driver.robot.models import Drive
from mrl_driver.session.events import ImuChanged

from .evidence import IMU, TELEMETRY, Finding, finding, heard, interruptions, outside, runs

WINDOW_S = 0.5  # turns by gyro and by wheels are compared over this time [s]
SLIP_RAD = 0.1
"""A wheel slips if gyro and wheels differ by more than this in a window, or in windows that follow each other [rad]:
five times what the tracks' own noise gives."""
AGREES_RAD, LEAST_WINDOWS = 0.06, 8
"""Gyro and wheels agree in a window if they differ by less than this [rad]; a fit needs this number of windows."""
SCALE, SCALE_RAD = 0.06, 1.5
"""Turns by gyro and wheels differ by more than this share: the gyro's scale is within 3 % (data sheet of the MPU-6050),
and three standard deviations of a wheel separation are 3 %.  The robot must turn by this angle first [rad]."""
RATIO, RATIO_M = 0.02, 1.0
"""Wheels of one kind differ in size by less than this: four standard deviations (Araujo 2012).  The robot must drive
this distance first [m]."""
LARGEST_RATIO, LARGEST_SCALE = 0.15, 0.25
"""Wheels and wheel separations that seem to differ by more do not: a wheel slips."""
DRIFT_RAD_S = math.radians(0.5)
"""Change of the gyro's bias that its temperature does not explain [rad/s]: 0.16 deg/s per degree (data sheet), 3
degrees."""
STAND_S, LEAST_RATES = 0.2, 5
"""A stand counts if it lasts this long, after a first time as long in which the body settles [s]."""
SURE = 2.0  # a figure counts if it is this many standard errors beyond its threshold


def check(drive: DriveData) -> Iterator[Finding]:
    """Return what is wrong with the IMU, or what it shows."""
    wrong = _failed(drive) or _drift(drive)
    if wrong is not None:
        yield wrong
        return
    found = _compare(drive)
    if found is not None:
        yield from _slips(drive, found)
        yield from _scales(drive, found)


def _failed(drive: DriveData) -> Optional[Finding]:
    down = interruptions(drive)
    lost = [(float(t) - 1.0, float(t) + 1.0) for t in drive.lost.time_s]
    for time_s, event in drive.events:
        if not isinstance(event, ImuChanged) or event.in_use or event.state not in CODES:
            continue
        if outside([time_s], [*down, *lost])[0]:
            text = f"From {time_s:.1f} s on {event.text.partition(': ')[0]}."
            return finding(CODES[event.state], 64, text, heard(drive, time_s, IMU, *TELEMETRY))
    return None


def _drift(drive: DriveData) -> Optional[Finding]:
    """Compare the gyro's rates while the wheels stand still."""
    imu = drive.imu
    if not len(imu.time_s) or len(drive.counts.time_s) < 2:
        return None
    raw = imu.values[:, 0] + np.nan_to_num(imu.values[:, 4])
    moved = np.any(np.abs(np.diff(drive.counts.values, axis=0)) > 1, axis=1)
    stands = []
    for first, end in runs(~moved):
        begin_s, end_s = drive.stamps_s[first] + STAND_S, drive.stamps_s[end]
        rates = raw[slice(*np.searchsorted(imu.time_s, (begin_s, end_s)))]
        if end_s - begin_s >= STAND_S and len(rates) >= LEAST_RATES and np.std(rates) < STEADY_RAD_S:
            stands.append((float(end_s), float(np.mean(rates))))
    changes = np.array([abs(rate - stands[0][1]) for _, rate in stands])
    far = changes > DRIFT_RAD_S
    if not far.any():
        return None
    text = (
        f"While the robot stood, the rate it showed changed by {math.degrees(changes.max()):.1f} deg/s during the "
        "drive. The heading turns as fast."
    )
    return finding("imu_drift", 62, text, heard(drive, stands[int(np.argmax(far))][0], IMU, *TELEMETRY))


class _Compared(NamedTuple):
    """Turns of each window by gyro and by wheels, and the fit `gyro = scale turn + curve distance + drift time`."""

    time_s: Any  # end of each window
    turn_rad: Any
    distance_m: Any
    right_m: Any
    left_m: Any
    rest_rad: Any  # what the fit does not explain
    scale: float
    curve_rad_m: float
    errors: Any  # standard errors of the three


def _compare(drive: DriveData) -> Optional[_Compared]:
    base, imu = drive.model.drive, drive.imu
    known = ~np.isnan(imu.values[:, 4]) if len(imu.time_s) else np.zeros(0, dtype=bool)
    if not isinstance(base, Drive) or known.sum() < 10:
        return None
    at_s, rate = np.maximum.accumulate(imu.time_s[known]), imu.values[known, 0]
    angle = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(at_s)))
    edges = np.arange(at_s[0], at_s[-1], WINDOW_S)
    right, left = (
        np.interp(edges, drive.stamps_s, drive.counts.values[:, i] * per_count)
        for i, per_count in enumerate((base.right_m_per_count, base.left_m_per_count))
    )
    gyro = np.diff(np.interp(edges, at_s, angle))
    right, left = np.diff(right), np.diff(left)
    gaps = [(float(a), float(b)) for a, b in zip(at_s[:-1], at_s[1:]) if b - a > 0.1]
    kept = outside(edges[1:], [*interruptions(drive), *((a, b + WINDOW_S) for a, b in gaps)])
    kept &= np.abs(right) + np.abs(left) > 1e-3
    gyro, right, left, ends = gyro[kept], right[kept], left[kept], edges[1:][kept]
    if len(gyro) < LEAST_WINDOWS:
        return None
    turn, distance = (right - left) / base.turning_separation_m, 0.5 * (right + left)
    table = np.stack([turn, distance, np.full(len(turn), WINDOW_S)], axis=1)
    everything, *_ = np.linalg.lstsq(table, gyro, rcond=None)
    fits = [_fit(table, gyro, begin) for begin in (everything, np.array([1.0, 0.0, 0.0]))]
    fit, used = max(fits, key=lambda each: int(each[1].sum()))
    if used.sum() < LEAST_WINDOWS:
        return None
    rest = gyro - table @ fit
    noise = max(float(np.std(rest[used])), 1e-3)
    spreads = np.diag(np.linalg.pinv(table[used].T @ table[used]))
    errors = noise * np.sqrt(np.maximum(spreads, 0.0))
    return _Compared(ends, turn, distance, right, left, rest, float(fit[0]), float(fit[1]), errors)


def _fit(table: Any, gyro: Any, fit: Any) -> Tuple[Any, Any]:
    """Improve a fit with the windows that agree with it; return it and whether each window does."""
    used = np.ones(len(gyro), dtype=bool)
    for _ in range(5):
        used = np.abs(gyro - table @ fit) <= AGREES_RAD
        if used.sum() < LEAST_WINDOWS:
            break
        fit, *_ = np.linalg.lstsq(table[used], gyro[used], rcond=None)
    return fit, used


def _slips(drive: DriveData, found: _Compared) -> Iterator[Finding]:
    """Windows in which the robot turned otherwise than its wheels."""
    worst, at, total = 0.0, 0, 0.0
    for first, end in runs(np.abs(found.rest_rad) > AGREES_RAD):
        turned = float(found.rest_rad[first:end].sum())
        if abs(turned) > SLIP_RAD:
            total += abs(turned)
            if abs(turned) > abs(worst):
                worst, at = turned, first
    if not worst:
        return
    signs = (("left", float(found.left_m[at])), ("right", -float(found.right_m[at])))
    suspects = [name for name, sign in signs if sign * worst > 0]
    which = f"The {suspects[0]} wheel" if len(suspects) == 1 else "A wheel"
    text = (
        f"The gyro and the wheels disagree by {math.degrees(total):.0f} deg in all: a wheel turned without moving "
        "the robot as far."
    )
    yield finding("slip", 63, text, heard(drive, found.time_s[at], *TELEMETRY), which)


def _scales(drive: DriveData, found: _Compared) -> Iterator[Finding]:
    """The geometry that the fit shows; figures that no robot has are slip."""
    ratio = found.curve_rad_m * drive.model.base.wheel_separation_m
    ratio_error = found.errors[1] * drive.model.base.wheel_separation_m
    unequal = np.abs(found.distance_m).sum() >= RATIO_M and abs(ratio) - SURE * ratio_error > RATIO
    scaled = (
        np.abs(found.turn_rad).sum() >= SCALE_RAD and abs(found.scale - 1.0) - SURE * found.errors[0] > SCALE
    )
    if (unequal and abs(ratio) > LARGEST_RATIO) or (scaled and abs(found.scale - 1.0) > LARGEST_SCALE):
        explained = (found.scale - 1.0) * found.turn_rad + found.curve_rad_m * found.distance_m
        yield from _slips(drive, found._replace(rest_rad=found.rest_rad + explained))
        return
    if unequal:
        larger, curve_deg_m = "right" if ratio > 0 else "left", math.degrees(abs(found.curve_rad_m))
        text = (
            f"It is larger by {abs(ratio):.1%}: by the gyro the robot turns {curve_deg_m:.1f} deg in each metre while "
            "the wheels count the same."
        )
        at = int(np.argmax(np.abs(found.distance_m)))
        yield finding("wheel_ratio", 56, text, heard(drive, found.time_s[at], *TELEMETRY), larger)
    if scaled:
        text = (
            f"The gyro shows {found.scale:.0%} of the turn by the wheels: wheel separation or wheel size in the model "
            f"is wrong by {abs(1 / found.scale - 1):.0%}, or the wheels slip in turns."
        )
        at = int(np.argmax(np.abs(found.turn_rad)))
        yield finding("track_width", 55, text, heard(drive, found.time_s[at], *TELEMETRY))
