"""A ROS program that drives a robot with cmd_vel and takes orders on stdin, one a line; it answers in JSON.

Each order is a method of `Operator`.
"""

import os
import sys
import time
from typing import Any, Dict

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from tests.long.jumps import Jumps
from tests.long.soak.worker import Obedient

FASTEST_M_S, QUANTUM_M = 1.0, 0.005


class Operator(Obedient):
    """Publishes cmd_vel, and judges the steps of odom."""

    def __init__(self, name: str, ns: str) -> None:
        rospy.init_node(name, disable_signals=True)
        # Without a queue `publish` returns when the message has left.  A thread of a queue waits for a busy computer.
        self._publisher = rospy.Publisher(f"{ns}/cmd_vel", Twist, queue_size=None, tcp_nodelay=True)
        self._jumps, self._messages = Jumps(FASTEST_M_S, QUANTUM_M), 0
        self._connection: Any = None
        rospy.Subscriber(f"{ns}/odom", Odometry, self._see, queue_size=10, tcp_nodelay=True)

    def _see(self, odom: Any) -> None:
        place, stamp_s = odom.pose.pose.position, odom.header.stamp.to_sec()
        if (
            odom._connection_header is not self._connection
        ):  # a node that was started again begins at the origin
            self._jumps.begin_anew()
        if stamp_s > self._jumps.used_s:
            self._jumps.see((place.x, place.y), stamp_s)
        self._connection = odom._connection_header
        self._messages += 1

    def keep(self, speed: str) -> None:
        """Publish a speed 20 times a second."""
        self.wanted = Twist()
        self.wanted.linear.x = float(speed)

    def command(self) -> None:
        self._publisher.publish(self.wanted)
        self.last_s = time.monotonic()  # only now: a busy computer may hold this process up before

    def state(self) -> Dict[str, Any]:
        connected = self._publisher.get_num_connections()
        return {"messages": self._messages, "jump_m": self._jumps.farthest_m, "connected": connected}


if __name__ == "__main__":
    Operator(sys.argv[1], sys.argv[2]).run()
    sys.stdout.flush()
    os._exit(0)
