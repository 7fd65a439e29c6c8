"""Tunes the speed control of the motors: identifies each motor from steps of its duty, and computes gains.

Both control laws take the error as a share of full speed.  A motor board computes once per control period: duty =
kp/1000 error + sum(ki/1000 error) + kd/1000 change of error, limited to -1..1.  An H-bridge board computes: duty =
friction + kp error + ki integral(error) in the target's direction, limited to 0..1; a motor that gets a duty above its
dead band approaches gain (|duty| - dead band) with one time constant.

The gains of an H-bridge board follow lambda tuning, also called IMC tuning: D. E. Rivera, M. Morari and S. Skogestad,
"Internal model control: PID controller design", Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252-265, in the form of
S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning", J. Process Control 13 (2003)
291-309, eq. 23: kp = tau / (K (lambda + delay)), ki = kp / tau.  The closed loop then answers a step with the time
constant lambda.
"""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import PARAMETER_BY_NAME

LEAST_COUNTS, LEAST_TURN = 50, 0.25
"""With less travel, the wheel hardly turned: counts, or a share of a turn if that is less, as with slotted discs."""
OVERSHOOT = 0.05  # gains of a motor board may overshoot by this share
SIMULATED_S = 2.0  # length of the simulated steps [s]
LOOP_DELAY_S = 0.010
"""Delay of an H-bridge board's loop: two control periods of 5 ms, one in which a speed is measured, and one half each
for the computation and for the duty to act; assumed."""
SPEED_UP = 3.0  # the closed loop is this many times as fast as the motor, if the delay allows it
LEAST_LAMBDA_DELAYS = 3.0
"""Smallest lambda in delays: at low speed the board averages over a whole encoder cycle, which delays more."""
LINEAR_WITHIN = 0.05
"""Largest distance of a measured speed from the fitted line, as a share of full speed, of a good fit."""
_LONGEST_DELAY_S = 0.2


class DutyStep(NamedTuple):
    """A wheel's step of the duty, from rest at time 0."""

    duty: float  # share of full duty, positive
    times_s: np.ndarray
    travel: np.ndarray  # distance in the direction of the duty [count]


class Motor(NamedTuple):
    """One motor with its part of the robot's mass."""

    dead_band: float  # duty at which the wheel begins to turn; 0 with a motor board
    gain_counts_s: float  # speed per duty above the dead band [count/s]
    time_constant_s: float
    delay_s: float  # mean delay from the host's command to the motion
    off_line: float = 0.0  # largest distance of a step's speed from the line, as a share of full speed

    @property
    def full_counts_s(self) -> float:
        """Speed at full duty [count/s]."""
        return self.gain_counts_s * (1 - self.dead_band)


class Gains(NamedTuple):
    """Gains in the motor board's own units, 0 to 32767."""

    kp: int
    ki: int
    kd: int


class BridgeGains(NamedTuple):
    """An H-bridge board's parameters of these names, in the units of the table."""

    kp: int
    ki: int
    friction_duty: int
    full_speed: int


class Response(NamedTuple):
    """Figures of a step of the speed."""

    rise_s: float  # time from 10 to 90 % of the requested speed; NaN if the speed did not reach it
    overshoot: float  # share of the requested speed
    settle_s: float  # time after which the speed stays within 5 %; NaN if it did not settle
    offset: float  # mean error of the last quarter, as a share of the requested speed


# -- motors


def least_counts(counts_per_turn: float) -> float:
    """Return the travel with which a wheel has turned [count]."""
    return min(LEAST_COUNTS, LEAST_TURN * counts_per_turn)


def identify(step: DutyStep) -> Motor:
    """The motor that made this step, without a dead band; ConfigError if the wheel did not turn as commanded."""
    if not _turned(step, LEAST_COUNTS):
        raise ConfigError(
            f"a wheel made {step.travel[-1]:.0f} counts at a duty of {step.duty:g}, expected at least {LEAST_COUNTS}: "
            "run mrl calibrate wiring"
        )
    delays = np.arange(0, 0.201, 0.01)
    tried = [(tau, *_best_delay(step, tau, delays)) for tau in np.geomspace(0.01, 1.0, 60).tolist()]
    tau, speed, delay, *_ = min(tried, key=lambda found: found[-1])
    return Motor(0.0, speed / step.duty, tau, delay)


def identify_bridge(steps: Sequence[DutyStep], least: float = LEAST_COUNTS) -> Motor:
    """The motor that made these steps; ConfigError if the wheel turned backward, or at fewer than two duties.

    Steps that turned the wheel by less than `least` counts are left out; their duties are in the dead band.
    """
    used = [step for step in steps if _turned(step, least)]
    if len({step.duty for step in used}) < 2:
        raise ConfigError(
            f"the wheel turned at {len(used)} of {len(steps)} duties, expected at least 2: check the battery, "
            "and run mrl calibrate wiring"
        )
    tau = _time_constant(used)
    found = [_amplitude(step, tau) for step in used]
    speeds, weights = np.array([each[0] for each in found]), np.array([each[2] for each in found])
    gain, dead_band = _line(np.array([step.duty for step in used]), speeds, weights)
    full = gain * (1 - dead_band)
    off = max(abs(gain * (step.duty - dead_band) - speed) for step, speed in zip(used, speeds))
    return Motor(dead_band, gain, tau, float(np.mean([each[1] for each in found])), float(off / full))


def _turned(step: DutyStep, least: float) -> bool:
    end = float(step.travel[-1])
    if end < -least:
        raise ConfigError(
            f"a wheel made {end:.0f} counts at a duty of {step.duty:g}, expected a positive number: "
            "run mrl calibrate wiring"
        )
    return end >= least


def _line(duties: np.ndarray, speeds: np.ndarray, weights: np.ndarray) -> Tuple[float, float]:
    """Gain [count/s] and dead band of the line through the speeds.

    A line that begins below a duty of 0 becomes one from 0 to full speed, extrapolated from the two highest duties: the
    speed of a bridge that lets the motor coast between pulses is a curve, which is flat there.
    """
    mean_duty, mean_speed = np.average(duties, weights=weights), np.average(speeds, weights=weights)
    spread = float(weights @ (duties - mean_duty) ** 2)
    gain = float(weights @ ((duties - mean_duty) * (speeds - mean_speed))) / spread
    if gain > 0 and mean_duty > mean_speed / gain:
        return gain, float(mean_duty - mean_speed / gain)
    high, low = sorted(set(duties), reverse=True)[:2]
    at_high, at_low = speeds[duties == high].mean(), speeds[duties == low].mean()
    slope = max(0.0, float(at_high - at_low) / (high - low))
    return float(at_high + slope * (1 - high)), 0.0


def _time_constant(steps: Sequence[DutyStep]) -> float:
    """The time constant with the smallest misfit of all steps, each with a delay and a speed of its own."""

    def misfits(taus: np.ndarray) -> np.ndarray:  # sums of squared errors over all delays [count2]
        return sum(np.array([_amplitude(step, float(tau))[3] for tau in taus]) for step in steps)

    taus = np.geomspace(0.005, 1.0, 60)
    for _ in range(2):
        best = int(np.argmin(misfits(taus)))
        low, high = taus[max(0, best - 1)], taus[min(len(taus) - 1, best + 1)]
        taus = np.geomspace(low, high, 25)
    return float(taus[np.argmin(misfits(taus))])


def _amplitude(step: DutyStep, tau: float) -> Tuple[float, float, float, float]:
    """As `_best_delay`, to half a millisecond."""
    delay = _best_delay(step, tau, np.arange(0.0, _LONGEST_DELAY_S, 0.005))[1]
    return _best_delay(step, tau, np.maximum(0.0, np.arange(delay - 0.005, delay + 0.005, 0.0005)))


def _best_delay(step: DutyStep, tau: float, delays: np.ndarray) -> Tuple[float, float, float, float]:
    """Speed [count/s], delay [s], weight of the speed, and squared error [count2] of the delay that fits best."""
    since = np.maximum(0.0, step.times_s[None, :] - delays[:, None])
    shapes = since + tau * np.expm1(-since / tau)
    weights = np.maximum((shapes**2).sum(axis=1), 1e-12)
    speeds = shapes @ step.travel / weights
    errors = ((step.travel[None, :] - speeds[:, None] * shapes) ** 2).sum(axis=1)
    best = int(np.argmin(errors))
    return float(speeds[best]), float(delays[best]), float(weights[best]), float(errors[best])


# -- gains


def simulate(plants: Sequence[Motor], gains: np.ndarray, target: float, period_s: float) -> np.ndarray:
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


def suggest(plants: Sequence[Motor], period_s: float = 0.05) -> Gains:
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


def design(motors: Sequence[Motor], counts_per_turn: float) -> BridgeGains:
    """Gains for all these motors, in the units of the board's parameters; ConfigError if one is out of its range.

    One set of gains serves both wheels: full speed is that of the slower wheel, the others are those of the wheel that
    bears least.
    """
    full = min(motor.full_counts_s for motor in motors)
    pairs: List[Tuple[float, float]] = []
    for motor in motors:
        tau = motor.time_constant_s
        closed_loop_s = max(tau / SPEED_UP, LEAST_LAMBDA_DELAYS * LOOP_DELAY_S)  # lambda
        kp = tau / (motor.gain_counts_s / full * (closed_loop_s + LOOP_DELAY_S))
        pairs.append((kp, kp / tau))
    values = BridgeGains(
        kp=round(1000 * min(kp for kp, _ in pairs)),
        ki=round(1000 * min(ki for _, ki in pairs)),
        friction_duty=round(1000 * min(motor.dead_band for motor in motors)),
        full_speed=round(60 * full / counts_per_turn),
    )
    for name, value in values._asdict().items():
        row = PARAMETER_BY_NAME[name]
        if not row.low <= value <= row.high:
            raise ConfigError(
                f"the steps give {name} {value} [{row.unit}], expected {row.low} to {row.high}: check the battery, "
                "gearbox and encoder_counts in the robot's file, and the wiring"
            )
    return values


def describe(times_s: np.ndarray, travel: np.ndarray, target_counts_s: float) -> Response:
    """Figures of a step of the speed at time 0, from counts [count]; nothing settles at a target of 0."""
    middle, speed = speeds(times_s, travel)
    share = speed / target_counts_s if target_counts_s else np.zeros_like(speed)
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
