"""ROS node `demo_view`: shows a robot live, drives it in a square or from the keyboard.

The node subscribes to `odom`, `sonar/*`, `battery` and `/diagnostics`, and publishes `cmd_vel`.

Private parameters: `~square` drives the square from the start; `~duration` [s] ends the run after that much
odometry; `~title` is the title of the view.

Without a terminal, on a dumb terminal, or without the library `rich`, it prints a line every second and reads no keys.
"""

import math
import sys
import threading
import time
from typing import List, Optional, Tuple

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Range

from mrl_driver.geometry import Pose, yaw_of
from mrl_driver.navigation.line_follower import Square
from mrl_driver.terminal.keyboard import Keyboard
from mrl_driver.terminal.teleop_keys import Teleop
from ros1_bridge.node.cmd_vel import CmdVel

from .report import Recorder, Snapshot, line, summary

SONARS = ("front", "left", "right")
LINK_DIAGNOSTICS = "Link"
TICK_S, REFRESH_S = 0.05, 0.1
STALE_S = 0.3
PATIENCE_S = 20.0
"""If a duration is set, odometry must begin within this time."""
SQUARE, KEYS, STOPPED = "square", "keyboard", "stopped"


class DemoView:
    """Connects the topics to a recorder, and the commands to `cmd_vel`."""

    def __init__(self, square: bool) -> None:
        self._lock = threading.Lock()
        self._recorder = Recorder()
        self._square = Square()
        self._teleop = Teleop()
        self._mode = SQUARE if square else STOPPED
        self._cmd_vel = CmdVel()
        rospy.Subscriber("odom", Odometry, self._on_odometry, queue_size=50, tcp_nodelay=True)
        rospy.Subscriber("battery", BatteryState, self._on_battery, queue_size=1)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics, queue_size=10)
        for name in SONARS:
            rospy.Subscriber(f"sonar/{name}", Range, self._on_range, callback_args=name, queue_size=1)

    def snapshot(self) -> Snapshot:
        """The robot's state now."""
        with self._lock:
            return self._recorder.snapshot(self._mode, time.monotonic())

    def press(self, key: str) -> None:
        """Handle a key; a key that drives or stops ends the square."""
        if key == "r":
            self._square, self._mode = Square(), SQUARE
        elif self._teleop.press(key, time.monotonic()):
            self._mode = STOPPED if key == "space" else KEYS

    def drive(self, now: Snapshot) -> None:
        """Publish the command of the mode; publish nothing while stopped, so that other nodes can drive."""
        if self._mode == STOPPED:
            return
        command = (0.0, 0.0)
        if self._mode == KEYS:
            command = self._teleop.command(time.monotonic())
            self._mode = KEYS if any(command) else STOPPED
        elif now.age_s < STALE_S:
            command = self._square.command(now.pose)
        self._publish(command)

    def halt(self) -> None:
        """Publish a stop if this node was driving."""
        if self._mode != STOPPED:
            self._mode = STOPPED
            self._publish((0.0, 0.0))

    def _publish(self, command: Tuple[float, float]) -> None:
        message = Twist()
        message.linear.x, message.angular.z = command
        self._cmd_vel.publish(message)

    def _on_odometry(self, message: Odometry) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        pose = Pose(at.x, at.y, yaw_of(turn.x, turn.y, turn.z, turn.w))
        twist = (message.twist.twist.linear.x, message.twist.twist.angular.z)
        with self._lock:
            self._recorder.add_odometry(pose, twist, time.monotonic())

    def _on_range(self, message: Range, name: str) -> None:
        with self._lock:
            self._recorder.ranges[name] = message.range

    def _on_battery(self, message: BatteryState) -> None:
        with self._lock:
            self._recorder.battery = (message.voltage, message.percentage)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith(f": {LINK_DIAGNOSTICS}"):
                with self._lock:
                    self._recorder.link = {pair.key: pair.value for pair in status.values}


class Clock:
    """Decides when the run ends by itself."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._started_s = time.monotonic()

    def ended(self, now: Snapshot) -> bool:
        """Whether the duration is over."""
        return bool(self._duration_s) and now.elapsed_s >= self._duration_s

    def overdue(self, now: Snapshot) -> bool:
        """Whether a run with a duration has waited too long for its first odometry."""
        return bool(self._duration_s) and not now.frames and time.monotonic() > self._started_s + PATIENCE_S


def run_lines(view: DemoView, clock: Clock) -> bool:
    """Print a line every second until the end; False if there was no odometry."""
    printed_s = -math.inf
    while not rospy.is_shutdown():
        now = view.snapshot()
        if clock.ended(now) or clock.overdue(now):
            return bool(now.frames)
        view.drive(now)
        if time.monotonic() >= printed_s + 1.0:
            printed_s = time.monotonic()
            _say(line(now))
        time.sleep(TICK_S)
    return True


def can_show_screen() -> bool:
    """Whether the terminal can show the live view: it must move its cursor and show the view's characters."""
    try:
        from rich.console import Console
    except ImportError:
        return False
    console = Console()
    able = console.is_terminal and not console.is_dumb_terminal and console.encoding.startswith("utf")
    return able and sys.stdin.isatty()


def run_screen(view: DemoView, clock: Clock, title: str) -> bool:
    """Show the live view until q, the end of the duration, or a signal; False if there was no odometry."""
    from rich.console import Console
    from rich.live import Live

    from .screen import render

    console = Console()
    live = Live(
        console=console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
    )
    shown_s, note = -math.inf, f"ROS_MASTER_URI={rosgraph.get_master_uri()}"
    with Keyboard() as keyboard, live:
        while not rospy.is_shutdown():
            keys: List[str] = keyboard.read(TICK_S)
            for key in keys:
                view.press(key)
            now = view.snapshot()
            if "q" in keys or clock.ended(now) or clock.overdue(now):
                return bool(now.frames) or "q" in keys
            view.drive(now)
            if time.monotonic() >= shown_s + REFRESH_S:
                shown_s = time.monotonic()
                live.update(render(now, title, console.width, console.height, note), refresh=True)
    return True


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node; exit code 1 if a run with a duration saw no odometry."""
    rospy.init_node("demo_view", argv=argv)
    view = DemoView(bool(rospy.get_param("~square", False)))
    clock = Clock(float(rospy.get_param("~duration", 0.0)))
    if can_show_screen():
        good = run_screen(view, clock, str(rospy.get_param("~title", "robot")))
    else:
        good = run_lines(view, clock)
    view.halt()
    if not good:
        _say(f"no odometry within {PATIENCE_S:.0f} s")
        return 1
    if view.snapshot().frames:
        _say(summary(view.snapshot()))
    return 0


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
