"""Tunes the speed control of an H-bridge board: fits each motor to steps of its duty, and computes PI gains.

A motor that gets a duty above its dead band approaches gain (|duty| - dead band) with one time constant.  The control
law, with the error as a share of full speed, is: duty = friction + kp error + ki integral(error) in the target's
direction, limited to 0..1.

The gains follow lambda tuning, also called IMC tuning: D. E. Rivera, M. Morari and S. Skogestad, "Internal model
control: PID controller design", Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252-265, in the form of S. Skogestad,
"Simple analytic rules for model reduction and PID controller tuning", J. Process Control 13 (2003) 291-309, eq. 23:
kp = tau / (K (lambda + delay)), ki = kp / tau.  The closed loop then answers a step with the time constant lambda.
"""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import PARAMETER_BY_NAME

from .gains import LEAST_READINGS

LEAST_COUNTS = 50  # a step with less travel does not count: the wheel hardly turned [count]
LOOP_DELAY_S = 0.010
"""Delay of the board's loop: two control periods of 5 ms, one in which a speed is measured, and one half each for
the computation and for the duty to act; assumed."""
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


class MotorFit(NamedTuple):
    """One motor with its part of the robot's mass."""

    dead_band: float  # duty at which the wheel begins to turn
    gain_counts_s: float  # speed per duty above the dead band [count/s]
    time_constant_s: float
    delay_s: float  # mean delay from the host's command to the motion
    off_line: float  # largest distance of a step's speed from the line, as a share of full speed

    @property
    def full_counts_s(self) -> float:
        """Speed at full duty [count/s]."""
        return self.gain_counts_s * (1 - self.dead_band)


class BridgeGains(NamedTuple):
    """The board's parameters of these names, in the units of the table."""

    kp: int
    ki: int
    friction_duty: int
    full_speed: int


def identify(steps: Sequence[DutyStep]) -> MotorFit:
    """The motor that made these steps.

    Steps that hardly turned the wheel are left out; their duties are in the dead band.

    Raises:
        ConfigError: there are too few readings, the wheel turned backward, or it turned at fewer than two duties.
    """
    used = [step for step in steps if _turned(step)]
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
    return MotorFit(dead_band, gain, tau, float(np.mean([each[1] for each in found])), float(off / full))


def _turned(step: DutyStep) -> bool:
    if len(step.times_s) < LEAST_READINGS:
        raise ConfigError(f"a step has {len(step.times_s)} readings, expected at least {LEAST_READINGS}")
    end = float(step.travel[-1])
    if end < -LEAST_COUNTS:
        raise ConfigError(
            f"a wheel made {end:.0f} counts at a duty of {step.duty:g}, expected a positive number: "
            "run mrl calibrate wiring"
        )
    return end >= LEAST_COUNTS


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


# -- the shape of one step


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
    """Speed [count/s], delay [s], weight of the speed, and squared error [count2] of the best delay."""
    delays = np.arange(0.0, _LONGEST_DELAY_S, 0.005)
    for finer in (0.0005, None):
        speeds, weights, errors = _scaled(step, tau, delays)
        best = int(np.argmin(errors))
        if finer is None:
            break
        delays = np.maximum(0.0, np.arange(delays[best] - 0.005, delays[best] + 0.005, finer))
    return float(speeds[best]), float(delays[best]), float(weights[best]), float(errors[best])


def _scaled(step: DutyStep, tau: float, delays: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each delay: the speed that fits best, its weight, and the squared error."""
    since = np.maximum(0.0, step.times_s[None, :] - delays[:, None])
    shapes = since + tau * np.expm1(-since / tau)
    weights = np.maximum((shapes**2).sum(axis=1), 1e-12)
    speeds = shapes @ step.travel / weights
    errors = ((step.travel[None, :] - speeds[:, None] * shapes) ** 2).sum(axis=1)
    return speeds, weights, errors


# -- the gains


def design(motors: Sequence[MotorFit], counts_per_turn: float) -> BridgeGains:
    """Gains for all these motors, in the units of the board's parameters.

    One set of gains serves both wheels: full speed is that of the slower wheel, the others are those of the wheel that
    bears least.

    Raises:
        ConfigError: a value is outside the range of its parameter.
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
