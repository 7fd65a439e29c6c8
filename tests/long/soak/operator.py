"""A ROS program that drives a robot with cmd_vel and takes orders on stdin, one a line; it answers in JSON.

keep X | keep nan | keep huge | keep sideways: publish 20 times a second.  silent: publish nothing.  state: what was
received.  end.
"""

import math
import os
import select
import sys
import time
from typing import Any, Dict, List, Optional

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from tests.long.soak.worker import held, say

PERIOD_S = 0.05
FASTEST_M_S, QUANTUM_M = 1.0, 0.005


class Operator:
    """Publishes cmd_vel, and judges the steps of odom."""

    def __init__(self, name: str, ns: str) -> None:
        rospy.init_node(name, disable_signals=True)
        # Without a queue `publish` returns when the message has left.  A thread of a queue waits for a busy computer.
        self._publisher = rospy.Publisher(f"{ns}/cmd_vel", Twist, queue_size=None, tcp_nodelay=True)
        self._last: Any = None
        self._connection: Any = None
        self.messages, self.jump_m = 0, -math.inf
        self._subscriber = rospy.Subscriber(
            f"{ns}/odom", Odometry, self._see, queue_size=10, tcp_nodelay=True
        )
        self._wanted: Optional[List[str]] = None
        self._due_s, self._rest, self._last_s = 0.0, b"", 0.0

    def _see(self, odom: Any) -> None:
        place, stamp_s = odom.pose.pose.position, odom.header.stamp.to_sec()
        if self._last and stamp_s > self._last[2]:
            way_m = math.hypot(place.x - self._last[0], place.y - self._last[1])
            if odom._connection_header is not self._connection:
                # A node that was started again begins at the origin.
                way_m = min(way_m, math.hypot(place.x, place.y))
            self.jump_m = max(self.jump_m, way_m - FASTEST_M_S * (stamp_s - self._last[2]) - QUANTUM_M)
        self._last, self._connection = (place.x, place.y, stamp_s), odom._connection_header
        self.messages += 1

    def _message(self) -> Any:
        message, kind = Twist(), (self._wanted or ["0"])[0]
        special = {"nan": math.nan, "huge": 1e308, "sideways": 0.0}
        message.linear.x = special[kind] if kind in special else float(kind)
        message.linear.y = 0.1 if kind == "sideways" else 0.0
        return message

    def run(self) -> None:
        """Obey until `end`, or the end of stdin."""
        while True:
            left_s = max(0.0, self._due_s - time.monotonic()) if self._wanted else 1.0
            if select.select([0], [], [], left_s)[0]:
                data = os.read(0, 4096)
                *lines, self._rest = (self._rest + data).split(b"\n")
                if not data or not all(map(self._obey, lines)):
                    break
            if self._wanted and time.monotonic() >= self._due_s:
                self._due_s = time.monotonic() + PERIOD_S
                self._publisher.publish(self._message())
                # Only now: a busy computer may hold this process up before.
                self._last_s = time.monotonic()

    def _obey(self, line: bytes) -> bool:
        word, *values = line.decode().split()
        answer: Dict[str, Any] = {}
        if word == "end":
            return False
        if word == "keep":
            self._wanted = values
        elif word == "silent":
            self._wanted = None
        elif word == "state":
            answer = {**held(), "messages": self.messages, "jump_m": self.jump_m}
            answer["connected"] = self._publisher.get_num_connections()
        say(done=word, at_s=time.monotonic(), last_s=self._last_s, **answer)
        return True


if __name__ == "__main__":
    Operator(sys.argv[1], sys.argv[2]).run()
    sys.stdout.flush()
    os._exit(0)
