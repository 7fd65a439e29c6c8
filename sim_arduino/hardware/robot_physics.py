"""The robot's body: motors, pose, battery, temperature.  `Params`, `State`, `Robot.step(dt)`; no bytes, no clock.

The pose follows the wheels' true ways by exact arcs.  Numbers without another source are of the thesis (2012).
"""

import math
import random
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Callable, NamedTuple, Optional, Tuple

from mrl_driver.robot.models import OmniDrive, RobotModel
from sim_arduino.world.geometry import Pose

from .motor import Gains, Motor, MotorParams
from .omni_wheels import OMNI_ANGLES_RAD, twist_of

MAX_STEP_S = 0.02
"""Longest piece that is integrated as one arc while the robot moves [s]."""
_REST_STEP_S = 1.0
"""Longest piece while it stands, for battery and temperature [s]."""
_ROTOR_S, _BODY_S = 0.057, 0.023
"""Parts of a motor's time constant [s]: its own rotor, and the body of one load on 39 mm wheels at 1.8 Nm of stall
torque; estimated."""
_TRACK_FRICTION, _WHEEL_FRICTION = 0.02, 0.006
"""Share of the no-load speed that rolling one load costs: 0.1 of its weight on tracks, 0.03 on wheels; estimated."""


class Params(NamedTuple):
    """What this robot is.  Left and right are motors 1 and 3 of the motor board; motor 2 turns nothing, or the rear
    wheel of a robot with three."""

    motor: MotorParams
    left_m_per_count: float
    right_m_per_count: float
    wheel_separation_m: float
    turn_slip: float = 0.0
    """Share of the yaw that the tracks lose to the floor in a turn, 0 to below 1."""
    omni_radius_m: float = 0.0
    """Distance of three wheels across from the middle [m]; 0 is two wheels or tracks side by side."""
    omni_angles_rad: Tuple[float, ...] = OMNI_ANGLES_RAD
    """Where the wheels of motors 1, 2 and 3 sit, counter-clockwise from forward."""
    control_hz: float = 20.0
    """Rate of the motor board's control loop [Hz]: 10, 20 or 40."""
    capacity_ah: float = 4.6
    rest_curve: Tuple[Tuple[float, float], ...] = ()
    """Battery voltage at no load [V] over charge (1 full, 0 empty), rising."""
    resistance_ohm: float = 0.15
    idle_a: float = 1.3
    """Current with the motors at rest [A]; with `running_a` the packs last 2.5 h at 50 mm/s and 2 h at 200 mm/s."""
    running_a: float = 1.6
    """Current of one motor at its no-load speed [A]."""
    starting_a: float = 5.0
    """Further current of one motor that stands at full duty [A]."""
    ambient_c: float = 25.0
    heating_c_per_a: float = 6.0
    """Final temperature rise of the motor board per ampere through the motors [degC/A]."""
    heating_s: float = 300.0
    wheel_noise: float = 0.0
    """Variance of a wheel's way on the floor, per way [m2/m]."""
    turn_noise: float = 0.0
    """Variance of the yaw by slip, per angle turned [rad2/rad]."""


@dataclass
class State:
    """Where the robot is and how it fares.  x forward at the start, y left, yaw counter-clockwise, unwrapped."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    charge: float = 1.0
    """Charge of the battery, 1 full, 0 empty, below 0 over-discharged."""
    battery_v: float = 0.0
    """Voltage at the motor board, under load [V]."""
    temperature_c: float = 25.0
    bumped: bool = False
    """Something kept the robot from a part of its last motion; its wheels slipped."""
    to_tick_s: float = field(default=0.0, repr=False)
    """Time to the motor board's next control tick [s]."""


class Errors(NamedTuple):
    """How one robot differs from its model, as calibration finds it."""

    left_scale: float = 1.0
    right_scale: float = 1.0
    """True size of each wheel over the model's."""
    axle_scale: float = 1.0
    """True distance of the wheels over the model's."""
    turn_slip: float = 0.0
    """Share of the yaw that is lost in a turn."""
    load: float = 1.0
    """True mass over the model's."""
    control_hz: float = 20.0
    """Rate of the motor board's control loop [Hz]: 10, 20 or 40."""
    wheel_noise: float = 0.0
    """Variance of a wheel's way on the floor, per way [m2/m]."""
    turn_noise: float = 0.0
    """Variance of the yaw by slip, per angle turned [rad2/rad]."""


AS_MODELLED = Errors()


def params_for(model: RobotModel, errors: Errors = AS_MODELLED, omni: bool = False) -> Params:
    """Parameters of a robot of that model, with three wheels across if `omni`."""
    per_turn = model.board["gearbox"] * model.board["encoder_counts"] / 100.0
    per_count = model.drive.metres_per_count
    drive = model.drive
    three = isinstance(drive, OmniDrive)
    rpm = drive.full_speed_m_s / per_count if isinstance(drive, OmniDrive) else 160.0 / 60.0 * per_turn
    time_constant_s = _ROTOR_S + _BODY_S * errors.load
    friction = errors.load * (_TRACK_FRICTION if model.body.tracks else _WHEEL_FRICTION)
    motor = MotorParams(
        no_load_counts_s=rpm * 12.0 / 7.2,
        rated_counts_s=rpm,
        time_constant_s=time_constant_s,
        friction_counts_s=friction * rpm * 12.0 / 7.2,
        brake_counts_s2=2.0 / per_count * (_ROTOR_S + _BODY_S) / time_constant_s,
    )
    battery = model.battery
    axle_m = model.drive.wheel_separation_m * errors.axle_scale
    return Params(
        motor,
        model.drive.left_m_per_count * errors.left_scale,
        model.drive.right_m_per_count * errors.right_scale,
        axle_m,
        1.0 - (1.0 - model.drive.turn_slip) * (1.0 - errors.turn_slip),
        0.5 * axle_m if omni or three else 0.0,
        tuple(map(math.radians, drive.angles_deg)) if isinstance(drive, OmniDrive) else OMNI_ANGLES_RAD,
        errors.control_hz,
        capacity_ah=battery.capacity_ah,
        rest_curve=_rest_curve(battery.empty_v, battery.full_v),
        wheel_noise=errors.wheel_noise,
        turn_noise=errors.turn_noise,
    )


def _rest_curve(empty_v: float, full_v: float) -> Tuple[Tuple[float, float], ...]:
    """NiMH: steep at both ends, flat between; beyond them linear to 0 V and to a pack fresh from the charger."""

    def level(share: float) -> float:
        return empty_v + share * (full_v - empty_v)

    return (
        (-0.05, 0.0),
        (0.0, level(0.0)),
        (0.08, level(0.4)),
        (0.3, level(0.62)),
        (0.8, level(0.75)),
        (0.95, level(0.85)),
        (1.0, full_v),
        (1.1, full_v + 2.0),
    )


def interpolate(pairs: Tuple[Tuple[float, float], ...], x: float) -> float:
    """Piecewise linear through `pairs` (rising x), constant beyond the ends."""
    index = bisect_left(pairs, (x, -math.inf))
    if index == 0:
        return pairs[0][1]
    if index == len(pairs):
        return pairs[-1][1]
    (x0, y0), (x1, y1) = pairs[index - 1], pairs[index]
    return y0 + (y1 - y0) * (x - x0) / (x1 - x0)


Way = Callable[[Pose, float, Callable[[float], Pose], float], float]
"""Share of a motion that can be made: see `bumper.Bumper.share`."""


class Robot:
    """Params, state and motors; `step` carries them on.

    Attributes:
        way: What stands in the way; None is an endless empty floor.
    """

    def __init__(
        self, params: Params, pose: Tuple[float, float, float] = (0.0, 0.0, 0.0), seed: int = 0
    ) -> None:
        self.params = params
        self.state = State(*pose, temperature_c=params.ambient_c, to_tick_s=1.0 / params.control_hz)
        self.motors = tuple(Motor(params.motor) for _ in range(3))
        self.gains = Gains()
        self.way: Optional[Way] = None
        self._rng = random.Random(f"wheels {seed}")
        self._unaccounted_s = 0.0
        self._update_battery(0.0)

    def set_battery(self, volts: float) -> None:
        """Gives the battery the charge at which it shows so many volts with the motors at rest."""
        rest = volts + self.params.idle_a * self.params.resistance_ohm if volts > 0.0 else 0.0
        self.state.charge = interpolate(tuple((v, c) for c, v in self.params.rest_curve), rest)
        self._update_battery(0.0)

    def step(self, dt: float) -> None:
        """Goes on for `dt` [s]; pieces end at the control ticks, the motion between them is exact."""
        while dt > 0.0:
            resting = all(motor.at_rest for motor in self.motors)
            piece = min(dt, _REST_STEP_S) if resting else min(dt, self.state.to_tick_s, MAX_STEP_S)
            dt -= piece
            self._piece(piece, resting)

    def _piece(self, dt: float, resting: bool) -> None:
        state = self.state
        if not resting:
            left, rear, right = (motor.move(dt, state.battery_v) for motor in self.motors)
            self._roll(
                left * self.params.left_m_per_count,
                rear * self.params.left_m_per_count,
                right * self.params.right_m_per_count,
                dt,
            )
        self._unaccounted_s += dt
        state.to_tick_s -= dt
        if state.to_tick_s <= 1e-9:
            self._tick(resting)

    def _tick(self, resting: bool) -> None:
        self._update_battery(self._unaccounted_s)
        self._unaccounted_s = 0.0
        period = 1.0 / self.params.control_hz
        self.state.to_tick_s += period * math.ceil((1e-9 - self.state.to_tick_s) / period)
        if not resting:
            for motor in self.motors:
                motor.control(period, self.gains)

    def _roll(self, left_m: float, rear_m: float, right_m: float, dt: float) -> None:
        """Moves the pose as the wheels roll, as far as nothing stands in the way."""
        state = self.state
        forward, aside, turn = self._twist(*map(self._jittered, (left_m, rear_m, right_m)))
        if self.params.turn_noise:
            turn += self._rng.gauss(0.0, math.sqrt(self.params.turn_noise * abs(turn)))
        old = Pose(state.x_m, state.y_m, state.yaw_rad)

        def after(share: float) -> Pose:
            return _along_arc(old, share * forward, share * aside, share * turn)

        furthest = max(abs(left_m), abs(rear_m if self.params.omni_radius_m else 0.0), abs(right_m))
        share = 1.0 if self.way is None else self.way(old, furthest, after, dt)
        state.bumped = share < 1.0
        state.x_m, state.y_m, state.yaw_rad = after(share)

    def _jittered(self, way_m: float) -> float:
        """The way that a wheel makes on the floor, for what its encoder sees."""
        noise = self.params.wheel_noise
        return way_m + self._rng.gauss(0.0, math.sqrt(noise * abs(way_m))) if noise else way_m

    def _twist(self, left_m: float, rear_m: float, right_m: float) -> Tuple[float, float, float]:
        """Forward, to the left [m] and turned [rad] for these ways of the wheels."""
        keeps = 1.0 - self.params.turn_slip
        if self.params.omni_radius_m:
            forward, aside, turn = twist_of(
                (left_m, rear_m, right_m), self.params.omni_radius_m, self.params.omni_angles_rad
            )
            return forward, aside, turn * keeps
        return 0.5 * (left_m + right_m), 0.0, (right_m - left_m) / self.params.wheel_separation_m * keeps

    def _update_battery(self, dt: float) -> None:
        params, state = self.params, self.state
        motors_a = sum(self._motor_a(motor) for motor in self.motors)
        current = params.idle_a + motors_a
        state.charge -= current * dt / 3600.0 / params.capacity_ah
        state.battery_v = max(
            0.0, interpolate(params.rest_curve, state.charge) - current * params.resistance_ohm
        )
        final = params.ambient_c + params.heating_c_per_a * motors_a
        state.temperature_c += (final - state.temperature_c) * -math.expm1(-dt / params.heating_s)

    def _motor_a(self, motor: Motor) -> float:
        share = motor.speed / motor.params.no_load_counts_s
        if share == 0.0 and motor.duty == 0.0:
            return 0.0
        return self.params.running_a * abs(share) + self.params.starting_a * abs(motor.duty - share)


def _along_arc(start: Pose, forward_m: float, aside_m: float, turn_rad: float) -> Pose:
    """Where steady speeds lead that make these ways in the robot's own frame: along a circle."""
    half = 0.5 * turn_rad
    shrink = math.sin(half) / half if abs(half) > 1e-9 else 1.0
    middle = Pose(start.x_m, start.y_m, start.yaw_rad + half)
    return Pose(*middle.beside(forward_m * shrink, aside_m * shrink)[:2], start.yaw_rad + turn_rad)
