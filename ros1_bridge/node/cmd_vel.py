"""Publishes `cmd_vel` for a node that drives; the last message is always a stop.  For nodes.

An operator's commands carry the times of his inputs, and their delay to the robot is measured.  Three topics have the
name of `cmd_vel`, after remapping, and one word more, such as `cmd_vel/stamped`:

    stamped  geometry_msgs/TwistStamped  a command; stamp is the time of the input, on the operator's own clock
    ping     std_msgs/Header             such a time without a command, while there are none: the delay is known before
                                         the first one.  While there are, only they are measured: a ping may overtake
    echo     std_msgs/Header             from the robot: the header, after the command was written to the board's port

`frame_id` names the operator.  A robot that publishes `echo` gets its commands on `stamped` alone; any other gets them
on `cmd_vel`, and the delay is unknown.
"""

import contextlib
import math
import os
import threading
import time
from typing import Optional

import rospy
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from std_msgs.msg import Float64, Header

from mrl_driver.clocks import clock_s
from mrl_driver.safety.operator_delay import MAX_DELAY_S, DelayGuard, EchoDelay, delay_text

from .parameters import Row

LEAVES_S = 0.1
"""Time for the last message to leave: rospy sends in the background, and drops unsent messages on shutdown."""
PING_S = 0.25
CONNECT_S = 5.0  # A robot that echoes does so within this time after it listens to cmd_vel
_DELAY = "Stop above this delay from the input to the echo of its command; 0 turns it off"
DELAY_ROW = Row("max_delay", float, MAX_DELAY_S, "s", _DELAY, 0.0, 60.0)
"""The parameter of nodes with which an operator drives."""


def twist_of(linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> Twist:
    """A message with these speeds."""
    return Twist(Vector3(linear_m_s, lateral_m_s, 0.0), Vector3(0.0, 0.0, angular_rad_s))


def _header(time_s: float, operator: str = "") -> Header:
    # an input seems older than this computer if a clock was set after it
    return Header(0, rospy.Time.from_sec(max(0.0, time_s)), operator)


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


class StampedCmdVel(CmdVel):
    """Publishes twists with a header where a robot echoes it, and twists alone elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        name = rospy.resolve_name("cmd_vel")
        self._stamped = rospy.Publisher(f"{name}/stamped", TwistStamped, queue_size=1, tcp_nodelay=True)
        self._pings = rospy.Publisher(f"{name}/ping", Header, queue_size=1, tcp_nodelay=True)
        self._echoes = rospy.Subscriber(f"{name}/echo", Header, self.on_echo, queue_size=50, tcp_nodelay=True)

    def on_echo(self, header: Header) -> None:
        """Take an echo."""

    @property
    def echoed(self) -> bool:
        """A robot takes stamped commands and echoes them."""
        return self._echoes.get_num_connections() > 0 and self._stamped.get_num_connections() > 0

    def publish_stamped(self, header: Header, twist: Twist) -> None:
        """Publish a twist, unless the node is ending."""
        with self._lock:
            if not self.echoed:
                self.publish(twist)
            elif not self._ended:
                self._moving = twist != Twist()
                self._stamped.publish(header, twist)

    def ping(self, header: Header) -> None:
        """Publish a header without a command."""
        self._pings.publish(header)

    def stop(self) -> None:
        """Publish a stop on both topics, so that no command in transit on one follows a stop on the other."""
        if self.echoed:
            self.publish_stamped(_header(clock_s()), Twist())
        self.publish(Twist())

    def stop_at_end(self) -> None:
        """Publish the last message on both topics."""
        self._stamped.publish(_header(clock_s()), Twist())
        super().stop_at_end()


class OperatorCmdVel(StampedCmdVel):
    """The commands of one operator.  `~delay` (std_msgs/Float64) has the delay [s], twice a second, NaN if unknown."""

    def __init__(self, max_delay_s: float = 0.0) -> None:
        self._operator = f"{rospy.get_name()} {os.urandom(4).hex()}"
        self._delay = EchoDelay()
        self.guard = DelayGuard(max_delay_s)  # stops the operator's driving above the limit
        self._was_echoed: Optional[bool] = None
        self._held = False
        self._told, self._sent_s = "", -math.inf
        self._known_s = math.inf
        super().__init__()
        self._shown = rospy.Publisher("~delay", Float64, queue_size=1)
        threading.Thread(target=self._watch, daemon=True).start()

    @property
    def delay_s(self) -> float:
        """Time from an input to the arrival of the echo of its command [s]; NaN if no robot echoes."""
        with self._lock:
            return self._delay.delay_s(clock_s())

    def hold(self, twist: Optional[Twist], input_s: float) -> None:
        """Drive while the operator holds a control; None: nothing is held.

        The release publishes one stop, and then nothing, so that others may drive.
        """
        if twist is not None or self._held:
            self._held = twist is not None
            self.drive(twist or Twist(), input_s)

    def drive(self, twist: Twist, input_s: float) -> None:
        """Publish what the operator wants, or a stop while the delay is above the limit.

        `input_s` is the time of the input that caused it, by `clock_s`.
        """
        wanted = twist != Twist()
        self._follow_robot()
        with self._lock:  # the thread of `_watch` may hold the guard meanwhile; nothing may drive after that
            may = self.guard.may_drive(wanted, self.delay_s)
            self.send(twist if may or not wanted else Twist(), input_s)
        reason, told = self.guard.reason, self._told
        self._told = reason
        if reason and reason != told:
            rospy.logwarn(reason)

    def send(self, twist: Twist, input_s: float) -> None:
        """Publish a twist whatever the delay is."""
        with self._lock:
            self._sent_s = clock_s()
            if self.echoed:
                self._delay.sent(input_s)
            self.publish_stamped(_header(input_s, self._operator), twist)

    def halt(self) -> None:
        """Publish a stop; the operator may drive again after it."""
        with self._lock:
            self.guard.may_drive(False, math.nan)
            self.stop()

    def on_echo(self, header: Header) -> None:
        """Take an echo, if it is one of this operator's."""
        now_s = clock_s()
        if header.frame_id == self._operator:
            with self._lock:
                self._delay.echoed(header.stamp.to_sec(), now_s)

    def words(self) -> str:
        """The delay in words, and why the robot does not drive, if so."""
        return self.guard.reason or f"delay {delay_text(self.delay_s)}"

    def _watch(self) -> None:
        """Ping while a robot echoes, and publish the delay."""
        with contextlib.suppress(rospy.ROSException):  # the shutdown has closed a publisher
            while not rospy.is_shutdown():
                self._follow_robot()
                now_s = clock_s()
                if self.echoed and now_s - self._sent_s >= PING_S:
                    with self._lock:
                        self._delay.sent(now_s)
                    self.ping(_header(now_s, self._operator))
                self._shown.publish(self.delay_s)
                time.sleep(PING_S)

    def _follow_robot(self) -> None:
        """Say when no robot echoes; one that ceases to do so ends the driving until the keys are pressed again."""
        with self._lock:
            if self._known_s == math.inf and self._out.get_num_connections():
                self._known_s = time.monotonic() + CONNECT_S
            echoed, before = self.echoed, self._was_echoed
            if echoed == before or (before is None and time.monotonic() < self._known_s):
                return
            self._was_echoed = echoed
            if not echoed:
                self._delay.forget()
                self.guard.lose()
        if not echoed and not self._ended:
            rospy.logwarn(f"the delay is unknown and has no limit: nobody publishes {self._echoes.name}")
