"""`python -m tests.documents.rviz_picture FILE.png` makes a picture of rviz with an emulated robot, without a screen.

It starts a ROS master, an X server in memory, `sim.launch`, `go_to_goal.launch` and `rviz.launch`, drives an arc,
and saves a screenshot.  It needs the packages rviz, xvfb, libgl1-mesa-dri and imagemagick.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Dict, List, Sequence
from xmlrpc.client import ServerProxy

from ros1_bridge.demo.launcher import master_answers
from ros1_bridge.demo.processes import Child, wait_until

ROOT = Path(__file__).resolve().parent.parent.parent
LAUNCH = ROOT / "ros1_bridge" / "launch"
LOGS = ROOT / "build" / "picture"
DISPLAY, PORT = ":87", 11387
SIZE = "1200x800"
COLOURS = 128
"""Colours in the palette; this keeps the file below 300 KiB."""
START_S, DRIVE_S, DRAW_S = 60.0, 7.0, 4.0
ARC = "{linear: {x: 0.2}, angular: {z: 0.25}}"
GOAL = "{header: {frame_id: odom}, pose: {position: {x: 0.3, y: 1.6}, orientation: {w: 1.0}}}"
"""A goal to the front left after the arc, so that the picture shows a plan."""


def environment() -> Dict[str, str]:
    """The environment of all child processes."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("ROS_PACKAGE_PATH"))))
    return {
        **os.environ,
        "DISPLAY": DISPLAY,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "QT_X11_NO_MITSHM": "1",
        "ROS_IP": "127.0.0.1",
        "ROS_MASTER_URI": f"http://127.0.0.1:{PORT}",
        "ROS_LOG_DIR": str(LOGS),
        "ROS_PACKAGE_PATH": path,
    }


def take(file: Path) -> None:
    """Make the picture.

    Raises:
        RuntimeError: a part did not start; the message holds the end of its log.
    """
    LOGS.mkdir(parents=True, exist_ok=True)
    env = environment()
    parts: List[Child] = []

    def start(name: str, *command: str) -> Child:
        parts.append(Child(name, command, LOGS / f"{name}.log", env, ROOT))
        return parts[-1]

    try:
        start("xvfb", "Xvfb", DISPLAY, "-screen", "0", f"{SIZE}x24")
        master = start("master", "rosmaster", "--core", "-p", str(PORT))
        _require(wait_until(lambda: master_answers(env["ROS_MASTER_URI"]), START_S), master)
        robot = start("robot", "roslaunch", str(LAUNCH / "sim.launch"), "name:=picture", "laser:=true")
        _require(wait_until(lambda: any("battery" in line for line in robot.output()), START_S), robot)
        seeker = start("seeker", "roslaunch", str(LAUNCH / "go_to_goal.launch"))
        rviz = start("rviz", "roslaunch", str(LAUNCH / "rviz.launch"), "fixed_frame:=map")
        _require(wait_until(lambda: _subscribed("/rviz", "/odom"), START_S), rviz)
        drive = start("drive", "rostopic", "pub", "-r", "10", "cmd_vel", "geometry_msgs/Twist", ARC)
        time.sleep(DRIVE_S)
        drive.signal(signal.SIGINT)
        _require(wait_until(lambda: _subscribed("/go_to_goal", "/odom"), START_S), seeker)
        start("goal", "rostopic", "pub", "-1", "move_base_simple/goal", "geometry_msgs/PoseStamped", GOAL)
        time.sleep(DRAW_S)
        _require(rviz.exit_code is None, rviz)
        _shoot(file, env)
    finally:
        for part in reversed(parts):
            part.signal(signal.SIGINT)
            part.finish(10.0)


def _subscribed(node: str, topic: str) -> bool:
    """Whether a node subscribes to a topic, according to the ROS master."""
    _, _, (_, subscribers, _) = ServerProxy(f"http://127.0.0.1:{PORT}").getSystemState("/picture")  # type: ignore
    return any(name == topic and node in nodes for name, nodes in subscribers)  # type: ignore


def _shoot(file: Path, env: Dict[str, str]) -> None:
    command = ["import", "-window", "root", "-colors", str(COLOURS), f"png8:{file}"]
    subprocess.run(command, env=env, check=True)


def _require(good: bool, part: Child) -> None:
    if not good:
        raise RuntimeError(part.last_words())


def main(arguments: Sequence[str]) -> int:
    """Take the picture; returns the exit code."""
    if len(arguments) != 1:
        sys.stderr.write("expected the name of a .png file\n")
        return 2
    try:
        take(Path(arguments[0]))
    except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
