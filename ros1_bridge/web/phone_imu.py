"""The sensors of a phone that shows the page, as sensor_msgs/Imu by REP-145.  No node.

The frame `phone` has the axes of the W3C's DeviceOrientation: x to the right of the screen, y to its top, z out of it.
Its rates alpha, beta and gamma are those about x, y and z, as browsers have them (w3c/deviceorientation, pull 43).
"""

import math
from typing import Any, Optional, Sequence, Tuple

from sensor_msgs.msg import Imu

from mrl_driver.apps.web.robot import PhoneReading
from mrl_driver.geometry import GRAVITY_M_S2
from ros1_bridge.topics.imu_topics import ACCELERATION_OFFSET_M_S2
from ros1_bridge.topics.message_covariance import UNUSED_VARIANCE

FRAME = "phone"
ABSENT = (-1.0, *(0.0,) * 8)  # covariance of what the phone does not measure (sensor_msgs/Imu)
EVENTS_HZ = 60.0  # most events of a sensor in a second; browsers send at most this many
RATE_VARIANCE = 1e-7 * EVENTS_HZ + (0.01 / 3) ** 2
"""Android's Compatibility Definition, 7.3.4: at most 1e-7 rad2/s2 per Hz, and a calibration error below 0.01 rad/s,
which is taken as three standard deviations [rad2/s2].
"""
ACCELERATION_VARIANCE = 0.05**2 + ACCELERATION_OFFSET_M_S2**2
"""The same, 7.3.1: a standard deviation of at most 0.05 m/s2; the offset is that of the robots' own IMU [m2/s4]."""
TILT_VARIANCE = (ACCELERATION_OFFSET_M_S2 / GRAVITY_M_S2) ** 2
"""Roll and pitch are as good as the direction of gravity [rad2]."""
HEADING_VARIANCE = math.radians(17.4) ** 2
"""Heading by a phone's compass indoors (Navigation 71(1), navi.632: root mean square error of 17.4 deg) [rad2]."""


def orientation(alpha_deg: float, beta_deg: float, gamma_deg: float) -> Tuple[float, float, float, float]:
    """Return x, y, z, w of the quaternion that turns the phone's axes into east, north, up.

    The angles are those of the W3C: about z by alpha, then about the new x by beta, then about the new y by gamma.
    """
    half = (math.radians(angle) / 2 for angle in (beta_deg, gamma_deg, alpha_deg))
    (sx, cx), (sy, cy), (sz, cz) = ((math.sin(each), math.cos(each)) for each in half)
    return (
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz + sx * sy * cz,
        cx * cy * cz - sx * sy * sz,
    )


def message(reading: PhoneReading, stamp: Any) -> Imu:
    """Return the message of a reading, made at `stamp`.

    Without a compass the heading has an unknown origin, and a variance that says so.
    """
    made = Imu()
    made.header.stamp, made.header.frame_id = stamp, FRAME
    angles = reading.alpha_deg, reading.beta_deg, reading.gamma_deg
    turn = made.orientation
    if any(map(math.isnan, angles)):
        turn.w, made.orientation_covariance = 1.0, ABSENT
    else:
        turn.x, turn.y, turn.z, turn.w = orientation(*angles)
        heading = HEADING_VARIANCE if reading.absolute else UNUSED_VARIANCE
        made.orientation_covariance = _diagonal(TILT_VARIANCE, TILT_VARIANCE, heading)
    rates = reading.rotation_deg_s and [math.radians(rate) for rate in reading.rotation_deg_s]
    acceleration = reading.acceleration_m_s2
    made.angular_velocity_covariance = _fill(made.angular_velocity, rates, RATE_VARIANCE)
    made.linear_acceleration_covariance = _fill(made.linear_acceleration, acceleration, ACCELERATION_VARIANCE)
    return made


def _fill(vector: Any, values: Optional[Sequence[float]], variance: float) -> Sequence[float]:
    """Set a geometry_msgs/Vector3, and return its covariance."""
    if values is None:
        return ABSENT
    vector.x, vector.y, vector.z = values
    return _diagonal(variance, variance, variance)


def _diagonal(x: float, y: float, z: float) -> Sequence[float]:
    return (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
