"""The topics of a board's IMU, by REP-145: `imu/data_raw` and `imu/data`.  No node.

The driver has turned each reading into the axes of base_link.  Therefore both topics are in `imu_link`, a frame at the
chip whose axes are parallel to those of base_link.
"""

import math
from typing import Callable

from sensor_msgs.msg import Imu as ImuMessage

from mrl_driver.robot.heading import FILTER_DELAY_S, ZERO_RATE_RAD_S
from mrl_driver.robot.imu import IN_USE, Imu
from mrl_driver.robot.models import ImuMount

from .fast_publisher import Fast
from .message_covariance import UNUSED_VARIANCE
from .serialized_messages import PackedImu

RATE_NOISE_RAD_S = math.radians(0.05)  # Noise of a rate below 98 Hz (data sheet of the MPU-6050, 6.1)
ACCELERATION_OFFSET_M_S2 = 0.08 * 9.81 / 3
"""A third of the tolerance of an acceleration's zero, of the worst axis (data sheet, 6.2); the noise is far below."""
NO_ORIENTATION = (-1.0, 0.0, 0.0)
RAW_RATE_VARIANCES = (RATE_NOISE_RAD_S**2 + (ZERO_RATE_RAD_S / 3) ** 2,) * 3
"""The bias is not removed; a tolerance is three standard deviations."""


class ImuTopics:
    """Publishes the readings of one IMU in a frame; `sender` makes a publisher for a topic.

    `ahead` returns by how much ROS's clock is ahead of the driver's [s]; minus infinity before the first frame.
    """

    def __init__(
        self, sender: Callable[[str, type], Fast], frame: str, mount: ImuMount, ahead: Callable[[], float]
    ) -> None:
        self._raw_out, self._out = sender("imu/data_raw", ImuMessage), sender("imu/data", ImuMessage)
        self._packed = PackedImu(frame, ACCELERATION_OFFSET_M_S2**2)
        self._scale_sd, self._ahead = mount.gyro_scale_sd, ahead

    def on_imu(self, imu: Imu) -> None:
        """Publish a reading: as measured, and with heading and without bias while the gyro gives the heading."""
        raw_out, out = self._raw_out, self._out
        wanted = imu.state == IN_USE and out.impl.connections
        time_s = self._ahead() + imu.stamp_s - FILTER_DELAY_S
        if time_s < 0.0 or not (wanted or raw_out.impl.connections):
            return
        secs = int(time_s)
        nsecs = int((time_s - secs) * 1e9)
        rates, accelerations = imu.angular_velocity_rad_s, imu.linear_acceleration_m_s2
        if raw_out.impl.connections:
            raw_out.send(
                self._packed.pack(
                    raw_out.sequence, secs, nsecs, 0.0, 1.0, NO_ORIENTATION, rates, RAW_RATE_VARIANCES, accelerations
                )
            )  # fmt: skip
        if wanted:
            roll_rad_s, pitch_rad_s, yaw_rad_s = rates
            yaw_rad_s -= imu.bias_rad_s
            scale_rad_s, half_rad = self._scale_sd * yaw_rad_s, (imu.yaw_rad - FILTER_DELAY_S * yaw_rad_s) / 2
            variance = RATE_NOISE_RAD_S**2 + imu.bias_sd_rad_s**2 + scale_rad_s * scale_rad_s
            out.send(
                self._packed.pack(
                    out.sequence, secs, nsecs, math.sin(half_rad), math.cos(half_rad),
                    (UNUSED_VARIANCE, UNUSED_VARIANCE, imu.yaw_variance_rad2),
                    (roll_rad_s, pitch_rad_s, yaw_rad_s), (*RAW_RATE_VARIANCES[:2], variance), accelerations,
                )
            )  # fmt: skip
