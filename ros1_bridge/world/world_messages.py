"""Fills the messages of the simulated world from values.  Plain functions."""

from typing import Any, Tuple

from genpy import Time
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan

from mrl_driver.geometry import Pose, wrap_angle
from ros1_bridge.node.plane_poses import write_pose
from sim_arduino.world.grid_map import GridMap

STILL_S = 1.0
"""If two poses are further apart in time than this, the speed is unknown."""


def new_scan(frame: str, first_rad: float, step_rad: float, rays: int, rate_hz: float) -> LaserScan:
    """A scan of a laser that turns counter-clockwise, without ranges."""
    message = LaserScan(angle_min=first_rad, angle_increment=step_rad)
    message.header.frame_id = frame
    message.angle_max = first_rad + step_rad * (rays - 1)
    message.scan_time = 1.0 / rate_hz
    return message


def fill_scan(message: LaserScan, stamp: Time, ranges: Any, near_m: float, far_m: float) -> None:
    """Write ranges [m], an array `(rays,)` as in REP-117."""
    message.header.stamp = stamp
    message.range_min, message.range_max = near_m, far_m
    message.ranges = ranges.tolist()


def new_truth(map_frame: str, base_frame: str) -> Odometry:
    """A message for the exact true pose in the map frame."""
    message = Odometry()
    message.header.frame_id, message.child_frame_id = map_frame, base_frame
    return message


def fill_truth(message: Odometry, stamp: Time, pose: Pose, before: Tuple[float, Pose], now_s: float) -> None:
    """Write a pose, and the speeds since the pose `before` (its time [s], pose)."""
    message.header.stamp = stamp
    write_pose(pose, message.pose.pose)
    then_s, then = before
    dt_s = now_s - then_s
    twist = message.twist.twist
    if not 0 < dt_s < STILL_S:
        twist.linear.x = twist.linear.y = twist.angular.z = 0.0
        return
    moved = pose.relative_to(then._replace(yaw_rad=pose.yaw_rad))
    twist.linear.x, twist.linear.y = moved.x_m / dt_s, moved.y_m / dt_s
    twist.angular.z = wrap_angle(pose.yaw_rad - then.yaw_rad) / dt_s


def new_map(frame: str, stamp: Time, grid: GridMap) -> OccupancyGrid:
    """A map as a message."""
    message = OccupancyGrid()
    message.header.frame_id, message.header.stamp = frame, stamp
    message.info.map_load_time, message.info.resolution = stamp, grid.resolution_m
    message.info.height, message.info.width = grid.cells.shape
    message.info.origin.position.x, message.info.origin.position.y = grid.origin.x_m, grid.origin.y_m
    message.info.origin.orientation.w = 1.0
    message.data = grid.cells.ravel().tolist()
    return message
