"""An IMU's registers as an I2C slave: what it measures is set by hand, and is nonsense unless it has been set up."""

from typing import Dict, Tuple

MPU_6050, MPU_6500, MPU_9250, MPU_9255, ICM_20689 = 0x68, 0x70, 0x71, 0x73, 0x98
WHO_AM_I, POWER, GYRO_CONFIG, ACCEL_DATA, GYRO_DATA = 0x75, 0x6B, 0x1B, 0x3B, 0x43
SET_UP = {POWER: 0x01, 0x19: 4, 0x1A: 3, GYRO_CONFIG: 0x08, 0x1C: 0, 0x1D: 3}
"""Registers that the firmware must set, and their values."""
ASLEEP, AWAKE = 0x40, 0x01
SETTLED_S = 0.05
NONSENSE = 0x7777
Vector = Tuple[int, int, int]


class ImuChip:
    """An IMU of the MPU-6050 family.

    Attributes:
        gyro: Counts of the three axes.
        accel: Counts of the three axes.
        registers: What has been written; the data registers are not among them.
        set_up_s: When the scale of the gyro was last written [s].
    """

    def __init__(self, who_am_i: int = MPU_6050) -> None:
        self.present = True
        self.who_am_i = who_am_i
        self.gyro: Vector = (100, -200, 300)
        self.accel: Vector = (-16, 32, 16384)
        self.power_cycle()

    def power_cycle(self) -> None:
        """The supply goes and comes: an MPU-6050 sleeps then, the later chips run at another scale."""
        self.registers: Dict[int, int] = {POWER: ASLEEP if self.who_am_i == MPU_6050 else AWAKE}
        self.set_up_s = float("inf")
        self._pointer = 0

    def write(self, data: bytes, time_s: float) -> bool:
        """A register's address, perhaps with values from there on."""
        self._pointer = data[0]
        for place, value in enumerate(data[1:], data[0]):
            self.registers[place] = value
            if place == GYRO_CONFIG:
                self.set_up_s = time_s
        return True

    def read(self, count: int, time_s: float) -> bytes:
        """Registers from the address on."""
        valid = self.set_up_s + SETTLED_S <= time_s and all(
            self.registers.get(place) == value for place, value in SET_UP.items()
        )
        image = {**self.registers, WHO_AM_I: self.who_am_i}
        for start, vector in ((GYRO_DATA, self.gyro), (ACCEL_DATA, self.accel)):
            words = ((value if valid else NONSENSE) & 0xFFFF for value in vector)
            image.update(enumerate(b"".join(word.to_bytes(2, "big") for word in words), start))
        return bytes(image.get(place, 0) for place in range(self._pointer, self._pointer + count))
