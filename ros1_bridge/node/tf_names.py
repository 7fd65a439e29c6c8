"""Names and places that node and description must agree on.  Pure."""

JOINTS = ("right_wheel_joint", "left_wheel_joint")
"""Joints of the description, in the order of the counters."""
OMNI_JOINTS = (*JOINTS, "rear_wheel_joint")
"""Those of a robot with three wheels."""
SONAR_HEIGHT_M = 0.0
"""Sonars are mounted at the height of base_link, the axle."""


def sonar_frame(base_frame: str, sonar: str) -> str:
    """Frame of a sonar with the prefix of `base_frame`: robot1/base_link gives robot1/sonar_front."""
    prefix, slash, _ = base_frame.rpartition("/")
    return f"{prefix}{slash}sonar_{sonar}"
