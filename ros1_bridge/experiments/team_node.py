"""The node that runs experiments with a team of emulated boards, each with its own robot node, and the step test.

The odometry of the team's real robots places them in the world of the virtual robots.  In `mixed-team` the node
drives by `cmd_vel` and uses the ranges on `sonar/...`.  In `shared-waypoint` each robot has its own `go_to_goal`
and `follow_waypoints`, which claim the waypoint from each other on the topic `/claims`; the node only passes on the
ranges and watches.  In `step-test`, a team of one robot, a mirror in another process follows its `odom`.
"""

import math
import os
import time
from contextlib import ExitStack, closing
from typing import Callable, Dict, Mapping, Sequence

import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range
from std_msgs.msg import Header

from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.waypoint_tour import DONE, PAUSED
from mrl_driver.robot import models
from mrl_driver.robot.sonar import NAMES
from ros1_bridge.node.plane_poses import planar
from ros1_bridge.node.processes import wait_until
from ros1_bridge.node.tf_names import sonar_frame
from ros1_bridge.topics.messages import transform_of
from sim_arduino.experiments import disturbances, mixed_team, shared_waypoint, step_test
from sim_arduino.experiments.experiment_robot import TICK_S, Pace, Setting
from sim_arduino.experiments.step_test import START, Live, Mirrored, StepDrive
from sim_arduino.experiments.team import WORLD, Member, Player, Team, footprint_of
from sim_arduino.experiments.tours import TourRun
from sim_arduino.world import world_file
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World

from .legs import START_S, Parts
from .one_robot_node import RATE_HZ, ROBOT, OdometryRobot, heard, ignore

WANDER_S, ROUNDS = 60.0, 1
"""These runs are in real time and therefore shorter than the simulated ones [s]."""
MOST_S, STEPS_MOST_S = 200.0, 300.0  # time limits of the rounds and of the steps [s]
TOUCH_M = 0.005
"""A body that is closer to an object than this counts as a collision."""


class TopicRobot(OdometryRobot):
    """A robot reached through its topics, as a `team.Player` needs it; its name is its namespace.

    The world `truth` reports contacts, and gets the true pose of a real robot.  A robot that is `navigated` is driven
    by `go_to_goal`, others by this node.
    """

    def __init__(self, member: Member, truth: World, navigated: bool) -> None:
        self.member, self.model = member, models.load(member.robot)
        self.ranges: Dict[str, float] = {}
        self.on_odometry: Callable[[Odometry], None] = ignore
        """Called with each odometry message."""
        self._stamps: Dict[str, rospy.Time] = {}
        self._truth, self._body = truth, footprint_of(member)
        self._status: Dict[str, str] = {}
        self._pace = Pace()
        space, world = f"/{member.name}", "virtual" if member.virtual else "real"
        super().__init__(space, not navigated, lambda message: self.on_odometry(message))
        self._true = heard(f"/{world}{space}/base_pose_ground_truth")
        self._heard = {
            name: rospy.Publisher(f"{space}/heard/{name}", Range, queue_size=1) for name in NAMES if navigated
        }
        rospy.Subscriber(f"{space}/waypoint_status", DiagnosticStatus, self._on_status, queue_size=10)
        for name in NAMES:
            rospy.Subscriber(f"{space}/sonar/{name}", Range, self._on_range, callback_args=name, queue_size=1)

    def _on_status(self, message: DiagnosticStatus) -> None:
        self._status = {pair.key: pair.value for pair in message.values}

    @property
    def tour(self) -> str:
        """State of the robot's tour of waypoints; empty before it has begun."""
        return self._status.get("state", "")

    @property
    def visits(self) -> int:
        """Number of waypoints that the robot has reached on its tour."""
        return int(self._status.get("visits", 0))

    def _on_range(self, message: Range, name: str) -> None:
        self._stamps[name] = message.header.stamp
        self.ranges = {**self.ranges, name: message.range}

    @property
    def ready(self) -> bool:
        """A message has come on every topic."""
        return self.known and len(self._true) > 0 and len(self.ranges) == len(NAMES)

    @property
    def true_pose(self) -> Pose:
        """True pose in the world."""
        return self._true[-1][1]

    @property
    def bumped(self) -> bool:
        """The robot's body touches an object."""
        return bool(self._truth.touching(self.true_pose, self._body.grown(TOUCH_M), self.member.name))

    def wait(self, seconds: float) -> None:
        """Sleep until `seconds` after the end of the previous wait."""
        time.sleep(self._pace.rest_s(seconds))
        if not self.member.virtual:
            self._truth.place(self.member.name, self.true_pose, self._body)

    def pass_on(self, ranges: Mapping[str, float]) -> None:
        """Pass the ranges that the robot uses [m] to its `go_to_goal`."""
        for name, range_m in ranges.items():
            frame = sonar_frame(f"{self.member.name}/base_link", name)
            header = Header(stamp=self._stamps[name], frame_id=frame)
            self._heard[name].publish(Range(header=header, range=range_m))


def gather(
    stack: ExitStack,
    parts: Parts,
    setting: Setting,
    members: Sequence[Member],
    navigated: bool,
    world: str = WORLD,
) -> Team:
    """Starts boards and nodes of a team in a real and a virtual world; MrlError if a part fails, or is late."""
    truth, virtual = world_file.load(world), world_file.load(world)
    virtual.registry = registry = SharedRegistry(_shared("virtual"))
    stack.callback(registry.close)
    for space in sorted({"virtual" if member.virtual else "real" for member in members}):
        parts.node("world_node", space, world=world, world_name=_shared(space), localise=False)
    for number, member in enumerate(members):
        _start(parts, member, world, setting.seed, number, navigated)
    places = tf2_ros.StaticTransformBroadcaster()
    places.sendTransform([transform_of("map", f"{each.name}/odom", each.start) for each in members])
    robots = [TopicRobot(each, virtual if each.virtual else truth, navigated) for each in members]
    for robot in robots:
        stack.callback(robot.drive, 0.0, 0.0)
    wait_until(lambda: parts.check() or all(robot.ready for robot in robots), START_S)  # type: ignore[func-returns-value]
    late = [robot.member.name for robot in robots if not robot.ready]
    if late:
        raise MrlError(f"no odometry, sonars or true pose of {', '.join(late)} after {START_S:g} s")
    return Team([Player(r.member, r, virtual if r.member.virtual else truth, virtual) for r in robots])


def _shared(space: str) -> str:
    """Name of a world that the boards of this process share."""
    return f"{space}-{os.getpid()}"


def _start(parts: Parts, member: Member, world: str, seed: int, number: int, navigated: bool) -> None:
    """Start the board, the robot node and, if the robot is navigated, go_to_goal."""
    space = _shared("virtual" if member.virtual else "real")
    pose = world_file.pose_text(disturbances.placed(member.start, seed, member.name))
    errors = ("--error", disturbances.WANDER, "--sonar", disturbances.SONAR, "--seed", str(seed + number))
    place = ("--world", world, "--world-name", space, "--pose", pose)
    parts.robot(member.name, member.robot, RATE_HZ, *errors, *place)
    if navigated:
        parts.node("go_to_goal", member.name, *(f"sonar/{name}:=heard/{name}" for name in NAMES))


def begin_tour(parts: Parts, name: str, poses: Sequence[Pose], **parameters: object) -> None:
    """Starts `follow_waypoints` for a robot, with its waypoints in the frame of the map."""
    rows = [[round(x, 4), round(y, 4), round(math.degrees(yaw), 2)] for x, y, yaw in poses]
    parts.node(
        "follow_waypoints", name, "claims:=/claims", waypoints=str(rows).replace(" ", ""), **parameters
    )


def watch(team: Team, seconds: float, over: Callable[[float], bool]) -> float:
    """Passes ranges to the robots until `over` of the time so far [s], at most for `seconds`; the duration [s]."""
    ticks = 0
    while not over(ticks * TICK_S) and ticks * TICK_S < seconds:
        for player in team.players:
            player.robot.pass_on(player.ranges())
        team.tick([(0.0, 0.0)] * len(team.players))
        ticks += 1
    return ticks * TICK_S


def share_waypoint(parts: Parts, setting: Setting) -> TourRun:
    """The rounds of `shared-waypoint`, with claims on the topic `/claims`."""
    with ExitStack() as stack:
        members = shared_waypoint.MEMBERS
        team = gather(stack, parts, setting, members, navigated=True)
        names = ",".join(member.name for member in members)
        for member in members:
            poses = shared_waypoint.tour_of(member.name, ROUNDS)
            places = sorted(shared_waypoint.shared_of(poses))
            shared = ",".join(str(place + 1) for place in places)
            begin_tour(parts, member.name, poses, shared=shared, team=names)
        robots = [player.robot for player in team.players]
        lasted_s = watch(team, MOST_S, lambda _: all(robot.tour in (DONE, PAUSED) for robot in robots))
        return TourRun(team, [robot.visits for robot in robots], 0.0, lasted_s, len(robots))


def wander_team(parts: Parts, setting: Setting) -> Team:
    """The run of `mixed-team`."""
    with ExitStack() as stack:
        team = gather(stack, parts, setting, mixed_team.MEMBERS, navigated=False)
        return mixed_team.wander(team, WANDER_S)


def drive_steps(parts: Parts, setting: Setting) -> Live:
    """Drives the steps; the mirror receives the pose of each odometry message.

    The delay is that of a pose from the board, which read its counters at the message's stamp, to the mirror.
    MrlError if a part fails, or a waypoint is not reached.
    """
    with ExitStack() as stack:
        members = [Member(ROBOT, START, virtual=False, robot=setting.robot)]
        team = gather(stack, parts, setting, members, navigated=True, world=step_test.WORLD)
        (player,) = team.players
        with closing(Mirrored(setting.robot)) as mirror:
            try:
                _drive_mirrored(parts, team, player.robot, mirror)
            finally:
                player.robot.on_odometry = ignore
    return StepDrive(player.path, player.odometry_path, player.bumps, player.robot.visits), mirror


def _drive_mirrored(parts: Parts, team: Team, robot: TopicRobot, mirror: Mirrored) -> None:
    def send(message: Odometry) -> None:
        read_s = time.monotonic() - (rospy.Time.now() - message.header.stamp).to_sec()
        mirror.send(START.compose(*planar(message.pose.pose)), read_s)

    robot.on_odometry = send
    mirror.wait()
    begin_tour(parts, ROBOT, step_test.goals())

    def over(_: float) -> bool:
        parts.check()
        return robot.tour in (DONE, PAUSED)

    watch(team, STEPS_MOST_S, over)
    step_test.require_end(robot.visits, robot.pose)
