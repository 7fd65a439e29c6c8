"""ROS node `cmd_vel_mux`: passes on the velocity commands of the source with the highest priority, as twist_mux does.

Sources and locks are its private parameters, in twist_mux's format.  Stamped commands of operators, pings and echoes
pass through (see `ros1_bridge.node.cmd_vel`).  Times are those of the machine's monotonic clock, so that a source also
counts as silent if `/clock` stands still.
"""

import contextlib
import threading
import time
from typing import Any, Dict, List, Optional, Sequence

import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from std_msgs.msg import Bool, Header, String

from mrl_driver.errors import ConfigError
from ros1_bridge.node.cmd_vel import StampedCmdVel
from ros1_bridge.node.run_node import node
from ros1_bridge.topics.messages import field_not_finite

from .velocity_mux import Input, VelocityMux, read_inputs

PERIOD_S = 0.02  # a stop for a silent source is at most this late
WARN_EVERY_S = 5.0


class _Out(StampedCmdVel):
    """What leaves, and the robot's echoes for each source."""

    def __init__(self, topics: List[str]) -> None:
        self._names = [f"{rospy.resolve_name(topic)}/echo" for topic in topics]
        self._back: List[rospy.Publisher] = []
        super().__init__()

    def on_echo(self, header: Header) -> None:
        """Pass an echo on to every source; each knows its own."""
        for publisher in list(self._back):
            with contextlib.suppress(rospy.ROSException):  # the robot has ceased to echo meanwhile
                publisher.publish(header)

    def follow_robot(self) -> None:
        """Offer echoes to the sources while a robot echoes."""
        if self.echoed == bool(self._back):
            return
        for publisher in self._back:
            publisher.unregister()
        names = [] if self._back else self._names
        self._back = [rospy.Publisher(name, Header, queue_size=10, tcp_nodelay=True) for name in names]


class CmdVelMux:
    """One multiplexer."""

    def __init__(self, sources: Sequence[Input], locks: Sequence[Input], pause_s: float) -> None:
        """Raises ConfigError if a source publishes on the output."""
        for source in sources:
            if rospy.resolve_name(source.topic) == rospy.resolve_name("cmd_vel"):
                raise ConfigError(
                    f"source {source.name} has the topic {source.topic}, on which the multiplexer itself publishes; "
                    "expected another one"
                )
        self._out = _Out([source.topic for source in sources])
        self._mux = VelocityMux(sources, locks, pause_s)
        self._pause_s = pause_s
        self._lock = threading.Lock()  # guards the multiplexer, and keeps what leaves in its order
        self._shown = rospy.Publisher("active_source", String, queue_size=1, latch=True)
        self._active = ""
        self._shown.publish("")
        for source in sources:
            topic = rospy.resolve_name(source.topic)
            fast: Dict[str, Any] = {"queue_size": 1, "tcp_nodelay": True}
            rospy.Subscriber(source.topic, Twist, self._on_twist, source.name, **fast)
            rospy.Subscriber(f"{topic}/stamped", TwistStamped, self._on_stamped, source.name, **fast)
            rospy.Subscriber(f"{topic}/ping", Header, self._out.ping, **fast)
        for lock in locks:
            rospy.Subscriber(lock.topic, Bool, self._on_lock, lock.name, queue_size=10)
        rospy.Subscriber("move_base/cancel", GoalID, self._on_cancel, queue_size=10, tcp_nodelay=True)

    def run(self) -> None:
        """Stop the robot for silent and locked sources until the shutdown."""
        while not rospy.is_shutdown():
            with self._lock:
                self._update(time.monotonic())
            self._out.follow_robot()
            time.sleep(PERIOD_S)

    def _on_stamped(self, message: TwistStamped, name: str) -> None:
        self._on_twist(message.twist, name, message.header)

    def _on_twist(self, message: Twist, name: str, header: Optional[Header] = None) -> None:
        wrong = field_not_finite(message)
        if wrong:
            rospy.logwarn_throttle(WARN_EVERY_S, f"source {name}: {wrong}; it counts as a stop")
        linear, angular = message.linear, message.angular
        numbers = (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
        with self._lock:
            now_s = time.monotonic()
            passed = self._mux.command(name, numbers, now_s)
            if name in self._mux.unpaused:
                rospy.logwarn_throttle(
                    WARN_EVERY_S,
                    f"source {name} has sent commands to move since before the robot's last stop or change of mode; "
                    f"it may drive after it has been silent or zero for {self._pause_s:g} s",
                )
            if passed is None and header is not None:
                self._out.ping(header)  # another source drives; the delay is measured nevertheless
            elif passed is not None:
                twist = Twist(Vector3(*passed[:3]), Vector3(*passed[3:]))
                if header is None:
                    self._out.publish(twist)
                else:
                    self._out.publish_stamped(header, twist)
            self._update(now_s)

    def _on_cancel(self, message: GoalID) -> None:
        """`robot_node` has stopped, was released, or changes its mode: it cancels the goals of before this time.

        A client that cancels its goals gives no time.
        """
        if message.stamp and not message.id:
            with self._lock:
                self._mux.distrust()

    def _on_lock(self, message: Bool, name: str) -> None:
        with self._lock:
            now_s = time.monotonic()
            self._mux.lock(name, message.data, now_s)
            self._update(now_s)

    def _update(self, now_s: float) -> None:
        if self._mux.stops(now_s):
            self._out.stop()
        active = self._mux.active(now_s)
        if active != self._active:
            self._active = active
            self._shown.publish(active)


main = node("cmd_vel_mux", read_inputs, lambda inputs: CmdVelMux(*inputs).run())
