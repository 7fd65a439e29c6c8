"""The node that runs experiments with a team of emulated boards, each with its own robot node.

The odometry of the team's real robots places them in the world of the virtual robots.  In `mixed-team` the node
drives by `cmd_vel` and uses the ranges on `sonar/...`.  In `shared-waypoint` it is a client of each robot's action
`move_base`.
"""

import os
import time
from contextlib import ExitStack
from typing import Any, Callable, Dict, Mapping, Optional, Sequence

import actionlib
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, Vector3
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range
from std_msgs.msg import Header

from mrl_driver.errors import MrlError
from mrl_driver.geometry import ORIGIN, Pose, quaternion_of
from mrl_driver.robot import models
from mrl_driver.robot.sonar import NAMES
from ros1_bridge.demo.processes import wait_until
from ros1_bridge.node.plane_poses import planar
from ros1_bridge.node.tf_names import sonar_frame
from sim_arduino.experiments import mixed_team, shared_waypoint
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import NOISE, Setting, Step
from sim_arduino.experiments.team import Member, Player, Team, footprint_of, pose_option
from sim_arduino.world import world_file
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World

from .experiment_processes import START_S, Parts

RATE_HZ = 20
WANDER_S, ROUNDS, MOST_S = 120.0, 2, 600.0
"""These runs are in real time and therefore shorter than the simulated ones."""
TOUCH_M = 0.005
"""A body that is closer to an object than this counts as a collision."""
REMARK = (
    "Through ROS, in real time: robot nodes on emulated boards, true poses and odometry from their topics; "
    "a collision is less than 5 mm between bodies or walls."
)
_OVER = (GoalStatus.ABORTED, GoalStatus.REJECTED, GoalStatus.PREEMPTED, GoalStatus.RECALLED, GoalStatus.LOST)


class TopicRobot:
    """A robot reached through its topics; it has the interface `team.RobotInterface`.

    Args:
        member: The robot's role in the team; its name is its namespace.
        truth: World that gets the true pose and reports contacts.
        navigated: `go_to_goal` drives the robot; otherwise this node does.
    """

    def __init__(self, member: Member, truth: World, navigated: bool) -> None:
        self.member, self.model = member, models.load(member.robot)
        self.ranges: Dict[str, float] = {}
        self._truth, self._origin = truth, ORIGIN
        body = footprint_of(member)
        self._body = body
        self._grown = body._replace(length_m=body.length_m + 2 * TOUCH_M, width_m=body.width_m + 2 * TOUCH_M)
        self._odom: Optional[Pose] = None
        self._true: Optional[Pose] = None
        self._due_s = time.monotonic()
        self.on_odometry: Callable[[Odometry], None] = ignore
        """Called with each odometry message."""
        space = f"/{member.name}"
        self._cmd_vel = (
            None if navigated else rospy.Publisher(f"{space}/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        )
        self._move_base = (
            actionlib.SimpleActionClient(f"{space}/move_base", MoveBaseAction) if navigated else None
        )
        self._heard = {
            name: rospy.Publisher(f"{space}/heard/{name}", Range, queue_size=1) for name in NAMES if navigated
        }
        rospy.Subscriber(f"{space}/odom", Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True)
        world = "virtual" if member.virtual else "real"
        rospy.Subscriber(f"/{world}{space}/base_pose_ground_truth", Odometry, self._on_truth, queue_size=1)
        for name in NAMES:
            rospy.Subscriber(f"{space}/sonar/{name}", Range, self._on_range, callback_args=name, queue_size=1)

    def _on_odometry(self, message: Odometry) -> None:
        self._odom = Pose(*planar(message.pose.pose))
        self.on_odometry(message)

    def _on_truth(self, message: Odometry) -> None:
        self._true = Pose(*planar(message.pose.pose))

    def _on_range(self, message: Range, name: str) -> None:
        self.ranges = {**self.ranges, name: message.range}

    @property
    def ready(self) -> bool:
        """A message has come on every topic, and the action server is there."""
        complete = None not in (self._odom, self._true) and len(self.ranges) == len(NAMES)
        return complete and (self._move_base is None or self._move_base.wait_for_server(rospy.Duration(0.01)))

    @property
    def pose(self) -> Pose:
        """Pose by odometry, in the world frame."""
        assert self._odom is not None
        return self._origin.compose(*self._odom)

    @property
    def true_pose(self) -> Pose:
        """True pose in the world."""
        assert self._true is not None
        return self._true

    @property
    def bumped(self) -> bool:
        """The robot's body touches an object."""
        return bool(self._truth.touching(self.true_pose, self._grown, self.member.name))

    def reset_pose(self, pose: Pose) -> None:
        """Set the pose at which the robot's odometry began."""
        self._origin = pose

    def drive(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Publish these speeds, unless `go_to_goal` drives."""
        if self._cmd_vel is not None:
            self._cmd_vel.publish(Twist(Vector3(linear_m_s, 0, 0), Vector3(0, 0, angular_rad_s)))

    def wait(self, seconds: float) -> None:
        """Sleep until `seconds` after the end of the previous wait."""
        now_s = time.monotonic()
        self._due_s = max(self._due_s + seconds, now_s)
        time.sleep(self._due_s - now_s)
        self._truth.place(self.member.name, self.true_pose, self._body)

    def seek(self, goal: Pose) -> Callable[[Mapping[str, float]], Step]:
        """Send a goal; the returned function passes ranges to `go_to_goal` and reports the progress."""
        client = self._move_base
        assert client is not None
        client.send_goal(MoveBaseGoal(_stamped(goal)))

        def step(ranges: Mapping[str, float]) -> Step:
            for name, range_m in ranges.items():
                header = Header(frame_id=sonar_frame(f"{self.member.name}/base_link", name))
                self._heard[name].publish(Range(header=header, range=range_m))
            state = client.get_state()
            return Step((0.0, 0.0), state == GoalStatus.SUCCEEDED, state in _OVER)

        return step

    def stop(self) -> None:
        """Stop the robot and cancel its goals."""
        self.drive(0.0, 0.0)
        if self._move_base is not None:
            # It may arrive after the next goal, so it names the time.
            self._move_base.cancel_goals_at_and_before_time(rospy.Time.now())


def ignore(_: Odometry) -> None:
    """Ignore a message."""


def _stamped(pose: Pose) -> PoseStamped:
    message = PoseStamped(header=Header(frame_id="map"))
    _write(pose, message.pose.position, message.pose.orientation)
    return message


def _write(pose: Pose, at: Any, turn: Any) -> None:
    at.x, at.y = pose.x_m, pose.y_m
    turn.z, turn.w = quaternion_of(pose.yaw_rad)


def gather(
    stack: ExitStack,
    parts: Parts,
    setting: Setting,
    members: Sequence[Member],
    navigated: bool,
    world: str = mixed_team.WORLD,
) -> Team:
    """Starts boards and nodes of a team in a real and a virtual world, and waits until all are ready.

    Raises:
        MrlError: a part has failed, or is not ready in time.
    """
    truth, virtual = world_file.load(world), world_file.load(world)
    virtual.registry = registry = SharedRegistry(_shared("virtual"))
    stack.callback(registry.close)
    for space in sorted({"virtual" if member.virtual else "real" for member in members}):
        parts.node("world_node", space, world=world, world_name=_shared(space), localise=False)
    for number, member in enumerate(members):
        _start(parts, member, world, setting.seed + number, navigated)
    places = tf2_ros.StaticTransformBroadcaster()
    places.sendTransform([_place(member) for member in members])
    robots = [TopicRobot(member, truth, navigated) for member in members]
    for robot in robots:
        stack.callback(robot.stop)
    wait_until(lambda: parts.check() or all(robot.ready for robot in robots), START_S)  # type: ignore[func-returns-value]
    late = [robot.member.name for robot in robots if not robot.ready]
    if late:
        raise MrlError(
            f"no odometry, sonars, true pose or move_base of {', '.join(late)} after {START_S:g} s"
        )
    return Team([Player(robot.member, robot, virtual) for robot in robots])


def _shared(space: str) -> str:
    """Name of a world that the boards of this process share."""
    return f"{space}-{os.getpid()}"


def _start(parts: Parts, member: Member, world: str, seed: int, navigated: bool) -> None:
    """Start the board, the robot node and, if the robot is navigated, go_to_goal."""
    space = _shared("virtual" if member.virtual else "real")
    options = ("--world", world, "--world-name", space, "--pose", pose_option(member.start))
    port = parts.board(member.name, "--robot", member.robot, "--sonar", NOISE, "--seed", str(seed), *options)
    parts.robot(member.name, port, member.robot, RATE_HZ)
    if navigated:
        parts.node("go_to_goal", member.name, *(f"sonar/{name}:=heard/{name}" for name in NAMES))


def _place(member: Member) -> TransformStamped:
    """Transform from the map to the start of a robot's odometry."""
    message = TransformStamped(header=Header(frame_id="map"), child_frame_id=f"{member.name}/odom")
    _write(member.start, message.transform.translation, message.transform.rotation)
    return message


def play(name: str, parts: Parts, setting: Setting) -> Result:
    """Starts the team of an experiment, and runs the experiment."""
    with ExitStack() as stack:
        if name == "mixed-team":
            team = gather(stack, parts, setting, mixed_team.MEMBERS, navigated=False)
            return mixed_team.drive_team(setting, team, WANDER_S, REMARK)
        team = gather(stack, parts, setting, shared_waypoint.MEMBERS, navigated=True)
        return shared_waypoint.drive_team(setting, team, ROUNDS, MOST_S, REMARK)
