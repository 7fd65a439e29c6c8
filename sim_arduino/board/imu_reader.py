"""The board's side of the IMU: finds it on the I2C bus, sets it up, notices when it is lost, reads it."""

import math
import struct
from typing import Any, Dict, Optional, Tuple

from .board_status import BoardStatus

ADDRESSES = (0x68, 0x69)  # the environment-sensor build has its thermopile at the first
SEARCH_S = 0.504  # time between two searches, at one address after the other [s]
SETTLED_S = 0.056  # time after the set-up until the first reading [s]
LOOK_S = 0.504  # time between two looks at an IMU that nobody reads [s]
_KNOWN = (0x68, 0x70, 0x71, 0x73, 0x98)  # WHO_AM_I of MPU-6050, 6500, 9250 and 9255, and ICM-20689
_POWER, _SAMPLE_RATE, _GYRO_CONFIG, _WHO_AM_I, _GYRO_DATA, _ACCEL_DATA = 0x6B, 0x19, 0x1B, 0x75, 0x43, 0x3B
_SCALE = 0x08
"""GYRO_CONFIG for 500 deg/s; every chip of the family has another scale after a loss of its power."""
_WAKE = bytes([_POWER, 1])
_SET_UP = bytes([_SAMPLE_RATE, 4, 3, _SCALE, 0, 3])
"""200 Hz; filters of 42 Hz (gyro) and 44 Hz; 500 deg/s; 2 g; the same filter for accelerometers of the other chips."""

Reading = Tuple[int, ...]


class ImuReader:
    """Searches for an IMU from `next_s` on; `i2c` has the slaves on the bus by address."""

    def __init__(self, i2c: Dict[int, Any], environment: bool, health: BoardStatus) -> None:
        self._i2c, self._health = i2c, health
        self._addresses = ADDRESSES[1:] if environment else ADDRESSES
        self._index = 0
        self._asked_all = self._is_set_up = self._is_settled = False
        self.found = False  # an IMU has answered since the start
        self.next_s = math.inf  # time of the next call of `run`, the first when the sketch starts [s]

    def run(self, now_s: float) -> None:
        """Searches, or looks at the IMU that has been found."""
        if not self._is_set_up:
            self._search(now_s)
        elif not self._is_settled:
            self._is_settled, self.next_s = True, now_s + LOOK_S
            self._health.set_fault("imu", False)
        else:
            self._look(now_s)

    def read(self, now_s: float) -> Optional[Reading]:
        """Counts of the gyro's and the accelerometer's axes; None if the IMU is not ready or has just been lost."""
        if not self._is_settled:
            return None
        gyro, accel = self._get(_GYRO_DATA, 6, now_s), self._get(_ACCEL_DATA, 6, now_s)
        if not self._look(now_s) or gyro is None or accel is None:
            return None
        return struct.unpack(">6h", gyro + accel)

    def _search(self, now_s: float) -> None:
        """Asks one address; at the start and after a loss, the next ones up to the last follow at once."""
        who = self._get(_WHO_AM_I, 1, now_s)
        if who is None or who[0] not in _KNOWN:
            self._index = (self._index + 1) % len(self._addresses)
            self._asked_all = self._asked_all or self._index == 0
            self.next_s = now_s + (SEARCH_S if self._asked_all else 0.0)
            return
        self.found, self.next_s = True, now_s + SEARCH_S
        self._is_set_up = self._write(_WAKE, now_s) and self._write(_SET_UP, now_s)
        self._health.set_fault("imu", not self._is_set_up or self._health.has_fault("imu"))
        if self._is_set_up:
            self.next_s = now_s + SETTLED_S

    def _look(self, now_s: float) -> bool:
        """Whether the IMU has its settings; if not, it is searched for at once."""
        self.next_s = now_s + LOOK_S
        if self._get(_GYRO_CONFIG, 1, now_s) == bytes([_SCALE]):
            return True
        self._asked_all = self._is_set_up = self._is_settled = False
        self._health.set_fault("imu", True)
        self.next_s = now_s
        return False

    def _write(self, data: bytes, now_s: float) -> bool:
        slave = self._i2c.get(self._addresses[self._index])
        return slave is not None and slave.write(data, now_s) is not False

    def _get(self, register: int, count: int, now_s: float) -> Optional[bytes]:
        if not self._write(bytes([register]), now_s):
            return None
        return bytes(self._i2c[self._addresses[self._index]].read(count, now_s))
