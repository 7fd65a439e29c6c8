"""Where and how an IMU is mounted, and the scale of its gyro."""

import math
from functools import lru_cache
from typing import NamedTuple, Tuple

Vector = Tuple[float, float, float]


class ImuMount(NamedTuple):
    """Mounting pose of the IMU in base_link, and its gyro's scale; the board reports whether a chip is fitted.

    The angles turn the chip's axes into those of base_link, about the fixed axes of base_link: roll first, then pitch,
    then yaw.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    gyro_scale: float = 1.0
    """True rate over measured rate, about the vertical axis of base_link."""
    gyro_scale_sd: float = 0.01
    """Standard deviation of `gyro_scale`; the default is a third of the tolerance in the data sheet of the MPU-6050."""

    def rotate(self, vector: Vector) -> Vector:
        """Return a vector in the chip's axes as one in the axes of base_link."""
        x, y, z = vector
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = _rotation(self.roll_deg, self.pitch_deg, self.yaw_deg)
        return xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z


@lru_cache(maxsize=16)
def _rotation(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Tuple[Vector, Vector, Vector]:
    """Return the rows of the rotation matrix; a reading is rotated many times a second by the same one."""
    roll, pitch, yaw = map(math.radians, (roll_deg, pitch_deg, yaw_deg))
    sr, cr, sp, cp, sy, cy = (f(angle) for angle in (roll, pitch, yaw) for f in (math.sin, math.cos))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
