"""Converts the poses of messages to poses on the floor plane.  Pure."""

import math
from typing import Any

from mrl_driver import geometry
from mrl_driver.geometry import FARTHEST_M, Pose

_LEAST_LENGTH = 1e-3  # A shorter quaternion has no direction


def planar(pose: Any) -> Pose:
    """x [m], y [m], yaw [rad] of a geometry_msgs/Pose; ValueError if one is not valid, or beyond `FARTHEST_M`."""
    at = pose.position
    if not (abs(at.x) <= FARTHEST_M and abs(at.y) <= FARTHEST_M):
        raise ValueError(
            f"position is {at.x:g}, {at.y:g}, expected finite numbers of at most {FARTHEST_M:g} m"
        )
    return Pose(at.x, at.y, yaw_of(pose.orientation))


def transform_pose(transform: Any) -> Pose:
    """x [m], y [m], yaw [rad] of a geometry_msgs/Transform; ValueError if its rotation is not valid."""
    at = transform.translation
    return Pose(at.x, at.y, yaw_of(transform.rotation))


def write_pose(pose: Pose, message: Any) -> Any:
    """Write a pose into a geometry_msgs/Pose, which is returned."""
    message.position.x, message.position.y = pose.x_m, pose.y_m
    message.orientation.z, message.orientation.w = geometry.quaternion_of(pose.yaw_rad)
    return message


def yaw_of(rotation: Any) -> float:
    """Yaw of a geometry_msgs/Quaternion of any length [rad]; ValueError if it is not finite, or too short."""
    x, y, z, w = (getattr(rotation, axis) for axis in "xyzw")
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if not _LEAST_LENGTH < length < math.inf:
        raise ValueError(f"orientation is {x:g}, {y:g}, {z:g}, {w:g}, expected a quaternion of length 1")
    return geometry.yaw_of(x / length, y / length, z / length, w / length)


def correction(place: Pose, odometry: Pose) -> Pose:
    """Pose of the odom frame in the map at which odometry puts the robot at `place`."""
    yaw_rad = place.yaw_rad - odometry.yaw_rad
    return Pose(place.x_m, place.y_m, yaw_rad).compose(-odometry.x_m, -odometry.y_m)
