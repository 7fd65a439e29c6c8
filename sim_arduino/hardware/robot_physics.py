"""The robot's body: motors, pose, battery, temperature.  `Params`, `State`, `Robot.step(dt)`; no bytes, no clock.

The pose follows the true distances of the wheels along exact arcs.  Numbers without another source are from
(Araujo 2012).
"""

import math
import random
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import WHEELS
from mrl_driver.robot.models import MecanumDrive, OmniDrive, RobotModel
from mrl_driver.robot.models.drives import metres_per_count

from .dc_motor import DcMotor
from .motor import ControlSettings, Motor, MotorParams

MAX_STEP_S = 0.02  # longest step that is integrated as one arc while the robot moves [s]
_REST_STEP_S = 1.0  # longest step while the robot stands still, for battery and temperature [s]
_ROTOR_S, _BODY_S = 0.057, 0.023
"""Parts of a motor's time constant [s]: its rotor, and the robot's body at a load of 1, with 39 mm wheels and a stall
torque of 1.8 Nm; estimated."""
_TRACK_FRICTION, _WHEEL_FRICTION = 0.02, 0.006
"""Share of the no-load speed lost to rolling friction at a load of 1: 0.1 of the weight on tracks, 0.03 on wheels;
estimated."""
OMNI_ANGLES_RAD = (math.pi / 3, math.pi, -math.pi / 3)
"""Places of three omni wheels on a circle, counter-clockwise from forward: motor 1 front left, 2 rear, 3 front right.
Each rolls along the circle; positive speeds of all three turn the robot counter-clockwise."""


class Params(NamedTuple):
    """Parameters of a robot.

    Motors 1 and 3 of the motor board are left and right.  Motor 2 drives the rear wheel of a robot with three wheels.
    """

    motor: MotorParams
    left_m_per_count: float
    right_m_per_count: float
    wheel_separation_m: float
    turn_slip: float  # share of the yaw that is lost by slip in a turn, 0 to below 1
    omni_radius_m: float  # distance of three omni wheels from the middle [m]; 0 means two wheels or tracks
    rear_m_per_count: Tuple[float, float]
    """Of the left and the right wheel at the rear of four."""
    aside_share: float  # share of the way to the side of ideal mecanum wheels; 0 for others
    omni_angles_rad: Tuple[float, ...]
    """Angles at which the wheels of motors 1, 2 and 3 are mounted, counter-clockwise from forward."""
    control_hz: float  # rate of the motor board's control loop [Hz]: 10, 20 or 40
    capacity_ah: float
    rest_curve: Tuple[Tuple[float, float], ...]
    """Battery voltage at no load, as pairs of charge (1 full, 0 empty) and voltage [V], rising."""
    wheel_noise: float  # variance of a wheel's distance on the floor, per distance [m2/m]
    turn_noise: float  # variance of the yaw by slip, per angle turned [rad2/rad]
    resistance_ohm: float = 0.15
    idle_a: float = 1.3
    """Current with the motors at rest [A].  It and `running_a` are chosen: packs last 2 to 3 h, less at higher speed,
    as the published ones (Araujo 2012); here 2.8 h at 50 mm/s and 2.3 h at 200 mm/s."""
    running_a: float = 1.6  # current of one motor at its no-load speed [A]
    starting_a: float = 5.0  # additional current of one stalled motor at full duty [A]
    ambient_c: float = 25.0
    heating_c_per_a: float = 6.0
    """Final temperature rise of the motor board per ampere through the motors [degC/A]."""
    heating_s: float = 300.0


@dataclass
class State:
    """Pose and condition of the robot.  x points forward at the start, y left; yaw is counter-clockwise, unwrapped."""

    x_m: float
    y_m: float
    yaw_rad: float
    temperature_c: float
    to_tick_s: float = field(repr=False)  # time to the motor board's next control tick [s]
    charge: float = 1.0  # charge of the battery: 1 full, 0 empty, below 0 over-discharged
    battery_v: float = 0.0  # voltage at the motor board, under load [V]
    bumped: bool = False  # an obstacle stopped a part of the last motion, and the wheels slipped


class Errors(NamedTuple):
    """Differences between one robot and its model, which calibration finds."""

    left_scale: float = 1.0
    right_scale: float = 1.0  # true size of each wheel divided by the model's
    axle_scale: float = 1.0  # true distance between the wheels divided by the model's
    turn_slip: float = 0.0  # share of the yaw that is lost by slip in a turn
    load: float = 1.0  # true mass divided by the model's
    control_hz: float = 20.0  # rate of the motor board's control loop [Hz]: 10, 20 or 40
    wheel_noise: float = 0.0  # variance of a wheel's distance on the floor, per distance [m2/m]
    turn_noise: float = 0.0  # variance of the yaw by slip, per angle turned [rad2/rad]
    encoder_phase: float = 0.0
    """Delay of the edges of an encoder's channel B on an H-bridge board, as a share of a count, -0.45 to 0.45."""
    rear_left_scale: float = 1.0
    rear_right_scale: float = 1.0  # as the scales of the other wheels, of robots with four


AS_MODELLED = Errors()


def params_for(model: RobotModel, errors: Errors = AS_MODELLED, omni: bool = False) -> Params:
    """Parameters of a robot of this model; `omni` gives it three omni wheels."""
    drive, battery = model.base, model.battery
    per_turn = model.board["gearbox"] * model.board["encoder_counts"] / 100.0
    per_count = drive.metres_per_count
    rpm = (
        drive.full_speed_m_s / per_count
        if isinstance(drive, (OmniDrive, MecanumDrive))
        else 160.0 / 60.0 * per_turn
    )
    time_constant_s = _ROTOR_S + _BODY_S * errors.load
    friction = errors.load * (_TRACK_FRICTION if model.body.tracks else _WHEEL_FRICTION)
    motor = MotorParams(
        no_load_counts_s=rpm * 12.0 / 7.2,
        rated_counts_s=rpm,
        time_constant_s=time_constant_s,
        friction_counts_s=friction * rpm * 12.0 / 7.2,
        brake_counts_s2=2.0 / per_count * (_ROTOR_S + _BODY_S) / time_constant_s,
    )
    left_m, right_m, rear_left_m, rear_right_m = metres_per_count(drive, WHEELS)
    axle_m = drive.wheel_separation_m * errors.axle_scale
    return Params(
        motor,
        left_m * errors.left_scale,
        right_m * errors.right_scale,
        axle_m,
        1.0 - (1.0 - drive.turn_slip) * (1.0 - errors.turn_slip),
        0.5 * axle_m if omni or isinstance(drive, OmniDrive) else 0.0,
        (rear_left_m * errors.rear_left_scale, rear_right_m * errors.rear_right_scale),
        1.0 - drive.side_slip if isinstance(drive, MecanumDrive) else 0.0,
        tuple(map(math.radians, drive.angles_deg)) if isinstance(drive, OmniDrive) else OMNI_ANGLES_RAD,
        errors.control_hz,
        capacity_ah=battery.capacity_ah,
        rest_curve=_rest_curve(battery.empty_v, battery.full_v),
        wheel_noise=errors.wheel_noise,
        turn_noise=errors.turn_noise,
    )


def _rest_curve(empty_v: float, full_v: float) -> Tuple[Tuple[float, float], ...]:
    """Curve of a NiMH pack: steep at both ends, flat between; linear beyond, to 0 V and to a freshly charged pack."""
    shares = ((0.0, 0.0), (0.08, 0.4), (0.3, 0.62), (0.8, 0.75), (0.95, 0.85))
    levels = ((charge, empty_v + share * (full_v - empty_v)) for charge, share in shares)
    return ((-0.05, 0.0), *levels, (1.0, full_v), (1.1, full_v + 2.0))


def interpolate(pairs: Tuple[Tuple[float, float], ...], x: float) -> float:
    """Linear interpolation between `pairs` (rising x); constant beyond the ends."""
    index = bisect_left(pairs, (x,))
    if index == 0:
        return pairs[0][1]
    if index == len(pairs):
        return pairs[-1][1]
    (x0, y0), (x1, y1) = pairs[index - 1], pairs[index]
    return y0 + (y1 - y0) * (x - x0) / (x1 - x0)


Allow = Callable[[Pose, float, Callable[[float], Pose], float], float]
"""Computes the share of a motion that is possible, see `collision.Bumper.share`."""
Moved = Callable[[float, float, float, float], None]
"""Gets a motion at constant speeds: its duration [s], and how far forward [m], to the left [m] and around [rad]."""


class RobotPhysics:
    """Params, state and motors; `step` simulates them.

    `bridged` are three or four motors on H-bridges, which nothing here controls; None makes those of the motor board.
    """

    def __init__(
        self,
        params: Params,
        pose: Tuple[float, float, float] = (0.0, 0.0, 0.0),
        seed: int = 0,
        bridged: Optional[Sequence[DcMotor]] = None,
    ) -> None:
        self.params = params
        self.state = State(*pose, temperature_c=params.ambient_c, to_tick_s=1.0 / params.control_hz)
        self._bridged = tuple(bridged or ())
        self.motors: Tuple[Any, ...] = self._bridged or tuple(Motor(params.motor) for _ in range(3))
        """Left, rear and right motor; of four wheels left, rear left, right, rear right."""
        self.gains = ControlSettings()
        self.allow: Optional[Allow] = None  # limits motions at obstacles; None means an endless empty floor
        self._rng = random.Random(f"wheels {seed}")
        self.sag_v = 0.0  # voltage that a fault takes from the battery [V]
        self.grip = [1.0] * len(self.motors)
        """Share of the distances of the motors' wheels that moves the body; below 1 a wheel slips."""
        left, right = params.left_m_per_count, params.right_m_per_count
        rear_left, *rear_right = params.rear_m_per_count if len(self.motors) > 3 else (left,)
        self.m_per_count = (left, rear_left, right, *rear_right)
        """Ways of the motors' wheels for a count [m]."""
        self._unaccounted_s = 0.0
        self._bridges_a = 0.0
        self._told: List[Moved] = []  # get all motions
        self._longest_step_s = MAX_STEP_S
        self._update_battery(0.0)

    def report_motion(self, moved: Moved, longest_step_s: float) -> None:
        """Reports all motions from now on, in steps of at most `longest_step_s` [s] while the robot moves."""
        self._told.append(moved)
        self._longest_step_s = min(self._longest_step_s, longest_step_s)

    def set_battery(self, volts: float) -> None:
        """Sets the charge at which the battery has this voltage with the motors at rest."""
        rest = volts + self.params.idle_a * self.params.resistance_ohm if volts > 0.0 else 0.0
        self.state.charge = interpolate(tuple((v, c) for c, v in self.params.rest_curve), rest)
        self._update_battery(0.0)

    def sag(self, volts: float) -> None:
        """Takes this voltage from the battery [V] until the next call."""
        self.sag_v = volts
        self._update_battery(0.0)

    def step(self, dt: float) -> None:
        """Simulates `dt` [s] in pieces that end at the control ticks; the motion between ticks is exact."""
        while dt > 0.0:
            resting = all(motor.at_rest for motor in self.motors)
            piece = min(dt, _REST_STEP_S) if resting else min(dt, self.state.to_tick_s, self._longest_step_s)
            dt -= piece
            self._piece(piece, resting)

    def _piece(self, dt: float, resting: bool) -> None:
        state = self.state
        if not resting:
            turned = zip(self.motors, self.m_per_count, self.grip)
            self._roll(
                [motor.move(dt, state.battery_v) * metres * grip for motor, metres, grip in turned], dt
            )
        else:
            for moved in self._told:
                moved(dt, 0.0, 0.0, 0.0)
        self._unaccounted_s += dt
        state.to_tick_s -= dt
        if state.to_tick_s <= 1e-9:
            self._tick(resting)

    def _tick(self, resting: bool) -> None:
        self._update_battery(self._unaccounted_s)
        self._unaccounted_s = 0.0
        period = 1.0 / self.params.control_hz
        self.state.to_tick_s += period * math.ceil((1e-9 - self.state.to_tick_s) / period)
        if not resting and not self._bridged:
            for motor in self.motors:
                motor.control(period, self.gains)

    def _roll(self, wheels_m: Sequence[float], dt: float) -> None:
        """Moves the pose as the wheels roll, up to an obstacle."""
        state = self.state
        forward, aside, turn = self._twist([self._jittered(wheel_m) for wheel_m in wheels_m])
        if self.params.turn_noise:
            turn += self._rng.gauss(0.0, math.sqrt(self.params.turn_noise * abs(turn)))
        old = Pose(state.x_m, state.y_m, state.yaw_rad)

        def after(share: float) -> Pose:
            return _along_arc(old, share * forward, share * aside, share * turn)

        turning = wheels_m if len(wheels_m) > 3 or self.params.omni_radius_m else wheels_m[::2]
        furthest = max(map(abs, turning))
        share = 1.0 if self.allow is None else self.allow(old, furthest, after, dt)
        state.bumped = share < 1.0
        state.x_m, state.y_m, state.yaw_rad = after(share)
        for moved in self._told:
            moved(dt, share * forward, share * aside, share * turn)

    def _jittered(self, distance_m: float) -> float:
        """The distance of a wheel on the floor, from the distance that its encoder measures."""
        noise = self.params.wheel_noise
        return distance_m + self._rng.gauss(0.0, math.sqrt(noise * abs(distance_m))) if noise else distance_m

    def _twist(self, wheels_m: Sequence[float]) -> Tuple[float, float, float]:
        """Motion forward [m], to the left [m] and turn [rad] for these distances of the wheels."""
        keeps = 1.0 - self.params.turn_slip
        left_m, rear_m, right_m, *rear_right_m = wheels_m
        if rear_right_m:
            return self._twist_of_four(left_m, rear_m, right_m, rear_right_m[0], keeps)
        if self.params.omni_radius_m:
            forward, aside, turn = twist_of(wheels_m, self.params.omni_radius_m, self.params.omni_angles_rad)
            return forward, aside, turn * keeps
        return 0.5 * (left_m + right_m), 0.0, (right_m - left_m) / self.params.wheel_separation_m * keeps

    def _twist_of_four(
        self, left_m: float, rear_left_m: float, right_m: float, rear_right_m: float, keeps: float
    ) -> Tuple[float, float, float]:
        """The mean of what the wheels would do alone; the others slide."""
        aside = (right_m + rear_left_m - left_m - rear_right_m) * self.params.aside_share
        turn = (right_m + rear_right_m - left_m - rear_left_m) / (2.0 * self.params.wheel_separation_m)
        return 0.25 * (left_m + rear_left_m + right_m + rear_right_m), 0.25 * aside, turn * keeps

    def _update_battery(self, dt: float) -> None:
        params, state = self.params, self.state
        motors_a = self._motors_a(dt)
        current = params.idle_a + motors_a
        state.charge -= current * dt / 3600.0 / params.capacity_ah
        state.battery_v = max(
            0.0, interpolate(params.rest_curve, state.charge) - current * params.resistance_ohm - self.sag_v
        )
        final = params.ambient_c + params.heating_c_per_a * motors_a
        state.temperature_c += (final - state.temperature_c) * -math.expm1(-dt / params.heating_s)

    def _motors_a(self, dt: float) -> float:
        """Mean current of all motors in the last `dt` [s]; H-bridges keep their last one if no time has passed."""
        if not self._bridged:
            return sum(self._motor_a(motor) for motor in self.motors)
        if dt > 0.0:
            self._bridges_a = sum(motor.take_charge() for motor in self._bridged) / dt
        return self._bridges_a

    def _motor_a(self, motor: Motor) -> float:
        share = motor.speed / motor.params.no_load_counts_s
        return self.params.running_a * abs(share) + self.params.starting_a * abs(motor.duty - share)


def _along_arc(start: Pose, forward_m: float, aside_m: float, turn_rad: float) -> Pose:
    """The pose after a motion at constant speeds with these distances in the robot's frame: along a circle.

    It is not `geometry.advance`, so that an error of either shows as a difference between robot and odometry.
    """
    half = 0.5 * turn_rad
    shrink = math.sin(half) / half if abs(half) > 1e-9 else 1.0
    middle = Pose(start.x_m, start.y_m, start.yaw_rad + half)
    x_m, y_m, _ = middle.compose(forward_m * shrink, aside_m * shrink)
    return Pose(x_m, y_m, start.yaw_rad + turn_rad)


def twist_of(
    distances: Sequence[float], radius_m: float, angles_rad: Sequence[float] = OMNI_ANGLES_RAD
) -> Tuple[float, float, float]:
    """Motion forward [m], to the left [m] and turn [rad], if the wheels at these angles roll `distances` [m]."""
    forward = sum(-math.sin(angle) * distance for angle, distance in zip(angles_rad, distances)) * 2.0 / 3.0
    aside = sum(math.cos(angle) * distance for angle, distance in zip(angles_rad, distances)) * 2.0 / 3.0
    return forward, aside, sum(distances) / (3.0 * radius_m)


def shares_for(speed: float, rotation: float, direction_rad: float) -> Tuple[float, float, float]:
    """Shares of the rated speed for motors 1 to 3; if one would exceed 1, all are scaled down together.

    Speed and rotation are shares of the fastest, -1 to 1; the direction is counter-clockwise from forward.
    """
    shares = [speed * math.sin(direction_rad - angle) + rotation for angle in OMNI_ANGLES_RAD]
    most = max(1.0, *map(abs, shares))
    left, rear, right = (share / most for share in shares)
    return left, rear, right
