"""`python -m tests.long.navigation.stops`: each way to stop ends the goal of the real move_base; then nothing moves.

An emulated TraxBot drives to goals in the house.  On the way it is stopped, and the stop is taken back.  The figures,
how far it moves until it stands and in the 8 s after the release [m], go to build/bench/navigation_stops.json.
"""

import math
import os
import signal
import subprocess
import sys
import time
import xmlrpc.client
from typing import Any, Callable, Dict, Sequence, Tuple

import actionlib
import rosgraph
import rospy
from move_base_msgs.msg import MoveBaseAction
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool, Trigger

from mrl_driver.errors import MrlError
from ros1_bridge.demo.processes import wait_until
from sim_arduino.world import world_file
from tests.long.bench import report

from .drive import message_of
from .goals import GOALS
from .stack import ROOT, Stack, end_with, packages_for, require_packages

FOLDER = ROOT / "build" / "navigation" / "stops"
UNDER_WAY_M, LIMIT_S = 0.3, 60.0
STANDS_M, STANDS_S = 0.001, 0.5
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

    node = str(ROOT / "ros1_bridge" / "nodes" / "robot_node")
    return {
        "stop": (rospy.ServiceProxy("stop", Trigger), rospy.ServiceProxy("release_stop", Trigger)),
        "motors": (switch("enable_motors", False), switch("enable_motors", True)),
        "manual": (switch("manual_mode", True), switch("manual_mode", False)),
        "silence": (board(signal.SIGSTOP), board(signal.SIGCONT)),
        "restart": (kill, lambda: stack.start("robot_node", node, "__name:=robot_node")),
    }


class Place:
    """The true place of the robot."""

    def __init__(self) -> None:
        self.now = (math.nan, math.nan)
        rospy.Subscriber("base_pose_ground_truth", Odometry, self._see)

    def _see(self, message: Any) -> None:
        self.now = message.pose.pose.position.x, message.pose.pose.position.y

    def moved_m(self, since: Tuple[float, float]) -> float:
        """How far it is from there."""
        return math.dist(self.now, since)

    def is_kept(self) -> bool:
        """Whether the robot stands."""
        before = self.now
        time.sleep(STANDS_S)
        return self.moved_m(before) < STANDS_M


def figures_of(client: Any, place: Place, stop: Act, release: Act) -> Tuple[float, float]:
    """How far the robot moves after a stop on its way, and after the release [m].

    Raises:
        MrlError: it did not begin to drive, or the goal did not end.
    """

    def required(condition: Callable[[], bool], what: str) -> None:
        if not wait_until(condition, LIMIT_S):
            raise MrlError(f"after {LIMIT_S:g} s {what}")

    start = place.now
    goal = max(GOALS["house"], key=lambda goal: place.moved_m(goal[:2]))
    client.send_goal(message_of(goal, "map"))
    required(lambda: place.moved_m(start) > UNDER_WAY_M, "the robot has not moved to its goal")
    stop()
    stopped = place.now
    required(place.is_kept, "the robot still moves")
    stood = place.now
    release()
    required(lambda: client.get_state() > actionlib.GoalStatus.ACTIVE, "the goal is still active")
    time.sleep(RELEASED_S)
    return math.dist(stopped, stood), place.moved_m(stood)


def main(_: Sequence[str]) -> int:
    """Try all; returns the exit code."""
    require_packages(packages_for("laser"))
    figures: Dict[str, float] = {}
    with Stack("traxbot", "house", world_file.load("house"), FOLDER, ("sensors:=laser",)) as stack:
        rospy.init_node("stops", disable_signals=True)
        place, client = Place(), actionlib.SimpleActionClient("move_base", MoveBaseAction)
        if not client.wait_for_server(rospy.Duration(LIMIT_S)):
            raise MrlError(f"move_base offers no action after {LIMIT_S:g} s, see {FOLDER}")
        ways = ways_to_stop(stack)
        for name, acts in ways.items():
            figures[f"{name}_m"], figures[f"{name}_after_m"] = figures_of(client, place, *acts)
    limits = {name: FROZEN_M if name == "silence" else LIMIT_M for name in ways}
    moved = [name for name, limit_m in limits.items() if figures[f"{name}_after_m"] > limit_m]
    if moved:
        sys.stderr.write(f"the robot moved after the release: {', '.join(moved)}\n")
    return int(report.conclude("navigation_stops", figures) or bool(moved))


if __name__ == "__main__":
    end_with(main)
