"""Replays odometry and scans to a real mapper, in simulated time.  Imports ROS."""

import time
from typing import Any, Sequence, Tuple

import numpy as np
import rospy
from genpy import Time
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from mrl_driver.robot.robot_state import Telemetry
from ros1_bridge.node.plane_poses import planar
from ros1_bridge.topics.messages import transform_of
from ros1_bridge.world.world_node import scan_of
from sim_arduino.hardware.laser import URG_04LX
from sim_arduino.world.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap

from .replay import Replay, stamp_of
from .stack import LAUNCH, Master

PACE = 1.5
"""Simulated seconds in a second; map_to_odom, which counts the machine's time, allows hardly more."""
LAST_S = 5.0
"""The mappers publish their maps at least this often [s, simulated]."""
OCCUPIED_PERCENT, FREE_PERCENT = 65, 19.6
"""As map_saver's defaults."""


class Mapper(Replay):
    """The nodes of slam.launch, and what publishes the robot's odometry, laser and scans; a context manager."""

    def __init__(self, master: Master, robot: str, method: str) -> None:
        super().__init__(robot)
        self._master, self._method = master, method
        laser = models.load(robot).laser
        self._scans = rospy.Publisher("scan", LaserScan, queue_size=5)
        self._publishers.mounts(
            transform_of("base_link", "laser", Pose(laser.x_m, laser.y_m, 0.0), laser.z_m, Time())
        )
        self._map = b""
        self._maps = rospy.Subscriber("map", rospy.AnyMsg, self._on_map)

    def _on_map(self, message: rospy.AnyMsg) -> None:
        self._map = message._buff

    def __enter__(self) -> "Mapper":
        command = ("roslaunch", str(LAUNCH / "slam.launch"), f"method:={self._method}")
        self._node = self._master.start(self._method, *command)
        self._master.require(self._ticking, self._node)
        return self

    def _ticking(self) -> bool:
        """Time goes on until the mapper can hear."""
        self._go_on(0.02)
        return self._scans.get_num_connections() > 0 and self._maps.get_num_connections() > 0

    def _go_on(self, seconds: float) -> None:
        self._now_s += seconds
        self._clock.publish(self._clock.data_class(stamp_of(self._now_s)))
        time.sleep(seconds / PACE)

    def __exit__(self, *_: Any) -> None:
        self._master.end(self._node)
        for topic in (self._scans, self._maps):
            topic.unregister()

    def map_of(self, events: Sequence[Tuple[float, Any]]) -> GridMap:
        """The map at the end of a drive, from telemetry and ranges with their times [s]."""
        start_s, begun_s = self._now_s, time.monotonic()
        for time_s, event in events:
            time.sleep(max(0.0, begun_s + time_s / PACE - time.monotonic()))
            self._now_s = start_s + time_s
            stamp = stamp_of(self._now_s)
            self._clock.publish(self._clock.data_class(stamp))
            if isinstance(event, Telemetry):
                self._publishers.telemetry(event._replace(stamp_s=self._now_s))
            else:
                self._scans.publish(scan_of(Header(0, stamp, "laser"), URG_04LX, event))
        for _ in range(round(LAST_S / 0.1)):
            self._go_on(0.1)
        message = OccupancyGrid().deserialize_numpy(self._map, np)
        info, shares = message.info, message.data.reshape(message.info.height, message.info.width)
        cells = np.full(shares.shape, UNKNOWN, np.int8)
        cells[shares >= OCCUPIED_PERCENT] = OCCUPIED
        cells[(shares >= 0) & (shares <= FREE_PERCENT)] = FREE
        return GridMap(cells, info.resolution, planar(info.origin))
