"""Names and positions that node and description must agree on.  Pure."""

JOINTS = ("right_wheel_joint", "left_wheel_joint")
"""Wheel joints of the description, in the order of the counters."""
OMNI_JOINTS = (*JOINTS, "rear_wheel_joint")  # Wheel joints of a robot with three wheels
SONAR_HEIGHT_M = 0.0  # Height of the sonars above base_link, which is at the axle


def sonar_frame(base_frame: str, sonar: str) -> str:
    """Frame of a sonar with the prefix of `base_frame`: robot1/base_link gives robot1/sonar_front."""
    return beside(base_frame, f"sonar_{sonar}")


def imu_frame(base_frame: str) -> str:
    """Frame of the IMU with the prefix of `base_frame`, whose axes it has: the driver rotates all readings."""
    return beside(base_frame, "imu_link")


def beside(base_frame: str, name: str) -> str:
    """A frame with the prefix of `base_frame`."""
    prefix, slash, _ = base_frame.rpartition("/")
    return f"{prefix}{slash}{name}"
