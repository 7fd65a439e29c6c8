"""Tunes the speed control of the motors: identifies each motor from steps of its duty, and suggests gains.

The control law, with the error as a share of full speed, once per control period, is:
duty = kp/1000 error + sum(ki/1000 error) + kd/1000 change of error, limited to -1..1.
"""

from typing import List, NamedTuple, Sequence, Tuple, Union

import numpy as np

from mrl_driver.errors import ConfigError

Numbers = Union[Sequence[float], np.ndarray]
LEAST_READINGS = 10
OVERSHOOT = 0.05  # gains may overshoot by this share
SIMULATED_S = 2.0  # length of the simulated steps [s]


class MotorModel(NamedTuple):
    """One motor and its part of the robot's mass: a delay and a first-order lag."""

    full_counts_s: float  # speed at full duty [count/s]
    time_constant_s: float
    delay_s: float


class Gains(NamedTuple):
    """Gains in the motor board's own units, 0 to 32767."""

    kp: int
    ki: int
    kd: int


class Response(NamedTuple):
    """Figures of a step of the speed."""

    rise_s: float  # time from 10 to 90 % of the requested speed; NaN if the speed did not reach it
    overshoot: float  # share of the requested speed
    settle_s: float  # time after which the speed stays within 5 %; NaN if it did not settle
    offset: float  # mean error of the last quarter, as a share of the requested speed


def identify(times_s: Numbers, travel: Numbers, duty: float) -> MotorModel:
    """The motor that travels `travel` [count] at `times_s` after a step of the duty, at time 0 and from rest.

    Raises:
        ConfigError: there are too few readings, or the wheel did not turn in the commanded direction.
    """
    t, travelled = np.asarray(times_s, float), np.asarray(travel, float)
    if len(t) < LEAST_READINGS:
        raise ConfigError(f"a step has {len(t)} readings, expected at least {LEAST_READINGS}")
    if travelled[-1] * duty <= 0 or abs(travelled[-1]) < 50:
        raise ConfigError(
            f"a wheel made {travelled[-1]:.0f} counts at a duty of {duty:g}, expected at least 50 in that direction: "
            "run mrl calibrate wiring"
        )
    best = min(
        (
            _misfit(t, travelled, tau, delay)
            for tau in np.geomspace(0.01, 1.0, 60)
            for delay in np.arange(0, 0.201, 0.01)
        ),
        key=lambda found: found[0],
    )
    return MotorModel(abs(best[1] / duty), best[2], best[3])


def _misfit(
    t: np.ndarray, travelled: np.ndarray, tau: float, delay: float
) -> Tuple[float, float, float, float]:
    since = np.maximum(0.0, t - delay)
    shape = since - tau * -np.expm1(-since / tau)
    square = float(shape @ shape)
    speed = float(shape @ travelled) / square if square > 0 else 0.0
    off = travelled - speed * shape
    return float(off @ off), speed, float(tau), float(delay)


def simulate(plants: Sequence[MotorModel], gains: np.ndarray, target: float, period_s: float) -> np.ndarray:
    """(G, P, T) speeds, as shares of `target`, after a step from rest, for each of G gains (G, 3) and P plants.

    `target` is a share of the slowest plant's full speed; T control periods make up `SIMULATED_S`.
    """
    full = np.array([plant.full_counts_s for plant in plants])
    decay = np.exp(-period_s / np.array([plant.time_constant_s for plant in plants]))
    late = [int(round(plant.delay_s / period_s)) for plant in plants]
    speed = np.zeros((len(gains), len(plants)))
    total, before = np.zeros_like(speed), np.zeros_like(speed)
    wanted, rows = target * full.min(), []
    kp, ki, kd = (gains[:, i, None] / 1000.0 for i in range(3))
    duties: List[np.ndarray] = []
    for _ in range(int(SIMULATED_S / period_s)):
        error = (wanted - speed) / full.max()
        total = np.clip(total + ki * error, -1, 1)
        duties.append(np.clip(kp * error + total + kd * (error - before), -1, 1))
        before = error
        applied = np.stack(
            [duties[-1 - lag][:, i] if len(duties) > lag else 0 * speed[:, i] for i, lag in enumerate(late)],
            axis=1,
        )
        speed = applied * full + (speed - applied * full) * decay
        rows.append(speed / wanted)
    return np.stack(rows, axis=2)


def suggest(plants: Sequence[MotorModel], period_s: float = 0.05) -> Gains:
    """Gains with the smallest time-weighted error of the worse wheel; raise ConfigError if all exceed `OVERSHOOT`."""
    steps = np.geomspace(50, 3000, 19)
    tried = np.array([(p, i, d * p) for p in steps for i in steps for d in (0.0, 0.15, 0.3)])
    heights = simulate(plants, tried, 0.4, period_s)
    times = period_s * np.arange(1, heights.shape[2] + 1)
    cost = (np.abs(1 - heights) * times).sum(axis=2).max(axis=1)
    softer = simulate(plants, 1.5 * tried, 0.4, period_s)
    steady = (heights.max(axis=2) < 1 + OVERSHOOT).all(axis=1) & (softer.max(axis=2) < 1.25).all(axis=1)
    if not steady.any():
        raise ConfigError(
            f"no gains keep {plants} below an overshoot of {OVERSHOOT:.0%}; check the recorded steps"
        )
    best = tried[np.argmin(np.where(steady, cost, np.inf))]
    return Gains(*(int(round(value)) for value in best))


def describe(times_s: Numbers, travel: Numbers, target_counts_s: float) -> Response:
    """Figures of a step of the speed at time 0, from counts [count]."""
    t, travelled = np.asarray(times_s, float), np.asarray(travel, float)
    middle, speed = speeds(t, travelled)
    share = speed / target_counts_s
    low, high = _first(middle, share >= 0.1), _first(middle, share >= 0.9)
    outside = np.flatnonzero(np.abs(share - 1) > 0.05)
    first = outside[-1] + 1 if len(outside) else 0
    settled = float(middle[first]) if first < len(middle) else float("nan")
    last = share[-max(1, len(share) // 4) :]
    return Response(high - low, max(0.0, float(share.max()) - 1), settled, float(1 - last.mean()))


def speeds(times_s: np.ndarray, travel: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Times and speeds [count/s] over about 0.05 s each."""
    step = max(1, int(round(0.05 / max(1e-4, float(np.median(np.diff(times_s)))))))
    dt = times_s[step:] - times_s[:-step]
    return (times_s[step:] + times_s[:-step]) / 2, (travel[step:] - travel[:-step]) / dt


def _first(times_s: np.ndarray, there: np.ndarray) -> float:
    return float(times_s[np.argmax(there)]) if there.any() else float("nan")
