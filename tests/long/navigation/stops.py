"""`python -m tests.long.navigation.stops`: each way to stop ends the goal of the real move_base; then nothing moves.

An emulated TraxBot drives to goals in the house, then the same for `follow_waypoints`, whose service `resume` begins
all ways but the first.  On the way it is stopped, and the stop is taken back.  The figures, how far it moves until it
stands and in the 8 s after the release [m], go to build/bench/navigation_stops.json.
"""

import math
import os
import signal
import subprocess
import sys
import time
import xmlrpc.client
from typing import Any, Callable, Dict, NamedTuple, Sequence, Tuple

import actionlib
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from move_base_msgs.msg import MoveBaseAction
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool, Trigger

from mrl_driver.errors import MrlError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.waypoint_tour import PAUSED
from ros1_bridge.node.plane_poses import planar, write_pose
from ros1_bridge.node.processes import wait_until
from sim_arduino.world import world_file
from tests.long.bench import report

from .drive import message_of
from .goals import GOALS, Goal
from .stack import ROOT, Stack, end_with, packages_for, require_packages

FOLDER, NODES = ROOT / "build" / "navigation" / "stops", ROOT / "ros1_bridge" / "nodes"
UNDER_WAY_M, LIMIT_S = 0.3, 60.0
STANDS_M, STANDS_S = 0.001, 1.5  # longer than the gap that ends no goal, 1 s
RELEASED_S = 8.0
LIMIT_M, FROZEN_M = 0.01, 0.15
"""How far the robot may move after the release [m]; one whose board stood still drives until its watchdog's stop."""
Act = Callable[[], Any]


def ways_to_stop(stack: Stack) -> Dict[str, Tuple[Act, Act]]:
    """Each way to stop the robot, and how it is taken back."""

    def switch(name: str, on: bool) -> Act:
        return lambda: rospy.ServiceProxy(name, SetBool)(on)

    def board(number: int) -> Act:
        return lambda: subprocess.check_call(["pkill", f"-{number}", "-f", f"sim_board .*_{os.getpid()}"])

    def kill() -> None:
        api = rosgraph.Master("/stops").lookupNode("/robot_node")
        os.kill(xmlrpc.client.ServerProxy(api).getPid("/stops")[2], signal.SIGKILL)  # type: ignore

    return {
        "stop": (rospy.ServiceProxy("stop", Trigger), rospy.ServiceProxy("release_stop", Trigger)),
        "motors": (switch("enable_motors", False), switch("enable_motors", True)),
        "manual": (switch("manual_mode", True), switch("manual_mode", False)),
        "silence": (board(signal.SIGSTOP), board(signal.SIGCONT)),
        "restart": (kill, lambda: stack.start("robot_node", str(NODES / "robot_node"), "__name:=robot_node")),
    }


class Place:
    """The true place of the robot."""

    def __init__(self) -> None:
        self.now = Pose(math.nan, math.nan, math.nan)
        rospy.Subscriber("base_pose_ground_truth", Odometry, self._see)
        self._told = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=1)

    def _see(self, message: Any) -> None:
        self.now = planar(message.pose.pose)

    def tell(self) -> None:
        """Give it to amcl, which takes the new odometry of a node that starts again for motion."""
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        write_pose(self.now, message.pose.pose)
        self._told.publish(message)

    def moved_m(self, since: Pose) -> float:
        """How far it is from there."""
        return math.dist(self.now[:2], since[:2])

    def farthest(self) -> Goal:
        """The goal that is farthest from it."""
        return max(GOALS["house"], key=lambda goal: math.dist(self.now[:2], goal[:2]))

    def is_kept(self) -> bool:
        """Whether the robot stands."""
        before = self.now
        time.sleep(STANDS_S)
        return self.moved_m(before) < STANDS_M


class Source(NamedTuple):
    """What gives goals to move_base."""

    begin: Act
    has_ended: Callable[[], bool]


def goals_of(_: Stack, place: Place) -> Source:
    """A client of the action."""
    client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
    if not client.wait_for_server(rospy.Duration(LIMIT_S)):
        raise MrlError(f"move_base offers no action after {LIMIT_S:g} s, see {FOLDER}")

    def begin() -> None:
        client.send_goal(message_of(place.farthest(), "map"))

    return Source(begin, lambda: client.get_state() > actionlib.GoalStatus.ACTIVE)


def tour_of(stack: Stack, place: Place) -> Source:
    """The node `follow_waypoints`, which drives at once."""
    state: Dict[str, str] = {}

    def see(message: Any) -> None:
        state.update((pair.key, pair.value) for pair in message.values)

    rospy.Subscriber("waypoint_status", DiagnosticStatus, see)
    rospy.set_param("follow_waypoints/waypoints", [list(place.farthest())])
    stack.start("follow_waypoints", str(NODES / "follow_waypoints"))
    resume = rospy.ServiceProxy("follow_waypoints/resume", Trigger)

    def is_paused() -> bool:
        return state.get("state") == PAUSED

    return Source(lambda: is_paused() and resume(), is_paused)


def figures_of(source: Source, place: Place, stop: Act, release: Act) -> Tuple[float, float]:
    """How far the robot moves after a stop on its way, and after the release [m].

    Raises:
        MrlError: it did not begin to drive, or the goal did not end.
    """

    def required(condition: Callable[[], bool], what: str) -> None:
        if not wait_until(condition, LIMIT_S):
            raise MrlError(f"after {LIMIT_S:g} s {what}")

    place.tell()
    start = place.now
    source.begin()
    required(lambda: place.moved_m(start) > UNDER_WAY_M, "the robot has not moved to its goal")
    stop()
    stopped = place.now
    required(place.is_kept, "the robot still moves")
    stood = place.now
    release()
    required(source.has_ended, "the goal is still active")
    time.sleep(RELEASED_S)
    return math.dist(stopped[:2], stood[:2]), place.moved_m(stood)


def main(_: Sequence[str]) -> int:
    """Try all; returns the exit code."""
    require_packages(packages_for("laser"))
    figures: Dict[str, float] = {}
    moved = []
    with Stack("traxbot", "house", world_file.load("house"), FOLDER, ("sensors:=laser",)) as stack:
        rospy.init_node("stops", disable_signals=True)
        place, ways = Place(), ways_to_stop(stack)
        for prefix, source_of in (("", goals_of), ("tour_", tour_of)):
            source = source_of(stack, place)
            for name, acts in ways.items():
                key, limit_m = prefix + name, FROZEN_M if name == "silence" else LIMIT_M
                figures[f"{key}_m"], figures[f"{key}_after_m"] = figures_of(source, place, *acts)
                moved += [key] * (figures[f"{key}_after_m"] > limit_m)
    if moved:
        sys.stderr.write(f"the robot moved after the release: {', '.join(moved)}\n")
    return int(report.conclude("navigation_stops", figures) or bool(moved))


if __name__ == "__main__":
    end_with(main)
