"""An emulated robot with the real navigation packages.  Needs no master."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Callable, Dict, List, Sequence

from rosgraph.masterapi import is_online

from mrl_driver.errors import ConfigError, MrlError
from ros1_bridge.node import packages
from ros1_bridge.node.processes import Child, free_port, wait_until
from sim_arduino.world.world import World

ROOT = Path(__file__).resolve().parents[3]
NEEDED = ("map_server", "move_base")
LAUNCH = ROOT / "ros1_bridge" / "launch"
START_S = 60.0
END_S = 20.0


class StackError(MrlError):
    """A part of the stack did not start."""


def packages_for(sensors: str) -> List[str]:
    """The packages of navigation.launch with these sensors."""
    layer = () if sensors == "laser" else ("range_sensor_layer",)
    return [*NEEDED, *layer, "tf2_ros" if sensors == "sonars" else "amcl"]


def require_packages(needed: Sequence[str]) -> None:
    """Check that packages are installed, or in a workspace that was sourced; ConfigError says how to get them."""
    lacking = packages.missing(needed)
    if lacking:
        raise ConfigError(f"{packages.advice(lacking)}, and give its setup.bash as NAVIGATION_SETUP")


def end_with(main: Callable[[List[str]], int]) -> None:
    """End this program with what `main` returns for its arguments; an MrlError costs a line."""
    try:
        sys.exit(main(sys.argv[1:]))
    except MrlError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_code)


def systems_python() -> Dict[str, str]:
    """This environment with the system's python3 first: catkin's and ROS's modules are there."""
    return {**os.environ, "PATH": os.pathsep.join(("/usr/bin:/bin", os.environ["PATH"]))}


class Master:
    """A ROS master of its own, and programs with it; a context manager.

    The environment of this process gets the master's address.
    """

    def __init__(self, folder: Path) -> None:
        """`folder`: for the logs."""
        self._folder = folder
        self._parts: List[Child] = []
        folder.mkdir(parents=True, exist_ok=True)
        self._port = free_port()
        os.environ.update(
            ROS_MASTER_URI=f"http://127.0.0.1:{self._port}", ROS_IP="127.0.0.1", ROS_LOG_DIR=str(folder)
        )
        path = os.pathsep.join((str(ROOT), os.environ.get("ROS_PACKAGE_PATH", "/usr/share")))
        self._env = {**systems_python(), "ROS_PACKAGE_PATH": path}

    def __enter__(self) -> "Master":
        try:
            self._start_all()
        except BaseException:
            self.close()
            raise
        return self

    def _start_all(self) -> None:
        master = self.start("master", "rosmaster", "--core", "-p", str(self._port))
        self.require(lambda: is_online(self._env["ROS_MASTER_URI"]), master)

    def start(self, name: str, *command: str) -> Child:
        """Start a program, whose output goes to a log of its name."""
        self._parts.append(Child(name, command, self._folder / f"{name}.log", self._env, ROOT))
        return self._parts[-1]

    def require(self, condition: Any, part: Child) -> None:
        """Wait until a condition is true; StackError if it stays false, or the program ends before."""
        wait_until(lambda: condition() or part.exit_code is not None, START_S)
        if part.exit_code is not None or not condition():
            raise StackError(f"{part.name} did not start, see {part.log}: {part.last_words()}")

    def end(self, part: Child) -> None:
        part.signal(signal.SIGINT)
        part.finish(END_S)
        self._parts.remove(part)

    def close(self) -> None:
        """End everything, the last started first."""
        for part in reversed(self._parts[:]):
            self.end(part)

    def __exit__(self, *_: Any) -> None:
        self.close()


class Stack(Master):
    """Emulated robot with a laser, map, localisation and move_base."""

    def __init__(
        self, robot: str, world: str, scene: World, folder: Path, arguments: Sequence[str] = ()
    ) -> None:
        """`arguments`: those of navigation.launch but robot, map and start."""
        super().__init__(folder)
        self._arguments = arguments
        self._robot, self._world, self._scene = robot, world, scene

    def _start_all(self) -> None:
        super()._start_all()
        name, file, start = f"ten_goals_{os.getpid()}", self._folder / "map.yaml", self._scene.start
        self._finish(sys.executable, str(ROOT / "ros1_bridge" / "nodes" / "save_map"), self._world, str(file))
        common = (f"robot:={self._robot}",)
        robot = self.start(
            "robot",
            *("roslaunch", str(LAUNCH / "sim.launch"), *common, f"world:={self._world}", f"name:={name}"),
            *(f"world_name:={name}", "laser:=true", "localise:=false"),
        )
        self.require(lambda: any("battery" in line for line in robot.output()), robot)
        place = (f"x:={start.x_m}", f"y:={start.y_m}", f"yaw:={start.yaw_rad}")
        more = (*common, f"map:={file}", *place, *self._arguments)
        self.start("navigation", "roslaunch", str(LAUNCH / "navigation.launch"), *more)

    def _finish(self, *command: str) -> None:
        done = subprocess.run(command, env=self._env, capture_output=True, text=True, check=False)
        if done.returncode:
            raise StackError(done.stderr.strip())
