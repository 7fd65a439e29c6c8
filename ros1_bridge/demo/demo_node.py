"""ROS node `demo_view`: shows a robot live, drives it in a square or from the keyboard.

The node subscribes to `odom`, `sonar/*`, `battery_state`, `status` and `/diagnostics`, and publishes `cmd_vel`.

Without a terminal, on a dumb terminal, or without the library `rich`, it prints a line every second, reads no keys, and
ends after the square.
"""

import math
import sys
import time
from typing import Any, Dict

import rosgraph
import rospy

from mrl_driver.clocks import clock_s
from mrl_driver.terminal import live_view
from mrl_driver.view.shown_state import line_of
from ros1_bridge.node.cmd_vel import OperatorCmdVel, twist_of
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.run_node import node
from ros1_bridge.topics.topic_robot import TopicRobot

from .demo_screen import DemoScreen

LINE_S = 1.0
PARAMETERS = (
    Row("square", bool, False, "", "Drive the square from the start"),
    Row("duration", float, 0.0, "s", "End after this much odometry; 0 means no end", 0.0, 1e6),
    Row("robot", str, "auto", "", "Robot model, path of a .yaml file, or auto: by the board's id"),
)
"""The node's private parameters."""


def topic_robot(robot: str) -> TopicRobot:
    """The robot behind this node's topics; `robot` is its model, or auto."""
    cmd_vel = OperatorCmdVel()

    def publish(*speeds: float) -> None:
        cmd_vel.send(twist_of(*speeds), clock_s())

    found = TopicRobot(
        publish, rospy.is_shutdown, robot, lambda: cmd_vel.delay_s, rospy.resolve_name("robot_node")
    )
    found.subscribe(rospy.Subscriber)
    return found


def run_lines(robot: TopicRobot, screen: DemoScreen) -> None:
    """Print a line every second until the end, which is that of the square if one is driven and no duration is set."""
    printed_s, square = -math.inf, screen.square
    while not screen.ended and not robot.wait(0):
        now_s = clock_s()
        screen.steer(now_s)
        if screen.square is not square and not screen.duration_s:
            return
        if now_s >= printed_s + LINE_S:
            printed_s = now_s
            state = robot.state()
            started = math.isfinite(state.age_s)
            line = f"{screen.elapsed_s:5.0f} s  {line_of(state)}  {screen.warning()}".rstrip()
            _say(line if started else "waiting for odometry")
        time.sleep(live_view.TICK_S)


def can_show_screen() -> bool:
    """Whether the terminal can show the live view: it must move its cursor and show the view's characters."""
    try:
        from rich.console import Console
    except ImportError:
        return False
    console = Console()
    able = console.is_terminal and not console.is_dumb_terminal and console.encoding.startswith("utf")
    return able and sys.stdin.isatty()


def _run(given: Dict[str, Any]) -> None:
    """Show the robot until the end."""
    robot = topic_robot(given["robot"])
    master = f"ROS_MASTER_URI={rosgraph.get_master_uri()}"
    screen = DemoScreen(robot, master, given["square"], given["duration"])
    if can_show_screen():
        live_view.run(robot, screen)
    else:
        run_lines(robot, screen)
    if robot.command is not None:
        robot.stop()
    if screen.live.frames:
        _say(screen.summary())


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


main = node("demo_view", PARAMETERS, _run)
