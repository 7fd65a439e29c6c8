"""Publishes `cmd_vel` for a node that drives; the last message is always a stop.  For nodes."""

import threading

import rospy
from geometry_msgs.msg import Twist, Vector3

LEAVES_S = 0.1
"""Time for the last message to leave: rospy sends in the background, and drops unsent messages on shutdown."""


def twist_of(linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> Twist:
    """A message with these speeds."""
    return Twist(Vector3(linear_m_s, lateral_m_s, 0.0), Vector3(0.0, 0.0, angular_rad_s))


class CmdVel:
    """Publishes twists until the node ends; then a stop if the robot may be moving, and nothing after it."""

    def __init__(self) -> None:
        self._out = rospy.Publisher("cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        self._lock = threading.RLock()  # a signal may end the node during `publish`
        self._moving = self._ended = False
        rospy.on_shutdown(self._end)

    def publish(self, twist: Twist) -> None:
        """Publish a twist, unless the node is ending."""
        with self._lock:
            if not self._ended:
                self._moving = twist != Twist()
                self._out.publish(twist)

    def _end(self) -> None:
        with self._lock:
            self._ended = True
            if self._moving:
                self.stop_at_end()
                rospy.rostime.wallsleep(LEAVES_S)

    def stop_at_end(self) -> None:
        """Publish the last message."""
        self._out.publish(Twist())
