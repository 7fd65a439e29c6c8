"""Fills the messages of the simulated world from values.  Plain functions."""

from typing import Any, Tuple

from genpy import Time
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from mrl_driver.geometry import Pose, wrap_angle
from ros1_bridge.node.plane_poses import write_pose
from sim_arduino.world.grid_map import GridMap

STILL_S = 1.0
"""If two poses are further apart in time than this, the speed is unknown, and zero in the message."""


def scan_of(
    header: Header,
    first_rad: float,
    step_rad: float,
    rate_hz: float,
    ranges: Any,
    near_m: float,
    far_m: float,
) -> LaserScan:
    """A scan of a laser that turns counter-clockwise; `ranges` [m] are an array `(rays,)` as in REP-117."""
    message = LaserScan(header=header, angle_min=first_rad, angle_increment=step_rad, scan_time=1.0 / rate_hz)
    message.angle_max = first_rad + step_rad * (len(ranges) - 1)
    message.range_min, message.range_max, message.ranges = near_m, far_m, ranges.tolist()
    return message


def truth_of(
    header: Header, base_frame: str, pose: Pose, before: Tuple[float, Pose], now_s: float
) -> Odometry:
    """The exact true pose in the frame of `header`, with the speeds since the pose `before` (its time [s], pose)."""
    message = Odometry(header=header, child_frame_id=base_frame)
    write_pose(pose, message.pose.pose)
    then_s, then = before
    dt_s = now_s - then_s
    if 0 < dt_s < STILL_S:
        twist, moved = message.twist.twist, pose.relative_to(then._replace(yaw_rad=pose.yaw_rad))
        twist.linear.x, twist.linear.y = moved.x_m / dt_s, moved.y_m / dt_s
        twist.angular.z = wrap_angle(pose.yaw_rad - then.yaw_rad) / dt_s
    return message


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
