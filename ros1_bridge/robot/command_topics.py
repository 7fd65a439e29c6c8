"""The topics that drive a robot: `cmd_vel`, from programs and with an operator's times, and `pose`."""

import contextlib
import math
import time
from typing import Callable, Iterable, Optional, Sequence, Set, Tuple

import rospy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from std_msgs.msg import Header

from mrl_driver.clocks import clock_s
from mrl_driver.driver import Driver, Telemetry
from mrl_driver.errors import FrameError, MrlError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.models.drives import moves_sideways
from ros1_bridge.control.commander import Commander
from ros1_bridge.control.pose_goal import PoseGoal
from ros1_bridge.control.velocity_sources import Source
from ros1_bridge.node.robot_parameters import Parameters
from ros1_bridge.topics import messages

from .operators import Operators

CONNECT_S, CONNECT_LOOK_S = 2.0, 0.02
"""At the start, publishers of commands connect within this time; the node looks this often whether they have."""
WARN_EVERY_S = 1.0
STANDSTILL = Twist()
Connected = Iterable[Tuple[str, Sequence[str]]]
"""Topics, and the names of the nodes that publish them, or that subscribe to them, as the master says."""


class CommandTopics:
    """Passes commands to a robot's commander, on rospy's threads; `tell` publishes the state, if it has changed."""

    def __init__(
        self,
        driver: Driver,
        commander: Commander,
        parameters: Parameters,
        model: RobotModel,
        tell: Callable[[], None],
    ) -> None:
        self._driver, self._commander, self._parameters, self._tell = driver, commander, parameters, tell
        self._sideways, self._require_odometry = moves_sideways(model.drive), model.require_odometry
        self._goal = PoseGoal(commander, parameters.odom_frame, parameters.base_frame, model.sonars)
        self._seeks, self._sees = False, bool(model.sonars)
        self._commanded_s = -math.inf
        self._operators = Operators(parameters.max_command_delay, clock_s)

    def subscribe(self, publishers: Connected) -> None:
        """Take commands; return when the nodes that were there before this one, by `publishers`, may move the robot.

        To be called before the first odometry, with which programs may begin to drive.
        """
        topic = rospy.resolve_name("cmd_vel")
        there = nodes_on(publishers, topic, f"{topic}/stamped")
        self._commander.sources.expect(there)
        self._echo = rospy.Publisher(f"{topic}/echo", Header, queue_size=10, tcp_nodelay=True)
        rospy.Subscriber(f"{topic}/ping", Header, self._on_ping, queue_size=10, tcp_nodelay=True)
        self._inputs = [
            # more than one of those that arrive at once, or it could not be seen that they do
            rospy.Subscriber(name, kind, callback, queue_size=10, tcp_nodelay=True)
            for name, kind, callback in (
                (topic, Twist, self._on_cmd_vel),
                (f"{topic}/stamped", TwistStamped, self._on_stamped),
            )
        ]
        if there:
            self._await_sources()
        rospy.Subscriber("pose", PoseStamped, self._on_pose, queue_size=1)

    def _await_sources(self) -> None:
        """Let the nodes that were there before this one connect, and be silent for their pause if they are."""
        until_s = time.monotonic() + CONNECT_S
        while not self.note_sources() and time.monotonic() < until_s:
            time.sleep(CONNECT_LOOK_S)
        time.sleep(self._parameters.cmd_vel_pause)

    def note_sources(self) -> bool:
        """Take note of the connected sources; whether all are that were there before this node."""
        nodes = {link.callerid_pub for each in self._inputs for link in each.impl.connections}
        return self._commander.sources.connected(nodes, time.monotonic())

    def _on_cmd_vel(self, message: Twist, source: Optional[Source] = None) -> None:
        source = source or Source(message._connection_header.get("callerid", ""))
        linear, angular, commander = message.linear, message.angular, self._commander
        before_s, self._commanded_s = self._commanded_s, time.monotonic()
        if self._commanded_s - before_s > 0.5 * self._parameters.cmd_vel_timeout:
            self._tell()  # a stop that this command ends is published too, however short it was
        forward_m_s = linear.x
        if linear.z or angular.x or angular.y or (linear.y and not self._sideways):
            forward_m_s += self._ignore_axes(message)
        lateral = (linear.y,) if self._sideways else ()
        try:
            taken = commander.drive(forward_m_s, angular.z, *lateral, source=source)
        except FrameError:  # the driver has stopped the robot
            words = messages.field_not_finite(message)
            rospy.logwarn_throttle(WARN_EVERY_S, f"{words}; the robot was stopped")
        except MrlError:
            return
        else:
            if not taken:
                rospy.logwarn_throttle(WARN_EVERY_S, f"cmd_vel refused: {commander.refusal()}")
        finally:
            commander.done(source)

    def _ignore_axes(self, message: Twist) -> float:
        """Warn of fields that the drive cannot follow.

        Return 0, or NaN if one of them is not finite, which makes the command not finite for the driver.
        """
        if messages.field_not_finite(message):
            return math.nan
        unused = messages.unused_axes(message, self._sideways)
        followed = "linear.x, linear.y and angular.z" if self._sideways else "linear.x and angular.z"
        rospy.logwarn_throttle(
            WARN_EVERY_S, f"cmd_vel {', '.join(unused)} ignored: the robot follows {followed} alone"
        )
        return 0.0

    def _on_stamped(self, message: TwistStamped) -> None:
        """Follow an operator's command and echo its header, or stop if it arrives too late.  No stop is too late."""
        header, commander, refusal = message.header, self._commander, ""
        if message.twist != STANDSTILL:
            refusal = self._operators.refusal(header.frame_id, header.stamp.to_sec())
        if not refusal:
            node = message._connection_header.get("callerid", "")
            self._on_cmd_vel(message.twist, Source(node, header.frame_id))
            self._echo.publish(header)
            return
        commander.late_commands = self._operators.refused
        rospy.logwarn_throttle(WARN_EVERY_S, refusal)
        if commander.seeking:
            self._goal.cancel()
        commander.refuse(StopReason.COMMAND_TOO_LATE)
        if commander.driving:
            with contextlib.suppress(MrlError):
                commander.stop(StopReason.COMMAND_TOO_LATE)

    def _on_ping(self, header: Header) -> None:
        self._operators.late_s(header.frame_id, header.stamp.to_sec())
        self._echo.publish(header)

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            self._require_odometry()
            self._goal.start(message, self._driver.pose)
        except ValueError as error:
            rospy.logwarn(f"pose refused: {error}")
            return
        if not self._seeks:
            self._seeks = True
            self._driver.on_telemetry(self._on_goal_step)
            if not self._sees:
                rospy.logwarn("this board has no sonars: the robot drives to poses without seeing obstacles")

    def _on_goal_step(self, telemetry: Telemetry) -> None:
        with contextlib.suppress(MrlError):
            ended = self._goal.on_telemetry(telemetry)
            if ended:
                rospy.loginfo(ended)


def nodes_on(connected: Connected, *topics: str) -> Set[str]:
    """Names of the nodes on one of these topics."""
    return {node for topic, nodes in connected if topic in topics for node in nodes}
