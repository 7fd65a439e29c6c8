"""ROS node `follow_waypoints`: drives through a list of waypoints with the action `move_base`.

Any server of that action will do: the real move_base or `go_to_goal`.  The list comes from the parameter `~waypoints`,
or from `waypoint_path` (nav_msgs/Path) or `waypoint_poses` (geometry_msgs/PoseArray).  Waypoints that robots share are
claimed by messages on the topic `claims` (std_msgs/String), or by radio, see `mrl_driver.navigation.claims`.
"""

import math
import threading
import time
from typing import Any, Callable, Dict, FrozenSet, List, Optional, Sequence

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseArray, PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import Path
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger, TriggerResponse

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.claims import (
    LATE_S,
    NAMESAKE,
    RADIO_LATE_S,
    Claim,
    ClaimMessage,
    RadioTeam,
    read_messages,
    read_radios,
    write_messages,
)
from mrl_driver.navigation.waypoint_tour import CLAIMING, PAUSED, Target, WaypointTour
from mrl_driver.robot.radio import format_address, parse_address
from mrl_driver.yaml_file import is_number
from ros1_bridge.node.parameters import Row, read
from ros1_bridge.node.plane_poses import FARTHEST_M, planar, write_pose
from ros1_bridge.node.run_node import node

POLL_S = 0.05
SILENT_S = 3.0  # move_base has ended if it publishes no status for this long; it sends five a second
LEAVES_S = 0.1  # Time for the last message to leave on shutdown
WARN_EVERY_S = 5.0
CANCELLED = "another goal came, or the goal was cancelled"
_SKIP = "Continue with the next waypoint if one cannot be reached; otherwise, pause"
_SHARED = "Numbers of the waypoints, from 1, that make up a place for one robot at a time, such as 1 or 1,2"
_RADIO = (
    "Names and radio addresses of all robots that share the place, such as "
    "1=0013a20040000001,2=0013a20040000002: claims go by radio, without the topic; replaces team"
)
PARAMETERS = (
    Row("map_frame", str, "map", "", "Frame of waypoints that name none"),
    Row("repeat", bool, False, "", "Begin again after the last waypoint"),
    Row("skip_failed", bool, False, "", _SKIP),
    Row("wait", float, 0.0, "s", "Time at each waypoint", 0.0, 3600.0),
    Row("shared", str, "", "", _SHARED),
    Row("team", str, "", "", "Names of all robots that share the place, such as robot1,robot2,robot3"),
    Row("team_name", str, "", "", "Name of this robot in the team; empty: the namespace"),
    Row("radio", str, "", "", _RADIO),
)
"""The node's private parameters, apart from the list itself."""
LIST = "waypoints"
CLAIMS_QUEUE = 50


def read_waypoints(rows: Any, key: str) -> List[Pose]:
    """Poses of a list of [x m, y m, yaw deg]; ConfigError, with its name `key`, if it is something else."""
    if not isinstance(rows, list):
        raise ConfigError(f"parameter {key} is {rows!r}, expected a list of [x m, y m, yaw deg]")
    poses = []
    for index, row in enumerate(rows):
        good = isinstance(row, list) and len(row) == 3
        if not good or not all(is_number(each, -FARTHEST_M, FARTHEST_M) for each in row):
            raise ConfigError(
                f"parameter {key}[{index}] is {row!r}, expected [x m, y m, yaw deg], three finite numbers"
            )
        poses.append(Pose(float(row[0]), float(row[1]), math.radians(row[2])))
    return poses


def read_numbers(text: str, key: str) -> FrozenSet[int]:
    """Places from 0 of waypoint numbers from 1 with commas; none if the text is empty, ConfigError if it is wrong."""
    words = [word.strip() for word in text.split(",")] if text else []
    if not all(word.isdecimal() and int(word) for word in words):
        raise ConfigError(f"parameter {key} is {text!r}, expected waypoint numbers from 1, such as 1 or 1,2")
    return frozenset(int(word) - 1 for word in words)


def read_names(text: str, own: str, key: str) -> List[str]:
    """Names of a team, separated by commas; ConfigError unless there are two or more, and `own` is among them."""
    names = [word.strip() for word in text.split(",")]
    if len(names) < 2 or own not in names:
        raise ConfigError(
            f"parameter {key} is {text!r}, expected all robots that share the waypoint, {own or 'this one'} among them"
        )
    return names


def ends_tour(cancel: GoalID, ordered: rospy.Time) -> bool:
    """Whether a cancel is one of all goals, and not of those before the list or the last order came, at `ordered`."""
    return not cancel.id and (not cancel.stamp or cancel.stamp >= ordered)


class FollowWaypoints:
    """Drives one robot through its waypoints."""

    def __init__(self, found: Dict[str, Any], space: str) -> None:
        """Raises ConfigError if a parameter is wrong; `found` has those of the namespace `space`."""
        if isinstance(found.get("shared"), int):  # as `_shared:=1` is read
            found["shared"] = str(found["shared"])
        poses = read_waypoints(found.get(LIST, []), f"{space}/{LIST}")
        given = read(PARAMETERS, found, space, [LIST])
        self._frame = given["map_frame"]
        header = Header(frame_id=self._frame)
        self._first = [PoseStamped(header, write_pose(pose, PoseMessage())) for pose in poses]
        shared = read_numbers(given["shared"], f"{space}/shared")
        self._name = given["team_name"] or rospy.get_namespace().strip("/")
        self._radio: Optional[RadioTeam] = None
        self._claim = self._claim_of(given, space) if shared else None
        self._tour = WaypointTour(given["repeat"], given["skip_failed"], given["wait"], self._claim, shared)
        self._poses: Sequence[PoseStamped] = []
        self._lock = threading.Lock()
        """Guards tour and poses; never held during a call of actionlib, which has locks too."""
        self._sent: Optional[Target] = None
        self._handle: Optional[actionlib.ClientGoalHandle] = None
        self._shown: Optional[DiagnosticStatus] = None
        self._idleness: Dict[str, str] = {}
        self._heard_s = time.monotonic()
        self._ordered = rospy.Time.now()  # When the last list or order came
        self._out = rospy.Publisher("waypoint_status", DiagnosticStatus, queue_size=1, latch=True)
        self._client = actionlib.ActionClient("move_base", MoveBaseAction)
        rospy.on_shutdown(self._end)

    def _claim_of(self, given: Dict[str, Any], space: str) -> Claim:
        """The claim of the shared waypoints, by radio if there are radios; ConfigError if a parameter is wrong."""
        try:
            self._radio = RadioTeam(self._name, read_radios(given["radio"])) if given["radio"] else None
        except ConfigError as error:
            raise ConfigError(f"parameter {space}/radio: {error}") from None
        team = self._radio.names if self._radio else read_names(given["team"], self._name, f"{space}/team")
        others = [each for each in team if each != self._name]
        return Claim(self._name, others, time.monotonic(), RADIO_LATE_S if self._radio else LATE_S)

    def _connect_claims(self) -> None:
        """Send and receive claims by radio, or on the topic."""
        to, of, kind = "claims", "claims", String
        if self._radio is not None:
            to, of, kind = "xbee/send", "xbee/received", KeyValue
        self._claims_out = rospy.Publisher(to, kind, queue_size=CLAIMS_QUEUE)
        rospy.Subscriber(of, kind, self._on_claim, queue_size=CLAIMS_QUEUE, tcp_nodelay=True)

    def _send_claims(self, messages: Sequence[ClaimMessage]) -> None:
        if self._radio is None:
            self._claims_out.publish(write_messages(messages))
            return
        for message in messages:
            address, text = self._radio.text_to(message)
            self._claims_out.publish(format_address(address), text)
        if not self._claims_out.get_num_connections():
            rospy.logwarn_throttle(
                WARN_EVERY_S,
                f"nobody subscribes to {self._claims_out.resolved_name}: claims by radio need a robot_node whose board "
                "has a radio",
            )

    def run(self) -> None:
        """Wait for the server, and drive until the shutdown."""
        rospy.Subscriber("move_base/status", GoalStatusArray, self._on_status, queue_size=1)
        if self._claim is not None:
            self._connect_claims()
        while not self._client.wait_for_server(rospy.Duration(WARN_EVERY_S)):
            if rospy.is_shutdown():
                return
            rospy.logwarn("there is no server of the action move_base yet: start move_base or go_to_goal")
        self._heard_s = time.monotonic()
        rospy.Subscriber("move_base/cancel", GoalID, self._on_cancel, queue_size=10)
        rospy.Subscriber("waypoint_path", Path, self._on_path, queue_size=1)
        rospy.Subscriber("waypoint_poses", PoseArray, self._on_poses, queue_size=1)
        tour = self._tour
        actions = {"pause": tour.pause, "resume": tour.resume, "skip": tour.skip, "cancel": self._give_up}
        for name, act in actions.items():
            self._offer(name, act)
        if self._first:
            self._take(self._first)
        while not rospy.is_shutdown():
            self._step()
            time.sleep(POLL_S)

    def _offer(self, name: str, act: Callable[[], bool]) -> None:
        def serve(_: Any) -> TriggerResponse:
            with self._lock:
                self._ordered = rospy.Time.now()
                done, state = act(), self._tour.state
            return TriggerResponse(done, state if done else f"{name} has no effect: the tour is {state}")

        rospy.Service(f"~{name}", Trigger, serve)

    def _give_up(self) -> bool:
        self._tour.end()
        return True

    def _step(self) -> None:
        """Send or cancel a goal if the tour's target has changed."""
        with self._lock:
            now_s = time.monotonic()
            target = self._tour.target
            if target and now_s - self._heard_s > SILENT_S:
                self._tour.interrupt(target.attempt, "move_base has fallen silent")
            self._tour.tick(now_s)
            target = self._tour.target
            pose = self._poses[target.place] if target else None
            status = self._status(now_s)
            claims = self._claim.messages(now_s) if self._claim else []
        if claims:
            self._send_claims(claims)
        if target != self._sent:
            self._sent = target
            self._send(target, pose)
        if status != self._shown:
            self._shown = status
            self._out.publish(status)

    def _send(self, target: Optional[Target], pose: Optional[PoseStamped]) -> None:
        if target is None:
            self._cancel()
            return
        number = target.attempt
        self._handle = self._client.send_goal(
            MoveBaseGoal(pose), lambda handle: self._on_transition(number, handle)
        )

    def _on_transition(self, attempt: int, handle: actionlib.ClientGoalHandle) -> None:
        if handle.get_comm_state() != actionlib.CommState.DONE:
            return
        state, text = handle.get_terminal_state(), handle.get_goal_status_text()
        with self._lock:
            number = self._tour.number
            if state == GoalStatus.SUCCEEDED:
                self._tour.reached(attempt, time.monotonic())
            elif state in (GoalStatus.PREEMPTED, GoalStatus.RECALLED):
                self._tour.interrupt(attempt, CANCELLED)
            else:
                why = f"waypoint {number} was not reached: {text or GoalStatus.to_string(state)}"
                self._tour.failed(attempt, why)
            reason = self._tour.reason if self._tour.state == PAUSED else ""
        if reason:
            rospy.logwarn(f"{reason}; the service resume drives on")

    def _on_cancel(self, goal: GoalID) -> None:
        """All goals are cancelled, as by a stop of the robot: pause, also between two goals."""
        if ends_tour(goal, self._ordered):
            with self._lock:
                self._tour.pause(CANCELLED)

    def _on_claim(self, message: Any) -> None:
        """Take claims: a String of `claims`, or a KeyValue that the radio has received."""
        assert self._claim is not None
        try:
            if self._radio is None:
                heard = read_messages(message.data)
            else:
                by_radio = self._radio.message_of(parse_address(message.key), message.value)
                heard = [by_radio] if by_radio is not None else []
        except ValueError as error:
            rospy.logwarn_throttle(WARN_EVERY_S, str(error))
            return
        if self._radio is None and self._is_of_namesake(message, heard):
            rospy.logwarn_throttle(WARN_EVERY_S, NAMESAKE.format(self._name))
            with self._lock:
                self._claim.hear_namesake(time.monotonic())
        with self._lock:
            for each in heard:
                self._claim.receive(each, time.monotonic())

    def _is_of_namesake(self, message: String, heard: Sequence[ClaimMessage]) -> bool:
        """Whether another node has sent a message with this robot's name; a relay sends none of its own robot's."""
        own = message._connection_header["callerid"] == rospy.get_name()
        return not own and any(each.sender == self._name for each in heard)

    def _on_status(self, _: GoalStatusArray) -> None:
        self._heard_s = time.monotonic()

    def _on_path(self, message: Path) -> None:
        for pose in message.poses:
            pose.header.frame_id = pose.header.frame_id or message.header.frame_id or self._frame
        self._take(message.poses)

    def _on_poses(self, message: PoseArray) -> None:
        poses = [PoseStamped(pose=pose) for pose in message.poses]
        for each in poses:
            each.header.frame_id = message.header.frame_id or self._frame
        self._take(poses)

    def _take(self, poses: Sequence[PoseStamped]) -> None:
        """Begin with new waypoints, if all are good."""
        if not poses:
            rospy.logwarn("a list without waypoints is ignored; the service cancel ends a tour")
            return
        for number, each in enumerate(poses, 1):
            try:
                planar(each.pose)
            except ValueError as error:
                rospy.logwarn(f"waypoints refused: number {number} of {len(poses)}: {error}")
                return
        with self._lock:
            self._ordered = rospy.Time.now()
            self._poses = poses
            self._tour.begin(len(poses), time.monotonic())

    def _status(self, now_s: float) -> DiagnosticStatus:
        tour = self._tour
        idleness = tour.idleness
        if self._idleness.get("visits") != str(idleness.visits):
            self._idleness = {
                "visits": str(idleness.visits),
                "idleness_mean": f"{idleness.mean_s(now_s):.1f}",
                "idleness_worst": f"{idleness.worst_s(now_s):.1f}",
            }
        stuck = tour.state == PAUSED or (tour.state == CLAIMING and tour.reason)
        level = DiagnosticStatus.WARN if stuck else DiagnosticStatus.OK
        values = {
            "state": tour.state,
            "waypoint": f"{tour.number} of {tour.count}",
            "lap": str(tour.lap),
            "reason": tour.reason,
            **self._idleness,
        }
        pairs = [KeyValue(key, value) for key, value in values.items()]
        return DiagnosticStatus(level, rospy.get_name(), tour.reason or tour.state, "", pairs)

    def _end(self) -> None:
        """Cancel the goal, so that the robot does not drive on without this node."""
        if self._cancel():
            rospy.rostime.wallsleep(LEAVES_S)

    def _cancel(self) -> bool:
        """Cancel the goal unless it has ended; whether there was one to cancel."""
        handle = self._handle
        if handle is None or handle.get_comm_state() == actionlib.CommState.DONE:
            return False
        handle.cancel()
        return True


main = node("follow_waypoints", FollowWaypoints, FollowWaypoints.run, PARAMETERS)
