"""ROS node `go_to_goal`: the action `move_base` (move_base_msgs/MoveBaseAction) with odometry and sonars only.

The node takes goals from the action, from `move_base_simple/goal` (rviz's 2D Nav Goal), and lists of goals from
`waypoints` (nav_msgs/Path).  Goals may be in any frame that tf connects with the frame of `odom`.
"""

import math
import threading
import time
from typing import Any, Dict, Iterable, Optional, Sequence, Tuple

import actionlib
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal, MoveBaseResult
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import Range
from std_msgs.msg import Bool

from mrl_driver import clocks
from mrl_driver.clocks import wait_until
from mrl_driver.errors import one_line
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.navigation.goal_seeker import PATIENCE_S, GoalSeeker
from mrl_driver.robot.models import Limits, SonarMount
from mrl_driver.robot.sonar import NAMES
from ros1_bridge.node.cmd_vel import CmdVel, twist_of
from ros1_bridge.node.parameters import Row, speed_rows
from ros1_bridge.node.plane_poses import planar, transform_pose, write_pose
from ros1_bridge.node.run_node import node
from ros1_bridge.node.stamp_age import StampAge
from ros1_bridge.topics.messages import range_of

RATE_HZ = 20.0
ODOM_LATE_S, ODOM_GONE_S = 0.5, 3.0
"""The robot waits if odometry is older than the first [s], and the goal is given up at the second: longer than a
reconnection takes."""
JUMP_M, JUMP_RAD = 0.1, 0.2
"""A pose that is farther from the one before than the robot can have moved, and this, is of an odometry that began
again: the goal is elsewhere."""
FIRST_ODOM_S = 3.0  # If the first odometry takes longer, the node says that it waits for it
SILENT_S = 0.5  # A range is valid for this long; each sonar measures every 0.3 s
RANGES = "sonar"
WIDEST_DEG = 120.0  # Messages with another cone than up to this have that of an MB1300
TF_TIMEOUT_S = 1.0
WARN_EVERY_S = 5.0
POLL_S = 0.2
IN_MANUAL_MODE = "the robot is in manual mode"
END_S = 1.5  # On shutdown, a goal may take this long to end; longer than the wait for a transform
_PATIENCE = "Abort the goal if the robot comes no closer for this long"
PARAMETERS = (
    *speed_rows("Speed on a free path", "Yaw rate"),
    Row("avoid", bool, True, "", "Avoid obstacles that the sonars see"),
    Row("patience", float, PATIENCE_S, "s", _PATIENCE, 1.0, 3600.0),
)
"""The node's private parameters."""


def clock_s() -> float:
    """A clock that is not set, and goes on while the computer is suspended [s]; of simulated time, if there is."""
    now_s: float = clocks.clock_s() if rospy.rostime.is_wallclock() else rospy.get_time()
    return now_s


class OdometryGap:
    """Judges odometry that comes late or begins again, for one goal; `limits` are the largest speeds of the robot."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._before: Optional[Tuple[Pose, float]] = None
        self._now_s = -math.inf
        self.waiting = False  # The last odometry is too old to drive by
        self.why = ""  # Why the goal must be given up; empty if it need not be

    def update(self, pose: Pose, heard_s: float, now_s: float) -> bool:
        """Judge the last pose, which came at `heard_s`; True if the robot can drive by it."""
        before, before_s = self._before or (pose, heard_s)
        silent_s, gap_s = now_s - heard_s, heard_s - before_s
        moved_m = math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m)
        turned_rad = abs(wrap_angle(pose.yaw_rad - before.yaw_rad))
        if now_s < self._now_s:
            self.why = "simulated time jumped back"
        elif max(silent_s, gap_s) > ODOM_GONE_S:  # or this computer was suspended meanwhile
            self.why = "odometry has stopped"
        elif (
            moved_m > JUMP_M + self._limits.linear_m_s * gap_s
            or turned_rad > JUMP_RAD + self._limits.angular_rad_s * gap_s
        ):
            self.why = f"odometry began again: {moved_m:.2f} m away {gap_s:.2f} s later"
        self.waiting = silent_s > ODOM_LATE_S
        self._before, self._now_s = (pose, heard_s), now_s
        return not self.waiting and not self.why


def sonar_of(place: Pose, message: Range) -> SonarMount:
    """The sonar at this place, with the cone and the longest range that its message has, or those of an MB1300."""
    cone_deg, farthest_m = math.degrees(message.field_of_view), message.max_range
    return SonarMount(
        place.x_m,
        place.y_m,
        math.degrees(place.yaw_rad),
        field_of_view_deg=cone_deg if 0.0 < cone_deg <= WIDEST_DEG else 0.0,
        farthest_m=farthest_m if 0.0 < farthest_m < math.inf else 0.0,
    )


class GoToGoal:
    """Drives one robot to its goals."""

    def __init__(self, given: Dict[str, Any]) -> None:
        self._limits = Limits(given["linear_speed"], given["angular_speed"], math.inf, math.inf)
        self._avoid, self._patience_s = given["avoid"], given["patience"]
        self._odometry: Optional[Odometry] = None
        self._odometry_s = self._newest_s = -math.inf
        self._located = threading.Event()
        self._ranges: Dict[str, Tuple[float, Range, float]] = {}  # of each sonar: range, message, time
        self._odometry_age = StampAge(ODOM_LATE_S)
        self._range_ages: Dict[str, StampAge] = {}
        self._places: Dict[str, Pose] = {}  # of the sonars, in the robot's frame
        self._sonars: Dict[str, SonarMount] = {}
        self._cmd_vel = CmdVel()
        self._plan = rospy.Publisher("plan", Path, queue_size=1, latch=True)
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._server = actionlib.SimpleActionServer(
            "move_base", MoveBaseAction, self._execute, auto_start=False
        )
        self._client = actionlib.ActionClient("move_base", MoveBaseAction)
        self._lock = threading.RLock()  # guards the next two lines
        self._tour: Sequence[PoseStamped] = []
        self._goal: Optional[actionlib.ClientGoalHandle] = None
        self._manual = False
        self._ending, self._idle = threading.Event(), threading.Event()
        self._idle.set()
        self._odom = rospy.Subscriber("odom", Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True)
        self._listen(NAMES)
        rospy.Subscriber("manual_mode", Bool, self._on_manual_mode, queue_size=1)
        rospy.on_shutdown(self._end)

    def run(self) -> None:
        """Offer the action after the first odometry, then take goals from topics: each can be driven to at once."""
        start_s = time.monotonic()
        while not wait_until(self._located.is_set, POLL_S):
            if rospy.is_shutdown():
                return
            if time.monotonic() - start_s > FIRST_ODOM_S:
                rospy.logwarn_throttle(
                    WARN_EVERY_S, f"no odometry on {self._odom.name} yet: goals are taken after the first"
                )
        self._server.start()
        if not self._client.wait_for_server():  # shut down
            return
        rospy.Subscriber("move_base_simple/goal", PoseStamped, lambda goal: self._visit([goal]), queue_size=1)
        rospy.Subscriber("waypoints", Path, self._on_waypoints, queue_size=1)
        rospy.spin()

    def _listen(self, names: Iterable[str]) -> None:
        """Take the ranges of these sonars too."""
        for name in names:
            if name not in self._range_ages:
                self._range_ages[name] = StampAge(SILENT_S)
                rospy.Subscriber(f"{RANGES}/{name}", Range, self._on_range, callback_args=name, queue_size=1)

    def _find_sonars(self) -> None:
        """Listen to the sonars that are published with other names."""
        above = f"{rospy.resolve_name(RANGES)}/"
        try:
            published = rospy.get_published_topics(above)
        except (OSError, rospy.ROSException) as error:  # no master
            rospy.logwarn(f"sonars with names of their own are not found: {error}")
            return
        self._listen(topic[len(above) :] for topic, kind in published if kind == Range._type)

    def _end(self) -> None:
        """End the goal, so that the client gets its result before the topics close."""
        self._ending.set()
        wait_until(self._idle.is_set, END_S)
        with self._server.action_server.lock:  # the server's timer must not publish to a closed topic
            self._server.action_server.started = False

    def _on_odometry(self, message: Odometry) -> None:
        now_s, stamp_s = rospy.get_time(), message.header.stamp.to_sec()
        if now_s < self._newest_s:
            self._bound_stamps(rospy.Time.from_sec(now_s))
        self._newest_s = now_s
        try:
            planar(message.pose.pose)
            trouble = self._odometry_age.trouble(stamp_s, now_s, time.monotonic())
        except ValueError as error:
            trouble = str(error)
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"odometry not used: {trouble}")
            return
        self._odometry, self._odometry_s = message, clock_s() - max(0.0, now_s - stamp_s)
        self._located.set()

    def _bound_stamps(self, now: rospy.Time) -> None:
        """The clock was set back: actionlib would refuse goals until it is past the last one and the last cancel."""
        server = self._server.action_server
        with server.lock, self._server.lock:
            server.last_cancel = min(server.last_cancel, now)
            for handle in (self._server.current_goal, self._server.next_goal):
                if handle.get_goal():
                    handle.get_goal_id().stamp = min(handle.get_goal_id().stamp, now)

    def _on_range(self, message: Range, name: str) -> None:
        """Take a range; one that is not fresh counts as not valid, so that the robot does not drive by it."""
        now_s, stamp_s = rospy.get_time(), message.header.stamp.to_sec()
        trouble = self._range_ages[name].trouble(stamp_s, now_s, time.monotonic())
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"range of {name} not used: {trouble}")
        range_m = math.nan if trouble else range_of(message)
        self._ranges[name] = range_m, message, clock_s() - max(0.0, now_s - stamp_s)

    def _on_manual_mode(self, message: Bool) -> None:
        """Note the mode; robot_node cancels the goal when it changes."""
        self._manual = message.data

    def _on_waypoints(self, message: Path) -> None:
        for pose in message.poses:
            pose.header.frame_id = pose.header.frame_id or message.header.frame_id
        self._visit(message.poses)

    def _visit(self, tour: Sequence[PoseStamped], number: int = 1) -> None:
        """Send goals to this node's own action in turn, until one is not reached or others come."""

        def go_on(handle: actionlib.ClientGoalHandle) -> None:
            with self._lock:
                ended = handle.get_comm_state() == actionlib.CommState.DONE
                if not ended or number == len(tour) or tour is not self._tour or rospy.is_shutdown():
                    return
                if handle.get_terminal_state() == GoalStatus.SUCCEEDED:
                    self._visit(tour, number + 1)
                else:
                    rospy.logwarn(f"waypoint {number} of {len(tour)} was not reached; the rest is given up")

        with self._lock:
            self._tour = tour
            if tour:
                self._goal = self._client.send_goal(MoveBaseGoal(tour[number - 1]), go_on)

    def _execute(self, goal: MoveBaseGoal) -> None:
        """Called by the action server for each goal, on its own thread."""
        self._idle.clear()
        try:
            self._attempt(goal)
        except rospy.ROSException:
            if not rospy.is_shutdown():  # the shutdown closes the topics and ends all waits
                raise
        finally:
            self._idle.set()

    def _attempt(self, goal: MoveBaseGoal) -> None:
        if self._manual:
            rospy.logwarn(f"goal refused: {IN_MANUAL_MODE}")
            self._server.set_aborted(MoveBaseResult(), IN_MANUAL_MODE)
            return
        try:
            target = self._target(goal.target_pose)
        except ValueError as error:
            self._cmd_vel.publish(Twist())  # the previous goal has ended, if there was one
            rospy.logwarn(f"goal refused: {error}")
            self._server.set_aborted(MoveBaseResult(), str(error))
            return
        self._seek(target)

    def _seek(self, target: Pose) -> None:
        """Drive until the goal is reached or given up."""
        rate = rospy.Rate(RATE_HZ, reset=True)
        begun_s = clock_s()
        seeker = GoalSeeker(target, self._limits, begun_s, self._sonars, self._patience_s)
        gap = OdometryGap(self._limits)
        if self._avoid:
            self._find_sonars()
        self._show(target)
        while not self._ending.is_set():
            if self._server.is_preempt_requested():
                if not self._server.is_new_goal_available():
                    self._cmd_vel.publish(Twist())
                self._server.set_preempted(MoveBaseResult(), IN_MANUAL_MODE if self._manual else "")
                return
            if not self._drive(seeker, gap, begun_s):
                break
            rate.sleep()
        self._cmd_vel.publish(Twist())
        if seeker.reached:
            assert self._odometry is not None
            x_m, y_m, yaw_rad = planar(self._odometry.pose.pose).relative_to(target)
            rospy.loginfo(
                f"goal reached: x {target.x_m:.3f} m, y {target.y_m:.3f} m; the robot is {math.hypot(x_m, y_m):.3f} m "
                f"and {abs(math.degrees(yaw_rad)):.1f} deg off"
            )
            self._server.set_succeeded(MoveBaseResult(), "reached")
            return
        why = "the node ends" if self._ending.is_set() else gap.why
        why = f"blocked: {seeker.why}" if seeker.blocked else why
        rospy.logwarn(f"goal given up: {why}")
        self._server.set_aborted(MoveBaseResult(), why)

    def _drive(self, seeker: GoalSeeker, gap: OdometryGap, begun_s: float) -> bool:
        """Do one step of a goal that began at `begun_s`; False if it has ended."""
        odometry, now_s = self._odometry, clock_s()
        assert odometry is not None
        pose = planar(odometry.pose.pose)
        if not gap.update(pose, self._odometry_s, now_s):
            if gap.waiting and not gap.why:
                rospy.logwarn_throttle(WARN_EVERY_S, f"the robot waits: no odometry for {ODOM_LATE_S:g} s")
            self._cmd_vel.publish(Twist())
            return not gap.why
        if self._odometry_s < begun_s:  # a reset may lie between them
            return True
        ranges = self._placed_ranges(odometry.child_frame_id, now_s) if self._avoid else {}
        linear, angular = seeker.command(pose, ranges, now_s)
        if seeker.reached or seeker.blocked:
            return False
        if seeker.blind:
            rospy.logwarn_throttle(WARN_EVERY_S, f"the robot waits: {seeker.why}")
        self._cmd_vel.publish(twist_of(linear, angular))
        self._server.publish_feedback(MoveBaseFeedback(PoseStamped(odometry.header, odometry.pose.pose)))
        return True

    def _placed_ranges(self, base: str, now_s: float) -> Dict[str, float]:
        """Range of each sonar that has sent one [m]; NaN if it is old, or the sonar's place is unknown."""
        ranges = {}
        for name, (range_m, message, heard_s) in list(self._ranges.items()):  # more may come meanwhile
            placed = name in self._places or self._find_place(name, message, base)
            if placed:
                self._sonars[name] = sonar_of(self._places[name], message)
            ranges[name] = range_m if placed and now_s - heard_s <= SILENT_S else math.nan
        return ranges

    def _find_place(self, name: str, message: Range, base: str) -> bool:
        """Look up the place of a sonar in tf; once is enough, as it does not move.  False if not yet known."""
        frame = message.header.frame_id
        try:
            found = self._buffer.lookup_transform(base, frame, rospy.Time())
        except tf2_ros.TransformException as error:
            words = f"sonar {name} is not used: no transform from {frame or 'its frame'} to {base}: {error}"
            rospy.logwarn_throttle(WARN_EVERY_S, one_line(words))
            return False
        self._places[name] = transform_pose(found.transform)
        return True

    def _target(self, goal: PoseStamped) -> Pose:
        """The goal in the frame of odom; ValueError if there is no transform, or the goal is not finite."""
        odometry = self._odometry
        assert odometry is not None
        pose, frame, given = planar(goal.pose), odometry.header.frame_id, goal.header.frame_id
        if given in ("", frame):
            return pose
        try:
            found = self._buffer.lookup_transform(frame, given, rospy.Time(), rospy.Duration(TF_TIMEOUT_S))
        except tf2_ros.TransformException as error:
            raise ValueError(one_line(f"no transform from {given} to {frame}: {error}")) from None
        return transform_pose(found.transform).compose(*pose)

    def _show(self, target: Pose) -> None:
        odometry = self._odometry
        assert odometry is not None
        end = PoseStamped(odometry.header, write_pose(target, PoseMessage()))
        self._plan.publish(Path(odometry.header, [PoseStamped(odometry.header, odometry.pose.pose), end]))


main = node("go_to_goal", PARAMETERS, lambda given: GoToGoal(given).run())
