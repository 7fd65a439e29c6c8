"""One motor of the motor board: ramp, PID at the control rate, first-order speed, brake.

Speeds are encoder counts per second [count/s] at a prescaler of 1, so that wheel sizes do not matter here.  Between two
control ticks the motion has a closed form, and a step of any length is exact.
"""

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple


class MotorParams(NamedTuple):
    """Data of a motor, its gearbox, and its part of the motor board's program."""

    no_load_counts_s: float  # speed at full duty and nominal voltage [count/s]
    rated_counts_s: float  # speed of 100 % under speed control [count/s]
    nominal_v: float = 12.0  # voltage of `no_load_counts_s` [V]
    time_constant_s: float = 0.08  # time to 63 % of a step of the duty [s]
    friction_counts_s: float = 0.0
    """Speed lost to friction at any duty [count/s]; a duty worth less than this does not start the motor."""
    brake_counts_s2: float = 22000.0
    """Deceleration of the short-circuited motor [count/s2]; 2 m/s2 on a TraxBot."""
    position_gain_hz: float = 4.0  # requested speed per count of remaining distance, in position mode [1/s]


@dataclass
class ControlSettings:
    """Settings of the motor board's speed control, in its own units."""

    kp: int = 700  # proportional gain [1/1000 duty per full speed]
    ki: int = 400  # integral gain [1/1000 duty per full speed and control period]
    kd: int = 200  # differential gain [1/1000 duty per full speed and control period]
    ramp_ms: int = 2500  # time from standstill to rated speed [ms]; 0 means no ramp
    ramp_gain: int = 0  # speed at which the ramp starts [1/1000 of rated speed]


class BoardGeometry(NamedTuple):
    """The differential geometry in the motor board's own units."""

    axis_radius: int  # half the distance between the wheels [0.01 mm]
    wheel_radius: int  # wheel radius [0.01 mm]
    gearbox: int  # motor turns per wheel turn [0.1]
    encoder_counts: int  # counts per motor turn [0.1]


class Mode(Enum):
    """How the motor board controls a motor."""

    DUTY = auto()
    SPEED = auto()
    POSITION = auto()
    BRAKE = auto()


_REST_COUNTS_S = 1.0


class Motor:
    """State of one motor; `travel` and `speed` are physics, the rest belongs to the motor board's program."""

    def __init__(self, params: MotorParams) -> None:
        self.params = params
        self.mode = Mode.BRAKE
        self.travel = 0.0  # distance since power-up as the encoder measures it [count]; never wraps
        self.speed = 0.0  # true speed [count/s]
        self.duty = 0.0  # share of the battery voltage that the program puts on the motor, -1 to 1
        self.sensed = 1.0
        """What the encoder shows of the motion: all, 0 if it is dead, -1 if its channels are exchanged."""
        self.polarity = 1.0  # -1 if the motor's wires are exchanged
        self.blocked = False  # something holds the wheel
        self.target = self._setpoint = self._integral = self._error = self._goal = 0.0
        self._hold = False

    def set_duty(self, share: float) -> None:
        """Puts a share of the battery voltage on the motor at once, without speed control."""
        self.mode, self.duty = Mode.DUTY, max(-1.0, min(1.0, share))

    def set_speed(self, counts_s: float) -> None:
        """Asks for a speed [count/s]; the ramp leads there."""
        if self.mode is not Mode.SPEED:
            self._begin_control()
        self.mode, self.target = Mode.SPEED, counts_s

    def go_to(self, travel: float, counts_s: float, hold: bool) -> None:
        """Goes to a travel [count] at this speed at most [count/s], then holds with torque, or brakes."""
        if self.mode is not Mode.POSITION:
            self._begin_control()
        self.mode, self.target, self._goal, self._hold = Mode.POSITION, abs(counts_s), travel, hold

    def brake(self) -> None:
        """Brakes at once: short-circuits the motor."""
        self.mode, self.duty = Mode.BRAKE, 0.0

    @property
    def at_rest(self) -> bool:
        """The motor stands still, and will not move before the next command."""
        still = self.speed == 0.0 and self.duty == 0.0
        return still and (
            self.mode in (Mode.DUTY, Mode.BRAKE) or (self.mode is Mode.SPEED and self.target == 0.0)
        )

    def move(self, dt: float, volts: float) -> float:
        """Moves for `dt` [s] at a constant duty; returns the distance [count]."""
        if self.blocked:
            self.speed = 0.0
            return 0.0
        moved = self._braked(dt) if self.mode is Mode.BRAKE else self._driven(dt, volts)
        self.travel += moved * self.sensed
        return moved

    def control(self, period_s: float, gains: ControlSettings) -> None:
        """One tick of the board's control loop."""
        if self.mode is Mode.SPEED:
            self._setpoint = self._ramped(self.target, period_s, gains)
            self._pid(gains)
        elif self.mode is Mode.POSITION:
            self._approach(period_s, gains)
        self._settle()

    def _begin_control(self) -> None:
        self._setpoint, self._integral, self._error = self.speed * self.sensed, self.duty, 0.0

    def _approach(self, period_s: float, gains: ControlSettings) -> None:
        left = self._goal - self.travel
        if abs(left) < 0.5 and not self._hold:
            self.brake()
            return
        wanted = max(-self.target, min(self.target, left * self.params.position_gain_hz))
        speeding_up = abs(wanted) > abs(self._setpoint)
        self._setpoint = self._ramped(wanted, period_s, gains) if speeding_up else wanted
        self._pid(gains)

    def _ramped(self, target: float, period_s: float, gains: ControlSettings) -> float:
        """The next set point on the way to `target`; from standstill the ramp starts at `ramp_gain`."""
        if gains.ramp_ms == 0:
            return target
        start = self._setpoint
        if start == 0.0:
            take_off = self.params.rated_counts_s * gains.ramp_gain / 1000.0
            start = math.copysign(min(take_off, abs(target)), target)
        most = self.params.rated_counts_s * period_s * 1000.0 / gains.ramp_ms
        return start + max(-most, min(most, target - start))

    def _pid(self, gains: ControlSettings) -> None:
        error = (self._setpoint - self.speed * self.sensed) / self.params.no_load_counts_s
        self._integral = max(-1.0, min(1.0, self._integral + gains.ki / 1000.0 * error))
        change, self._error = error - self._error, error
        duty = gains.kp / 1000.0 * error + self._integral + gains.kd / 1000.0 * change
        self.duty = max(-1.0, min(1.0, duty))

    def _settle(self) -> None:
        """Stops a motor that should stand still and nearly does."""
        if self.mode is Mode.SPEED:
            should_stand = self.target == 0.0 == self._setpoint
        else:
            should_stand = self.mode is Mode.DUTY and self.duty == 0.0
        if should_stand and abs(self.speed) < _REST_COUNTS_S:
            self.speed = self.duty = self._integral = self._error = 0.0

    def _driven(self, dt: float, volts: float) -> float:
        tau, friction = self.params.time_constant_s, self.params.friction_counts_s
        free = self.polarity * self.duty * self.params.no_load_counts_s * volts / self.params.nominal_v
        if self.speed == 0.0 and abs(free) <= friction:
            return 0.0
        speed, final = self.speed, free - math.copysign(friction, self.speed or free)
        to_rest = tau * math.log1p(-speed / final) if speed * final < 0.0 else math.inf
        gone = -math.expm1(-min(dt, to_rest) / tau)
        moved = final * min(dt, to_rest) + (speed - final) * tau * gone
        if dt < to_rest:
            self.speed = speed + (final - speed) * gone
            return moved
        self.speed = 0.0
        return moved + self._driven(dt - to_rest, volts)

    def _braked(self, dt: float) -> float:
        speed, slowing = self.speed, self.params.brake_counts_s2
        to_rest = abs(speed) / slowing
        if dt >= to_rest:
            self.speed = 0.0
            return 0.5 * speed * to_rest
        self.speed = speed - math.copysign(slowing * dt, speed)
        return 0.5 * (speed + self.speed) * dt
