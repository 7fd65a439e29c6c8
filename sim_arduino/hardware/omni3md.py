"""The motor board (Bot'n Roll OMNI-3MD): its program as methods, and its registers, which give them to the I2C bus.

Every call carries the time at which it happens; the physics runs to this time first.
"""

import math
import struct
from collections import deque
from dataclasses import replace
from typing import Callable, Deque, Dict, NamedTuple, Tuple

from mrl_driver.robot.models import RobotModel

from .encoders import EncoderCounter
from .motor import BoardGeometry
from .robot_physics import RobotPhysics, shares_for

ADDRESS = 0x18
MOST_PRESCALE = 4  # largest prescaler: 10000 pulses a count
_CALIBRATION_S = 1.0
VERSION = (1, 72)
KEY = b"\xaa\x55"
_OFFSETS = {0xD8: 0, 0xD7: 2, 0xD6: 4, 0xD5: 6, 0xD4: 8, 0xD3: 10, 0xFE: 11, 0xFD: 12}
"""Offset of each register in the bytes of a read."""


class MotorCommand(NamedTuple):
    """A command that reached the motor board: time [s], register, values."""

    time_s: float
    code: int
    values: Tuple[int, ...]


def _share(percent: int) -> float:
    return max(-100, min(100, percent)) / 100.0


class Omni3MD:
    """The motor board of one robot, wired to its motors; an I2C slave.

    In its registers, 16-bit values have their high byte first; the key bytes AA 55 guard against accidental writes.
    """

    def __init__(self, robot: RobotPhysics, model: RobotModel) -> None:
        self.robot = robot
        self.present = True  # false takes the board off the bus
        self.fed = False
        """True stands for a master that talks all the time, so that the I2C timeout never expires."""
        self.busy_nack = False
        """True refuses writes while the EEPROM is being written, as the real board may do."""
        self.too_early = 0  # number of writes that came while the EEPROM was being written
        self.commands: Deque[MotorCommand] = deque(maxlen=1000)
        """The last commands that had an effect, oldest first."""
        self.time_s = 0.0
        self.timeout_s = 0.0
        board = model.board
        self._fitted = BoardGeometry(*(board[name] for name in BoardGeometry._fields))
        self._track_m = model.base.wheel_separation_m
        self._m_per_count = model.base.metres_per_count
        self.geometry = self._fitted
        self.counters = (EncoderCounter(), EncoderCounter(), EncoderCounter())
        self._traffic_s = 0.0
        self._calibrated_s = math.inf
        self._busy_until_s = 0.0
        self._pointer = 0
        self._writers = self._register_writers()  # layout and method of each writable register

    # ---- time

    def advance(self, time_s: float) -> None:
        """Runs the robot to `time_s` [s], including the I2C timeout and the end of a calibration."""
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
        for motor in self.robot.motors:
            motor.brake()

    def _note(self, time_s: float, code: int, *values: int) -> None:
        self.touch(time_s)
        self._calibrated_s = math.inf
        self.commands.append(MotorCommand(time_s, code, values))

    def touch(self, time_s: float) -> None:
        """Notes traffic on the bus: the I2C timeout starts again."""
        self.advance(time_s)
        self._traffic_s = self.time_s

    # ---- commands

    def stop(self, time_s: float) -> None:
        """Brakes all motors at once."""
        self._note(time_s, 0xFC)
        for motor in self.robot.motors:
            motor.brake()

    def calibrate(self, time_s: float, directions: Tuple[int, int, int] = (1, 1, 1)) -> None:
        """Runs the motors at full duty for 1 s, stores their speeds [count per control period], and brakes."""
        self._note(time_s, 0xFB, *directions)
        for motor, direction in zip(self.robot.motors, directions):
            motor.set_duty(1.0 if direction else -1.0)
        self._calibrated_s = self.time_s + _CALIBRATION_S

    def move_percent(self, time_s: float, percents: Tuple[int, int, int], pid: bool) -> None:
        """Moves the three motors at shares [%] of the rated speed (with `pid`) or of the voltage."""
        self._note(time_s, 0xF8 if pid else 0xF7, *percents)
        for motor, percent in zip(self.robot.motors, percents):
            if pid:
                motor.set_speed(_share(percent) * motor.params.rated_counts_s)
            else:
                motor.set_duty(_share(percent))

    def move_differential(self, time_s: float, linear_mm_s: int, angular_mrad_s: int) -> None:
        """Drives: motor 1 is the left wheel, motor 3 the right one.

        The radii in the board's default settings are fitted so that speeds are in SI units; other radii change them.
        """
        self._note(time_s, 0xEB, linear_mm_s, angular_mrad_s)
        geometry, fitted = self.geometry, self._fitted
        half_axle_m = 0.5 * self._track_m * geometry.axis_radius / fitted.axis_radius
        counts_per_m = (
            fitted.wheel_radius
            / geometry.wheel_radius
            * geometry.gearbox
            * geometry.encoder_counts
            / (fitted.gearbox * fitted.encoder_counts)
            / self._m_per_count
        )
        linear, turning = linear_mm_s / 1000.0, angular_mrad_s / 1000.0 * half_axle_m
        left, _, right = self.robot.motors
        left.set_speed((linear - turning) * counts_per_m)
        right.set_speed((linear + turning) * counts_per_m)

    def move_omni(self, time_s: float, speed: int, rotation: int, direction: int) -> None:
        """Moves a robot with three wheels.

        Speed and rotation are -100 to 100 [%]; the direction is 0 to 360 [deg] counter-clockwise from forward.
        """
        self._note(time_s, 0xFA, speed, rotation, direction)
        shares = shares_for(_share(speed), _share(rotation), math.radians(direction))
        for motor, share in zip(self.robot.motors, shares):
            motor.set_speed(share * motor.params.rated_counts_s)

    def move_to_position(self, time_s: float, motor: int, percent: int, position: int, hold: bool) -> None:
        """Turns motor 1, 2 or 3 until its counter is at `position`, at most at `percent`; `hold` keeps it there."""
        self._note(time_s, 0xEE, motor, percent, position, int(hold))
        if 1 <= motor <= 3:
            index = motor - 1
            moved, counter, before = self.robot.motors[index], self.counters[index], self._pulses(index)
            pulses = (position - counter.read(before)) * counter.prescale
            share = min(100, abs(percent)) / 100.0
            moved.go_to(before + pulses + 0.5, share * moved.params.rated_counts_s, hold)

    def set_gains(self, time_s: float, kp: int, ki: int, kd: int) -> None:
        """Sets the gains of the speed control; writes EEPROM for 15 ms."""
        self._note(time_s, 0xF4, kp, ki, kd)
        self.robot.gains = replace(self.robot.gains, kp=kp, ki=ki, kd=kd)
        self._busy(0.015)

    def set_ramp(self, time_s: float, time_ms: int, gain: int) -> None:
        """Sets the ramp from standstill to rated speed [ms] and its start; writes EEPROM for 10 ms."""
        self._note(time_s, 0xEC, time_ms, gain)
        self.robot.gains = replace(self.robot.gains, ramp_ms=time_ms, ramp_gain=gain)
        self._busy(0.010)

    def set_timeout(self, time_s: float, tenths: int) -> None:
        """Sets the time without traffic after which the motors stop [100 ms], 0: never; writes EEPROM for 5 ms."""
        self._note(time_s, 0xF1, tenths)
        self.timeout_s = tenths / 10.0
        self._busy(0.005)

    def set_geometry(self, time_s: float, geometry: BoardGeometry) -> None:
        """Sets the differential geometry; writes EEPROM for 20 ms."""
        self._note(time_s, 0xEA, *geometry)
        if all(geometry):
            self.geometry = geometry
        self._busy(0.020)

    def set_prescaler(self, time_s: float, encoder: int, value: int) -> None:
        """Sets the pulses per count as a power of ten; the count stays; writes EEPROM for 10 ms."""
        self._note(time_s, 0xF0, encoder, value)
        if 1 <= encoder <= 3 and 0 <= value <= MOST_PRESCALE:
            self.counters[encoder - 1].set_prescaler(value, self._pulses(encoder - 1))
        self._busy(0.010)

    def preset_encoder(self, time_s: float, encoder: int, count: int) -> None:
        """Sets the counter of encoder 1, 2 or 3."""
        self._note(time_s, 0xEF, encoder, count)
        if 1 <= encoder <= 3:
            self.counters[encoder - 1].preset(count, self._pulses(encoder - 1))

    def _pulses(self, index: int) -> int:
        """Whole pulses of a motor's encoder since power-up."""
        return math.floor(self.robot.motors[index].travel)

    def _busy(self, duration_s: float) -> None:
        self._busy_until_s = self.time_s + duration_s

    # ---- readings

    def encoder(self, number: int, time_s: float) -> int:
        """Count of encoder 1, 2 or 3 (int16)."""
        self.touch(time_s)
        return self.counts()[number - 1]

    def counts(self) -> Tuple[int, int, int]:
        """Counts of the three encoders (int16) at the time of the last call."""
        left, rear, right = (self.counters[index].read(self._pulses(index)) for index in range(3))
        return left, rear, right

    def battery_v(self, time_s: float) -> float:
        """Battery voltage [V]."""
        self.touch(time_s)
        return self.robot.state.battery_v

    def temperature_c(self, time_s: float) -> float:
        """Temperature of the board [degC]."""
        self.touch(time_s)
        return self.robot.state.temperature_c

    # ---- registers

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
        """One I2C read, from the register of the last write on; bytes after the last register are 0xFF."""
        self.touch(time_s)
        image = self._registers()
        offset = _OFFSETS.get(self._pointer, len(image))
        return image[offset : offset + count].ljust(count, b"\xff")

    def _registers(self) -> bytes:
        """The readable bytes, in the order of a read."""
        state = self.robot.state
        words = [*self.counts(), round(state.battery_v * 10.0), round(state.temperature_c * 10.0)]
        return struct.pack(">5h3B", *words, round(self.robot.params.control_hz), *VERSION)

    def _register_writers(self) -> Dict[int, Tuple[str, Callable[..., None]]]:
        return {
            0xFC: ("2B", _keyed(self.stop, 0, 1)),
            0xFB: ("5B", _keyed(lambda time_s, *directions: self.calibrate(time_s, directions), 3, 4)),
            0xFA: ("b2h", self.move_omni),
            0xF8: ("3h", lambda time_s, *percents: self.move_percent(time_s, percents, True)),
            0xF7: ("3h", lambda time_s, *percents: self.move_percent(time_s, percents, False)),
            0xF4: ("3H", self.set_gains),
            0xF1: ("4B", self._write_timeout),
            0xF0: ("4B", _keyed(self.set_prescaler, 2, 3)),
            0xEF: ("Bh2B", _keyed(self.preset_encoder, 2, 3)),
            0xEE: ("BhhB", lambda time_s, m, s, p, hold: self.move_to_position(time_s, m, s, p, bool(hold))),
            0xEC: ("2H", self.set_ramp),
            0xEB: ("2h", self.move_differential),
            0xEA: ("4H", lambda time_s, *values: self.set_geometry(time_s, BoardGeometry(*values))),
        }

    def _write_timeout(self, time_s: float, first: int, key1: int, again: int, key2: int) -> None:
        if first == again and bytes((key1, key2)) == KEY:
            self.set_timeout(time_s, first)


def _keyed(method: Callable[..., None], *positions: int) -> Callable[..., None]:
    """Calls a method with the other values if the key bytes are at these positions."""

    def call(time_s: float, *values: int) -> None:
        if bytes(values[i] for i in positions) == KEY:
            method(time_s, *(value for i, value in enumerate(values) if i not in positions))

    return call
