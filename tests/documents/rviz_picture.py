"""`python -m tests.documents.rviz_picture FILE.png [navigation|team|environment]` makes a picture without a screen.

It starts a ROS master, an X server in memory, `sim.launch`, `go_to_goal.launch` and `rviz.launch`, drives an arc,
and saves a screenshot.  With `navigation`, it shows the real navigation packages, which must be installed or sourced.
With `team`, it shows a robot on a port, in place of a real one, that meets a virtual one by
`mirror.launch` and stops before it.  With `environment`, it plays the bag of a recorded survey.  It needs the packages
rviz, xvfb, libgl1-mesa-dri and imagemagick.
"""

import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Callable, Dict, List, Sequence, Tuple
from xmlrpc.client import ServerProxy

from rosgraph.masterapi import is_online

from mrl_driver.geometry import quaternion_of
from ros1_bridge.node.processes import Child, wait_until
from sim_arduino.world import world_file
from tests.long.bench.report import FAST
from tests.long.navigation.stack import systems_python

ROOT = Path(__file__).resolve().parent.parent.parent
LAUNCH = ROOT / "ros1_bridge" / "launch"
LOGS = ROOT / "build" / "picture"
DISPLAY, PORT = ":87", 11387
SIZE = "1280x720"
COLOURS = 128  # Colours in the palette; this keeps the file below 300 KiB
START_S = 60.0
DRIVE_S, DRAW_S = 7.0, 4.0
AHEAD = "{linear: {x: 0.2}}"
ARC = "{linear: {x: 0.2}, angular: {z: 0.25}}"
GOAL = "{header: {frame_id: odom}, pose: {position: {x: 0.3, y: 1.6}, orientation: {w: 1.0}}}"
"""A goal to the front left after the arc, so that the picture shows a plan."""
IN_THE_HOUSE = "{header: {frame_id: map}, pose: {position: {x: 4.5, y: 1.0}, orientation: {w: 1.0}}}"
"""Through a door into the next room."""


def environment() -> Dict[str, str]:
    """The environment of all child processes."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("ROS_PACKAGE_PATH"))))
    return {
        **systems_python(),
        "DISPLAY": DISPLAY,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "QT_X11_NO_MITSHM": "1",
        "ROS_IP": "127.0.0.1",
        "ROS_MASTER_URI": f"http://127.0.0.1:{PORT}",
        "ROS_LOG_DIR": str(LOGS),
        "ROS_PACKAGE_PATH": path,
    }


Start = Callable[..., Child]


def take(file: Path, show: Callable[[Start], Child]) -> None:
    """Make the picture of what `show` starts; it returns rviz.

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
        _require(wait_until(lambda: is_online(env["ROS_MASTER_URI"]), START_S), master)
        rviz = show(start)
        time.sleep(0.0 if FAST else DRAW_S)
        _require(rviz.exit_code is None, rviz)
        _shoot(file, env)
    finally:
        for part in reversed(parts):
            part.signal(signal.SIGINT)
            part.finish(10.0)


def one_robot(start: Start) -> Child:
    """A robot drives an arc and to a goal; returns rviz."""
    robot = start("robot", "roslaunch", str(LAUNCH / "sim.launch"), "name:=picture", "laser:=true")
    _require(wait_until(partial(_is_up, robot), START_S), robot)
    rviz = start("rviz", "roslaunch", str(LAUNCH / "rviz.launch"), "fixed_frame:=map")
    _require(wait_until(lambda: _subscribed("/rviz", "/odom"), START_S), rviz)
    if FAST:
        return rviz  # the robot where it stands
    seeker = start("seeker", "roslaunch", str(LAUNCH / "go_to_goal.launch"))
    drive = start("drive", "rostopic", "pub", "-r", "10", "cmd_vel", "geometry_msgs/Twist", ARC)
    time.sleep(DRIVE_S)
    drive.signal(signal.SIGINT)
    _require(wait_until(lambda: _subscribed("/go_to_goal", "/odom"), START_S), seeker)
    start("goal", "rostopic", "pub", "-1", "move_base_simple/goal", "geometry_msgs/PoseStamped", GOAL)
    return rviz


def navigation(start: Start) -> Child:
    """A robot with zones drives through the house with the real navigation packages; returns rviz."""
    house, file = world_file.load("house").start, LOGS / "map.yaml"
    save = start("map", str(LAUNCH.parent / "nodes" / "save_map"), "house", str(file))
    _require(save.wait(START_S) and save.exit_code == 0, save)
    options = ("world:=house", "laser:=true", "localise:=false", "zones:=both", "zone_warning:=0.3")
    robot = start("robot", "roslaunch", str(LAUNCH / "sim.launch"), "name:=picture", *options)
    _require(wait_until(partial(_is_up, robot), START_S), robot)
    place = (f"x:={house.x_m}", f"y:={house.y_m}", f"yaw:={house.yaw_rad}")
    stack = ("roslaunch", str(LAUNCH / "navigation.launch"), f"map:={file}", "sensors:=both", *place)
    planner = start("planner", *stack)
    rviz = start("rviz", "roslaunch", str(LAUNCH / "rviz.launch"), "fixed_frame:=map")
    _require(wait_until(lambda: _subscribed("/rviz", "/markers"), START_S), rviz)
    _require(wait_until(lambda: _subscribed("/move_base", "/move_base/cancel"), START_S), planner)
    start("goal", "rostopic", "pub", "-1", "move_base_simple/goal", "geometry_msgs/PoseStamped", IN_THE_HOUSE)
    time.sleep(DRIVE_S)
    return rviz


def mixed_team(start: Start) -> Child:
    """A robot on a port drives towards a virtual one, and its zones stop it; returns rviz."""
    port, world = str(LOGS / "real"), "picture"
    sim = (sys.executable, "-m", "sim_arduino.serve.main", "--world", "room")
    start("real", *sim, "--name", "real", "--link", port)
    start(
        "virtual",
        *sim,
        "--name",
        "robot2",
        "--world-name",
        world,
        "--link",
        f"{port}2",
        "--pose",
        "1.1,0.1,160",
    )
    for name, its in (
        ("robot1", port),
        ("robot2", f"{port}2"),
    ):  # one after the other: two could disagree on the run
        options = (f"port:={its}", "port_timeout:=60", "robot:=traxbot", f"prefix:={name}/", "zones:=both")
        robot = start(name, *_within(name), str(LAUNCH / "robot.launch"), *options)
        _require(wait_until(partial(_is_up, robot), START_S), robot)
    start("world", "roslaunch", str(LAUNCH / "world.launch"), f"world_name:={world}")
    start("mirror", *_within("robot1"), str(LAUNCH / "mirror.launch"), f"world_name:={world}", "name:=robot1")
    config = f"config:={LAUNCH.parent / 'rviz' / 'team.rviz'}"
    rviz = start("rviz", "roslaunch", str(LAUNCH / "rviz.launch"), config, "fixed_frame:=map")
    _require(wait_until(lambda: _subscribed("/rviz", "/robot1/mirror/sonar/front"), START_S), rviz)
    start("drive", "rostopic", "pub", "-r", "10", "robot1/cmd_vel", "geometry_msgs/Twist", AHEAD)
    time.sleep(DRIVE_S)
    return rviz


TOP_VIEW = """    Current:
      Class: rviz/TopDownOrtho
      Name: Current View
      Scale: 104
      X: 2
      Y: 1.7
      Angle: 0
      Target Frame: map
"""
SURVEY_RATE = "10"


def environment_map(start: Start) -> Child:
    """A bag of a robot that sweeps the arena, with its sensors, is played; returns rviz."""
    bag, config = str(LOGS / "survey.bag"), LOGS / "top.rviz"
    survey = start("survey", sys.executable, "-m", "tests.documents.survey", bag)
    _require(survey.wait(10 * START_S) and survey.exit_code == 0, survey)
    usual = (LAUNCH.parent / "rviz" / "robot.rviz").read_text(encoding="utf-8")
    config.write_text(re.sub(r"    Current:\n(      .*\n)+", TOP_VIEW, usual), encoding="utf-8")
    clock = start("clock", "rosparam", "set", "use_sim_time", "true")
    _require(clock.wait(START_S), clock)
    cells = start("cells", "roslaunch", str(LAUNCH / "environment_map.launch"))
    _require(wait_until(lambda: _subscribed("/environment_map", "/dust"), START_S), cells)
    start("world", "roslaunch", str(LAUNCH / "world.launch"), "world:=hazards")
    start("robot", "roslaunch", str(LAUNCH / "describe.launch"), "robot:=traxbot")
    at, (z, w) = world_file.load("hazards").start, quaternion_of(world_file.load("hazards").start.yaw_rad)
    place = f"translation: {{x: {at.x_m}, y: {at.y_m}}}, rotation: {{z: {z}, w: {w}}}"
    tf = f"{{transforms: [{{header: {{frame_id: map}}, child_frame_id: odom, transform: {{{place}}}}}]}}"
    start("place", "rostopic", "pub", "-l", "/tf_static", "tf2_msgs/TFMessage", tf)
    rviz = start("rviz", "roslaunch", str(LAUNCH / "rviz.launch"), f"config:={config}", "fixed_frame:=map")
    _require(wait_until(lambda: _subscribed("/rviz", "/environment_map"), START_S), rviz)
    played = start("bag", "rosbag", "play", "--clock", "-r", SURVEY_RATE, bag)
    _require(played.wait(10 * START_S), played)
    return rviz


def _is_up(robot: Child) -> bool:
    """Whether a robot's node has connected to its board."""
    return any("baud, battery" in line for line in robot.output())


def _within(space: str) -> Tuple[str, ...]:
    """roslaunch in a namespace."""
    return "env", f"ROS_NAMESPACE={space}", "roslaunch"


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


PICTURES = {"": one_robot, "team": mixed_team, "navigation": navigation, "environment": environment_map}


def main(arguments: Sequence[str]) -> int:
    """Take the picture; returns the exit code."""
    file, show = (*arguments, "")[:2]
    if not file or show not in PICTURES or len(arguments) > 2:
        sys.stderr.write("expected the name of a .png file, and perhaps team, navigation or environment\n")
        return 2
    try:
        take(Path(file), PICTURES[show])
    except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
