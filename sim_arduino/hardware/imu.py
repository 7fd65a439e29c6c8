"""An IMU of the MPU-6050 family on the I2C bus: its registers, and what it measures of the body's motion.

Registers, sample rate and delays: InvenSense RM-MPU-6000A-00, revision 4.2.  Errors: its data sheet PS-MPU-6000A-00,
revision 3.4, sections 6.1 and 6.2.
"""

import math
import random
import struct
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.robot.models import ImuMount

Vector = Tuple[float, float, float]

G_M_S2 = 9.80665
GYRO_COUNTS, ACCEL_COUNTS = (131.0, 65.5, 32.8, 16.4), (16384.0, 8192.0, 4096.0, 2048.0)
"""Counts per deg/s and per g, by the full scale in GYRO_CONFIG and ACCEL_CONFIG."""
SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG = 0x19, 0x1A, 0x1B, 0x1C
ACCEL_XOUT_H, GYRO_ZOUT_L, PWR_MGMT_1, WHO_AM_I = 0x3B, 0x48, 0x6B, 0x75
MPU6050, MPU9250 = 0x68, 0x71  # values of WHO_AM_I
SLEEP, RESET = 0x40, 0x80  # bits of PWR_MGMT_1
START_S = 0.03  # start-up time of the gyro after sleep, in which the data registers keep their values [s]
LONGEST_STEP_S = 0.005
"""Longest step of a moving body that carries an IMU [s]: the period of its samples as the board sets it up."""
_AWAKE_CLOCK = 0x01
_READ_ONLY = {*range(0x3A, 0x61), WHO_AM_I}
_DELAYS_S = (0.98e-3, 1.9e-3, 2.8e-3, 4.8e-3, 8.3e-3, 13.4e-3, 18.6e-3, 0.17e-3)
"""Delay of the gyro by the filter in CONFIG; the accelerometer gets the same filter, and differs by 0.4 ms at most."""
_SETTLED = 64  # samples after which a motion has left every filter at rates of 200 Hz and less
_TEMPERATURE = round((25.0 - 36.53) * 340.0)
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_GYRO_BIAS_RAD_S, _XY_BIAS_M_S2, _Z_BIAS_M_S2 = math.radians(20.0), 0.05 * G_M_S2, 0.08 * G_M_S2
_GYRO_SCALE = 0.03  # tolerances at 25 degC
_GYRO_NOISE, _ACCEL_NOISE = math.radians(0.005), 400e-6 * G_M_S2
_GYRO_WALK = math.radians(0.001)
"""Chosen: the data sheet gives no bias stability.  It moves the bias by 0.024 deg/s in ten minutes."""


class ImuErrors(NamedTuple):
    """Errors of an IMU, along the chip's axes; by default none but the accelerometer's noise.

    A chip whose values never change is a broken one; the noise keeps those of a robot at rest from being constant.
    """

    gyro_bias_rad_s: Vector = (0.0, 0.0, 0.0)  # rate at rest at power-up [rad/s]
    gyro_walk: float = 0.0  # drift of the bias as a random walk [rad/s/sqrt(s)]
    gyro_scale: Vector = (1.0, 1.0, 1.0)  # measured rate over true rate
    gyro_noise: float = 0.0  # white noise [rad/s/sqrt(Hz)]
    accel_bias_m_s2: Vector = (0.0, 0.0, 0.0)
    accel_noise: float = _ACCEL_NOISE  # white noise [m/s2/sqrt(Hz)]

    @classmethod
    def drawn(cls, seed: int) -> "ImuErrors":
        """Draw the errors of one chip: biases and scales with a third of the tolerance as standard deviation.

        None is beyond its tolerance.
        """
        rng = random.Random(f"imu {seed}")
        tolerances = [_GYRO_BIAS_RAD_S] * 3 + [_GYRO_SCALE] * 3 + [_XY_BIAS_M_S2, _XY_BIAS_M_S2, _Z_BIAS_M_S2]
        roll, pitch, yaw, x, y, z, *accel = (max(-t, min(t, rng.gauss(0.0, t / 3.0))) for t in tolerances)
        scale = 1.0 + x, 1.0 + y, 1.0 + z
        return cls(
            (roll, pitch, yaw), _GYRO_WALK, scale, _GYRO_NOISE, (accel[0], accel[1], accel[2]), _ACCEL_NOISE
        )


FLAWLESS_IMU = ImuErrors()


class InertialSensor:
    """Gyro and accelerometer on a body: samples of its motion, each the mean over a period, behind a low-pass filter.

    The sum of all samples of the gyro times the period is the angle turned.  `seed` draws the noise, together with the
    errors, so that chips with other errors have other noise.
    """

    def __init__(self, mount: ImuMount, errors: ImuErrors = FLAWLESS_IMU, seed: int = 0) -> None:
        self._mount, self._errors = mount, errors
        self._columns = tuple(mount.rotate(axis) for axis in _AXES)
        self._bias: List[float] = list(errors.gyro_bias_rad_s)
        self._rng = random.Random(f"imu noise {seed} {errors}")
        self.start(LONGEST_STEP_S, 0.0)

    def start(self, period_s: float, delay_s: float) -> None:
        """Start to measure, with this period and delay of the filter [s]; half the period is the least delay."""
        self.period_s = period_s
        self._share = period_s / (period_s + max(0.0, delay_s - 0.5 * period_s))
        bandwidth = math.sqrt(0.5 / period_s)
        self._gyro_sd = self._errors.gyro_noise * bandwidth
        self._accel_sd = self._errors.accel_noise * bandwidth
        self.samples = 0  # number of samples since the start
        self.gyro_rad_s = self.accel_m_s2 = (0.0, 0.0, 0.0)
        """The last sample in the chip's axes, before it is rounded; gravity is +1 g along an axis that points up."""
        self._velocity: Optional[Tuple[float, float]] = None
        self._restart_period()

    def _restart_period(self) -> None:
        self._part_s = self._forward_m = self._aside_m = self._turn_rad = 0.0

    def moved(self, dt: float, forward_m: float, aside_m: float, turn_rad: float) -> None:
        """Note that the body has moved for `dt` [s] at constant speeds, by these distances in its own frame."""
        if dt > 2 * _SETTLED * self.period_s and not (forward_m or aside_m or turn_rad):
            dt = self._rest(dt)
        while dt > 0.0:
            left_s = self.period_s - self._part_s
            if dt < left_s:
                self._add(dt, forward_m, aside_m, turn_rad)
                return
            share = left_s / dt
            parts = forward_m * share, aside_m * share, turn_rad * share
            self._add(left_s, *parts)
            self._sample()
            dt -= left_s
            forward_m, aside_m, turn_rad = forward_m - parts[0], aside_m - parts[1], turn_rad - parts[2]

    def _rest(self, dt: float) -> float:
        """Skip samples that nobody sees of a body at rest; returns the time that is left [s]."""
        count = int(dt / self.period_s) - _SETTLED
        self._drift(count)
        self.samples += count
        return dt - count * self.period_s

    def _add(self, dt: float, forward_m: float, aside_m: float, turn_rad: float) -> None:
        self._part_s += dt
        self._forward_m += forward_m
        self._aside_m += aside_m
        self._turn_rad += turn_rad

    def _drift(self, samples: int) -> None:
        if self._errors.gyro_walk:
            sd = self._errors.gyro_walk * math.sqrt(samples * self.period_s)
            self._bias = [bias + self._rng.gauss(0.0, sd) for bias in self._bias]

    def _sample(self) -> None:
        rate, accel = self._true()
        self._restart_period()
        self._drift(1)
        errors = self._errors
        gyro = self._in_chip((0.0, 0.0, rate / self._mount.gyro_scale))
        measured = [scale * value + bias for scale, value, bias in zip(errors.gyro_scale, gyro, self._bias)]
        self.gyro_rad_s = self._filtered(self.gyro_rad_s, measured, self._gyro_sd)
        measured = [value + bias for value, bias in zip(self._in_chip(accel), errors.accel_bias_m_s2)]
        self.accel_m_s2 = self._filtered(self.accel_m_s2, measured, self._accel_sd)
        self.samples += 1

    def _true(self) -> Tuple[float, Vector]:
        """Mean yaw rate of the period [rad/s], and acceleration at the chip with gravity [m/s2] in the body's frame."""
        period = self.period_s
        rate = self._turn_rad / period
        x = self._forward_m / period - rate * self._mount.y_m
        y = self._aside_m / period + rate * self._mount.x_m
        before_x, before_y = self._velocity or (x, y)
        self._velocity = x, y
        along = (x - before_x) / period - rate * 0.5 * (y + before_y)
        across = (y - before_y) / period + rate * 0.5 * (x + before_x)
        return rate, (along, across, G_M_S2)

    def _in_chip(self, vector: Vector) -> Vector:
        """A vector in the axes of base_link, in those of the chip."""
        x, y, z = vector
        a, b, c = self._columns
        return (
            a[0] * x + a[1] * y + a[2] * z,
            b[0] * x + b[1] * y + b[2] * z,
            c[0] * x + c[1] * y + c[2] * z,
        )

    def _filtered(self, before: Vector, now: Sequence[float], sd: float) -> Vector:
        share = self._share if self.samples else 1.0
        gauss = self._rng.gauss
        if sd:
            now = [value + gauss(0.0, sd) for value in now]
        x, y, z = (old + share * (new - old) for old, new in zip(before, now))
        return x, y, z


class Mpu6050:
    """The chip as an I2C slave: a write sets the register pointer and registers from there on, a read starts there.

    `advance` runs the body to a time [s]; the body calls `moved`.  `who_am_i` identifies the chip: the MPU-6050 sleeps
    after power-up, the MPU-9250 does not (its register map, revision 1.4); of the others the same is assumed.
    """

    def __init__(
        self, sensor: InertialSensor, advance: Callable[[float], None], who_am_i: int = MPU6050, seed: int = 0
    ) -> None:
        self.sensor = sensor
        self.present, self.who_am_i = True, who_am_i
        self.frozen = False  # the data registers keep their values
        self._advance = advance
        self._rng = random.Random(f"imu rounding {seed}")
        self.power_cycle()

    def power_cycle(self) -> None:
        """Switches the power off and on: all registers have their first values."""
        self._registers = bytearray(128)
        self._registers[PWR_MGMT_1] = SLEEP if self.who_am_i == MPU6050 else _AWAKE_CLOCK
        self._pointer = 0
        self._set_up()

    @property
    def asleep(self) -> bool:
        """Whether the chip measures nothing."""
        return bool(self._registers[PWR_MGMT_1] & SLEEP)

    def _set_up(self) -> None:
        """Begins to measure with the settings in the registers."""
        dlpf = self._registers[CONFIG] & 7
        hz = (8000.0 if dlpf in (0, 7) else 1000.0) / (1 + self._registers[SMPLRT_DIV])
        self.sensor.start(1.0 / hz, _DELAYS_S[dlpf])
        self._shown = 0

    def moved(self, dt: float, forward_m: float, aside_m: float, turn_rad: float) -> None:
        """Notes a motion of the body, see `InertialSensor.moved`."""
        if not self.asleep:
            self.sensor.moved(dt, forward_m, aside_m, turn_rad)

    # ---- the bus

    def write(self, data: bytes, time_s: float) -> bool:
        """One I2C write; False without an acknowledge."""
        if not self.present:
            return False
        if data:
            self._advance(time_s)
            self._pointer = data[0]
        for value in data[1:]:
            self._set(self._pointer & 0x7F, value)
            self._pointer += 1
        return True

    def _set(self, register: int, value: int) -> None:
        if register in _READ_ONLY:
            return
        if register == PWR_MGMT_1 and value & RESET:
            self.power_cycle()
            return
        before, self._registers[register] = self._registers[register], value
        woken = register == PWR_MGMT_1 and before & SLEEP and not value & SLEEP
        if woken or (register in (SMPLRT_DIV, CONFIG) and before != value):
            self._set_up()

    def read(self, count: int, time_s: float) -> bytes:
        """One I2C read of `count` registers from the pointer on, all of the same sample."""
        self._advance(time_s)
        self._show()
        begin = self._pointer & 0x7F
        self._pointer += count
        return bytes(self._registers[begin : begin + count]).ljust(count, b"\0")

    def _show(self) -> None:
        """Copies a new sample to the data registers."""
        self._registers[WHO_AM_I] = self.who_am_i
        sensor = self.sensor
        started = sensor.samples * sensor.period_s >= START_S
        if self.frozen or not started or self._shown == sensor.samples:
            return
        self._shown = sensor.samples
        gyro = GYRO_COUNTS[self._registers[GYRO_CONFIG] >> 3 & 3] * 180.0 / math.pi
        accel = ACCEL_COUNTS[self._registers[ACCEL_CONFIG] >> 3 & 3] / G_M_S2
        counts = [
            *(self._rounded(value * accel) for value in sensor.accel_m_s2),
            _TEMPERATURE,
            *(self._rounded(value * gyro) for value in sensor.gyro_rad_s),
        ]
        self._registers[ACCEL_XOUT_H : GYRO_ZOUT_L + 1] = struct.pack(">7h", *counts)

    def _rounded(self, value: float) -> int:
        """A whole count whose mean is the value, as the noise of a real chip makes it."""
        return max(-32768, min(32767, math.floor(value + self._rng.random())))
