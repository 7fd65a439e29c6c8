"""The motor board (Bot'n Roll OMNI-3MD): its program as methods, and its registers as an I2C slave at 0x18.

Every call says when it happens; the physics is carried to that moment first.  Registers: 16-bit values, high byte
first; the key bytes AA 55 guard what must not happen by accident.
"""

import math
import struct
from collections import deque
from typing import Callable, Deque, Dict, List, NamedTuple, Tuple

from mrl_driver.robots import RobotModel

from .motor import Gains
from .omni import shares_for
from .physics import Robot

ADDRESS = 0x18
VERSION = (1, 72)
KEY = b"\xaa\x55"
_PRESCALES = (1, 10, 100, 1000, 10000)
_CALIBRATION_S = 1.0


class MotorCommand(NamedTuple):
    """What reached the motor board: when [s], its register, its values."""

    time_s: float
    code: int
    values: Tuple[int, ...]


class Geometry(NamedTuple):
    """The differential geometry in the motor board's own units."""

    axis_radius: int
    """Half the axle [0.01 mm]."""
    wheel_radius: int
    """[0.01 mm]."""
    gearbox: int
    """Motor turns per wheel turn [0.1]."""
    encoder_counts: int
    """Counts per motor turn [0.1]."""


class _Counter:
    """A 16-bit counter behind a prescaler: whole pulses come from the motor's travel."""

    def __init__(self) -> None:
        self.count, self.pulses, self.prescale = 0, 0, 1

    def read(self, travel: float) -> int:
        return _int16(self.count + (math.floor(travel) - self.pulses) // self.prescale)

    def preset(self, count: int, travel: float) -> None:
        self.count, self.pulses = count, math.floor(travel)


def _int16(value: int) -> int:
    return (value + 0x8000 & 0xFFFF) - 0x8000


def _share(percent: int) -> float:
    return max(-100, min(100, percent)) / 100.0


class Omni3MD:
    """The motor board of one robot, wired to its motors.

    Attributes:
        present: False takes the board off the bus.
        fed: True stands for a master that talks all the time, so that the I2C timeout never ends.
        busy_nack: True refuses writes while the EEPROM is being written, as the real board may.
        too_early: Writes that came in such a time.
        commands: The last commands that had an effect, oldest first.
        saved: Encoder counts in its EEPROM, with which it starts.
    """

    def __init__(self, robot: Robot, model: RobotModel) -> None:
        self.robot = robot
        self.present = True
        self.fed = False
        self.busy_nack = False
        self.too_early = 0
        self.commands: Deque[MotorCommand] = deque(maxlen=1000)
        self.time_s = 0.0
        self.timeout_s = 0.0
        board = model.board
        self._fitted = Geometry(*(board[name] for name in Geometry._fields))
        self._track_m = model.drive.wheel_separation_m
        self._m_per_count = model.drive.metres_per_count
        self.geometry = self._fitted
        self.counters = (_Counter(), _Counter(), _Counter())
        self.maxima = [0, 0, 0]
        self.saved = (0, 0, 0)
        self._traffic_s = 0.0
        self._calibrated_s = math.inf
        self._busy_until_s = 0.0
        self._pointer = 0
        self._writers = self._register_writers()

    # ---- time

    def advance(self, time_s: float) -> None:
        """Carries the robot to `time_s` [s]; the I2C timeout and the end of a calibration happen on the way."""
        while time_s > self.time_s:
            quiet_s = self._traffic_s + self.timeout_s if self.timeout_s and not self.fed else math.inf
            stop_s = min(quiet_s, self._calibrated_s)
            piece_end = min(time_s, max(stop_s, self.time_s))
            self.robot.step(piece_end - self.time_s)
            self.time_s = piece_end
            if stop_s <= piece_end:
                self._time_is_up(quiet_s <= piece_end)

    def _time_is_up(self, quiet: bool) -> None:
        if quiet:
            self._traffic_s = math.inf
        if self._calibrated_s <= self.time_s:
            self._calibrated_s = math.inf
            self.maxima = [round(abs(m.speed) / self.robot.params.control_hz) for m in self.robot.motors]
        for motor in self.robot.motors:
            motor.brake()

    def _note(self, time_s: float, code: int, *values: int) -> None:
        self.touch(time_s)
        self._calibrated_s = math.inf
        self.commands.append(MotorCommand(time_s, code, values))

    def touch(self, time_s: float) -> None:
        """Any traffic on the bus: the timeout starts again."""
        self.advance(time_s)
        self._traffic_s = self.time_s

    # ---- commands

    def stop(self, time_s: float) -> None:
        """Brakes all motors at once."""
        self._note(time_s, 0xFC)
        for motor in self.robot.motors:
            motor.brake()

    def calibrate(self, time_s: float, ways: Tuple[int, int, int] = (1, 1, 1)) -> None:
        """Runs the motors at full duty for a second, notes their speeds [count per control period], brakes."""
        self._note(time_s, 0xFB, *ways)
        for motor, way in zip(self.robot.motors, ways):
            motor.set_duty(1.0 if way else -1.0)
        self._calibrated_s = self.time_s + _CALIBRATION_S

    def move_percent(self, time_s: float, percents: Tuple[int, int, int], pid: bool) -> None:
        """Moves the three motors: with `pid` at shares of the rated speed, else at shares of the voltage [%]."""
        self._note(time_s, 0xF8 if pid else 0xF7, *percents)
        for index, percent in enumerate(percents):
            self._move_one(index, percent, pid)

    def move_motor(self, time_s: float, motor: int, percent: int, pid: bool) -> None:
        """Moves motor 1, 2 or 3 alone [%]."""
        self._note(time_s, 0xF6 if pid else 0xF5, motor, percent)
        if 1 <= motor <= 3:
            self._move_one(motor - 1, percent, pid)

    def _move_one(self, index: int, percent: int, pid: bool) -> None:
        motor, share = self.robot.motors[index], _share(percent)
        if pid:
            motor.set_speed(share * motor.params.rated_counts_s)
        else:
            motor.set_duty(share)

    def move_differential(self, time_s: float, linear_mm_s: int, angular_mrad_s: int) -> None:
        """Drives: motor 1 is the left wheel, motor 3 the right one.

        The board's radii are fitted values; its scale makes them give SI speeds, so other radii change the speeds.
        """
        self._note(time_s, 0xEB, linear_mm_s, angular_mrad_s)
        told, fitted = self.geometry, self._fitted
        half_axle_m = 0.5 * self._track_m * told.axis_radius / fitted.axis_radius
        counts_per_m = (
            fitted.wheel_radius
            / told.wheel_radius
            * told.gearbox
            * told.encoder_counts
            / (fitted.gearbox * fitted.encoder_counts)
            / self._m_per_count
        )
        linear, turning = linear_mm_s / 1000.0, angular_mrad_s / 1000.0 * half_axle_m
        left, _, right = self.robot.motors
        left.set_speed((linear - turning) * counts_per_m)
        right.set_speed((linear + turning) * counts_per_m)

    def move_omni(self, time_s: float, speed: int, rotation: int, direction: int) -> None:
        """Moves a robot with three wheels: speed and rotation -100 to 100 [%], direction 0 to 360 [deg]
        counter-clockwise from forward."""
        self._note(time_s, 0xFA, speed, rotation, direction)
        shares = shares_for(_share(speed), _share(rotation), math.radians(direction))
        for motor, share in zip(self.robot.motors, shares):
            motor.set_speed(share * motor.params.rated_counts_s)

    def move_to_position(self, time_s: float, motor: int, percent: int, position: int, hold: bool) -> None:
        """Turns motor 1, 2 or 3 until its counter shows `position`, at most so fast [%], and holds it or not."""
        self._note(time_s, 0xEE, motor, percent, position, int(hold))
        if 1 <= motor <= 3:
            moved, counter = self.robot.motors[motor - 1], self.counters[motor - 1]
            pulses = (position - counter.read(moved.travel)) * counter.prescale
            share = min(100, abs(percent)) / 100.0
            moved.go_to(math.floor(moved.travel) + pulses + 0.5, share * moved.params.rated_counts_s, hold)

    def set_gains(self, time_s: float, kp: int, ki: int, kd: int) -> None:
        """Gains of the speed control; 15 ms of EEPROM."""
        self._note(time_s, 0xF4, kp, ki, kd)
        gains = self.robot.gains
        self.robot.gains = Gains(kp, ki, kd, gains.ramp_ms, gains.ramp_gain)
        self._busy(0.015)

    def set_ramp(self, time_s: float, time_ms: int, gain: int) -> None:
        """Ramp from standstill to rated speed [ms] and its take-off; 10 ms of EEPROM."""
        self._note(time_s, 0xEC, time_ms, gain)
        gains = self.robot.gains
        self.robot.gains = Gains(gains.kp, gains.ki, gains.kd, time_ms, gain)
        self._busy(0.010)

    def set_timeout(self, time_s: float, tenths: int) -> None:
        """The motors stop after so long without traffic [100 ms]; 0 is never; 5 ms of EEPROM."""
        self._note(time_s, 0xF1, tenths)
        self.timeout_s = tenths / 10.0
        self._busy(0.005)

    def set_geometry(self, time_s: float, geometry: Geometry) -> None:
        """Differential geometry; 20 ms of EEPROM."""
        self._note(time_s, 0xEA, *geometry)
        if all(geometry):
            self.geometry = geometry
        self._busy(0.020)

    def set_prescaler(self, time_s: float, encoder: int, value: int) -> None:
        """Pulses per count as a power of ten; the count stays; 10 ms of EEPROM."""
        self._note(time_s, 0xF0, encoder, value)
        if 1 <= encoder <= 3 and 0 <= value < len(_PRESCALES):
            counter, travel = self.counters[encoder - 1], self.robot.motors[encoder - 1].travel
            counter.preset(counter.read(travel), travel)
            counter.prescale = _PRESCALES[value]
        self._busy(0.010)

    def preset_encoder(self, time_s: float, encoder: int, count: int) -> None:
        """Sets the counter of encoder 1, 2 or 3."""
        self._note(time_s, 0xEF, encoder, count)
        if 1 <= encoder <= 3:
            self.counters[encoder - 1].preset(count, self.robot.motors[encoder - 1].travel)

    def save_positions(self, time_s: float) -> None:
        """Puts the counts into the EEPROM; 10 ms, as for the ramp's four bytes."""
        self._note(time_s, 0xED)
        left, rear, right = (c.read(m.travel) for c, m in zip(self.counters, self.robot.motors))
        self.saved = left, rear, right
        self._busy(0.010)

    def power_cycle(self, time_s: float) -> None:
        """Motor power off and on: the motors stop, the counts are those saved last."""
        self.advance(time_s)
        for motor, counter, count in zip(self.robot.motors, self.counters, self.saved):
            motor.brake()
            counter.preset(count, motor.travel)
        self._calibrated_s = self._traffic_s = math.inf

    def _busy(self, duration_s: float) -> None:
        self._busy_until_s = self.time_s + duration_s

    # ---- readings

    def encoder(self, number: int, time_s: float) -> int:
        """Count of encoder 1, 2 or 3 (int16)."""
        self.touch(time_s)
        return self.counters[number - 1].read(self.robot.motors[number - 1].travel)

    def battery_v(self, time_s: float) -> float:
        """Battery voltage [V]."""
        self.touch(time_s)
        return self.robot.state.battery_v

    def temperature_c(self, time_s: float) -> float:
        """Temperature of the board [degC]."""
        self.touch(time_s)
        return self.robot.state.temperature_c

    # ---- the I2C slave

    def write(self, data: bytes, time_s: float) -> bool:
        """One I2C write: a register, then its data.  False if the board did not acknowledge."""
        if not data:
            return self.present
        early = time_s < self._busy_until_s
        self.too_early += early
        if not self.present or (early and self.busy_nack):
            return False
        self.touch(time_s)
        self._pointer = data[0]
        shape, writer = self._writers.get(data[0], ("", None))
        fields = struct.Struct(">" + shape)
        if writer is not None and len(data) == 1 + fields.size:
            writer(time_s, *fields.unpack(data[1:]))
        return True

    def read(self, count: int, time_s: float) -> bytes:
        """One I2C read from the register of the last write; past the last register all bits are 1."""
        self.touch(time_s)
        image, start = self._registers()
        offset = start.get(self._pointer, len(image))
        return image[offset : offset + count].ljust(count, b"\xff")

    def _registers(self) -> Tuple[bytes, Dict[int, int]]:
        """Bytes that can be read, in the order in which one transfer runs through them, and where each starts."""
        state, motors = self.robot.state, self.robot.motors
        words = [counter.read(motor.travel) for counter, motor in zip(self.counters, motors)]
        words += [round(state.battery_v * 10.0), round(state.temperature_c * 10.0)]
        image = struct.pack(">5hB3H2B", *words, round(self.robot.params.control_hz), *self.maxima, *VERSION)
        start = {
            0xD8: 0,
            0xD7: 2,
            0xD6: 4,
            0xD5: 6,
            0xD4: 8,
            0xD3: 10,
            0xD2: 11,
            0xD1: 13,
            0xD0: 15,
            0xFE: 17,
            0xFD: 18,
        }
        return image, start

    def _register_writers(self) -> Dict[int, Tuple[str, Callable[..., None]]]:
        """Layout and method of each register that can be written."""

        def keyed(method: Callable[..., None], *positions: int) -> Callable[..., None]:
            return _Keyed(method, positions)

        return {
            0xFC: ("2B", keyed(self.stop, 0, 1)),
            0xFB: ("5B", keyed(lambda time_s, *ways: self.calibrate(time_s, ways), 3, 4)),
            0xFA: ("b2h", self.move_omni),
            0xED: ("2B", keyed(self.save_positions, 0, 1)),
            0xF8: ("3h", lambda time_s, *percents: self.move_percent(time_s, percents, True)),
            0xF7: ("3h", lambda time_s, *percents: self.move_percent(time_s, percents, False)),
            0xF6: ("Bh", lambda time_s, motor, percent: self.move_motor(time_s, motor, percent, True)),
            0xF5: ("Bh", lambda time_s, motor, percent: self.move_motor(time_s, motor, percent, False)),
            0xF4: ("3H", self.set_gains),
            0xF1: ("4B", self._write_timeout),
            0xF0: ("4B", keyed(self.set_prescaler, 2, 3)),
            0xEF: ("Bh2B", keyed(self.preset_encoder, 2, 3)),
            0xEE: ("BhhB", lambda time_s, m, s, p, hold: self.move_to_position(time_s, m, s, p, bool(hold))),
            0xEC: ("2H", self.set_ramp),
            0xEB: ("2h", self.move_differential),
            0xEA: ("4H", lambda time_s, *values: self.set_geometry(time_s, Geometry(*values))),
        }

    def _write_timeout(self, time_s: float, first: int, key1: int, again: int, key2: int) -> None:
        if first == again and bytes((key1, key2)) == KEY:
            self.set_timeout(time_s, first)


class _Keyed:
    """Calls a method if the key bytes stand where they must, without them."""

    def __init__(self, method: Callable[..., None], positions: Tuple[int, ...]) -> None:
        self._method, self._positions = method, positions

    def __call__(self, time_s: float, *values: int) -> None:
        if bytes(values[i] for i in self._positions) == KEY:
            rest: List[int] = [value for i, value in enumerate(values) if i not in self._positions]
            self._method(time_s, *rest)
