"""The robot's state and zones as markers for rviz."""

from typing import Any, Callable, Tuple

from genpy import Duration
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from mrl_driver.driver import Driver
from ros1_bridge.control.commander import Commander
from ros1_bridge.control.zone_feed import assumed_twist

from .link_report import ERROR, OK, WARN
from .robot_status import FIELDS, motion_health, state_of

BLUE, YELLOW, ORANGE, RED = (0.1, 0.4, 1.0), (0.9, 0.8, 0.0), (1.0, 0.5, 0.0), (1.0, 0.2, 0.2)
COLOURS = {OK: BLUE, WARN: ORANGE, ERROR: RED}  # to be read on a light map and on rviz's dark ground
ZONE_COLOURS = (ORANGE, YELLOW, RED)  # in the order of `FIELDS`
FREE, ENTERED = 0.5, 1.0  # opacity of a zone
LINE_M, LETTER_M, ABOVE_M = 0.02, 0.15, 0.35
LIFETIME_S = 1.0  # the markers of a node that has ended disappear after this time


class Markers:
    """What the robot does, as a text above it, and its zones in the direction of motion."""

    def __init__(
        self, driver: Driver, commander: Commander, base_frame: str, publisher: Callable[..., Any]
    ) -> None:
        """`publisher`: rospy.Publisher."""
        self._driver, self._commander, self._frame = driver, commander, base_frame
        self._out = publisher("markers", MarkerArray, queue_size=1)

    def publish(self) -> None:
        """Publish the present state if somebody subscribes."""
        telemetry, zones = self._driver.telemetry, self._commander.zones
        if not self._out.get_num_connections() or telemetry is None:
            return
        state = state_of(self._commander)
        health = motion_health(state.driving, state.cause)
        text = self._marker("state", Marker.TEXT_VIEW_FACING, COLOURS[health.level])
        text.text, text.scale.z, text.pose.position.z = health.message, LETTER_M, ABOVE_M
        markers, twist = [text], assumed_twist(self._driver, telemetry)
        areas = zones.areas((twist.linear_m_s, twist.lateral_m_s)) if zones is not None else ()
        for field, colour, clear, corners in zip(FIELDS, ZONE_COLOURS, state.clear, areas):
            outline = self._marker(f"{field} zone", Marker.LINE_STRIP, colour, FREE if clear else ENTERED)
            outline.points, outline.scale.x = [Point(x, y, 0.0) for x, y in (*corners, corners[0])], LINE_M
            markers.append(outline)
        self._out.publish(MarkerArray(markers))

    def _marker(
        self, name: str, kind: int, colour: Tuple[float, float, float], opacity: float = ENTERED
    ) -> Marker:
        """A marker that moves with the robot."""
        marker = Marker(ns=name, type=kind, color=ColorRGBA(*colour, opacity), frame_locked=True)
        marker.header.frame_id, marker.lifetime = self._frame, Duration(LIFETIME_S)
        marker.pose.orientation.w = 1.0
        return marker
