"""An emulated robot with the real navigation packages: what is built, and what runs.  Imports no ROS."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict, List

from mrl_driver.errors import ConfigError, MrlError
from ros1_bridge.demo.launcher import free_port, master_answers
from ros1_bridge.demo.processes import Child, wait_until
from sim_arduino.world.world import World

ROOT = Path(__file__).resolve().parents[3]
NEEDED = ("amcl", "map_server", "move_base")
FILES = ("package.xml", "CMakeLists.txt", "setup.py", "LICENSE", "README.md")
PARTS = ("mrl_driver", "sim_arduino", "ros1_bridge", *FILES)
"""What belongs to the package of this repository."""
START_S = 60.0
END_S = 20.0


class StackError(MrlError):
    """A part of the stack did not start."""


def require_sources(source: Path) -> None:
    """Check that a folder has the packages that navigation.launch starts.

    Raises:
        ConfigError: it has not; the message names those that are missing.
    """
    found = {path.parent.name for path in source.rglob("package.xml")} if source.is_dir() else set()
    lacking = [name for name in NEEDED if name not in found]
    if lacking:
        raise ConfigError(
            f"NAVIGATION_SRC is {source}, which lacks {', '.join(lacking)}, expected a folder with the sources of "
            "https://github.com/ros-planning/navigation and of what the machine lacks of their dependencies"
        )


def systems_python() -> Dict[str, str]:
    """This environment with the system's python3 first: catkin's and ROS's modules are there."""
    return {**os.environ, "PATH": os.pathsep.join(("/usr/bin:/bin", os.environ["PATH"]))}


def build(source: Path, folder: Path) -> Path:
    """Build the packages of a source tree beside this one; returns the file to source.

    Raises:
        StackError: the build failed; the log is named.
    """
    own = folder / "src" / "mrl_robots"
    own.mkdir(parents=True, exist_ok=True)
    links = {
        own / part: ROOT / part for part in PARTS
    }  # not all of it: roslaunch would search this workspace too
    links[folder / "src" / "navigation"] = source.resolve()
    for link, target in links.items():
        if link.is_symlink():
            link.unlink()
        link.symlink_to(target)
    log = folder / "build.log"
    command = ["catkin_make_isolated", "--directory", str(folder), "--merge"]
    command += ["--only-pkg-with-deps", *NEEDED, "mrl_robots"]
    command += ["--cmake-args", "-DCMAKE_BUILD_TYPE=Release", "-DCATKIN_ENABLE_TESTING=OFF"]
    with log.open("wb") as out:
        done = subprocess.run(
            command, env=systems_python(), stdout=out, stderr=subprocess.STDOUT, check=False
        )
    if done.returncode:
        raise StackError(f"the build failed with exit code {done.returncode}, see {log}")
    return folder / "devel_isolated" / "setup.bash"


class Stack:
    """Master, emulated robot with a laser, map, localisation and move_base; a context manager.

    The environment of this process gets the master's address.
    """

    def __init__(self, robot: str, world: str, scene: World, setup: Path, folder: Path) -> None:
        self._folder = folder
        self._parts: List[Child] = []
        folder.mkdir(parents=True, exist_ok=True)
        self._setup = setup
        port = free_port()
        os.environ.update(
            ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", ROS_LOG_DIR=str(folder)
        )
        self._env = systems_python()
        self._port, self._robot, self._world, self._scene = port, robot, world, scene

    def __enter__(self) -> "Stack":
        try:
            self._start_all()
        except BaseException:
            self.close()
            raise
        return self

    def _start_all(self) -> None:
        master = self._start("master", "rosmaster", "--core", "-p", str(self._port))
        self._require(lambda: master_answers(self._env["ROS_MASTER_URI"]), master)
        name, file, start = f"ten_goals_{os.getpid()}", self._folder / "map.yaml", self._scene.start
        self._finish(sys.executable, str(ROOT / "ros1_bridge" / "nodes" / "save_map"), self._world, str(file))
        common = (f"robot:={self._robot}",)
        robot = self._start(
            "robot",
            *("roslaunch", "mrl_robots", "sim.launch", *common, f"world:={self._world}", f"name:={name}"),
            *(f"world_name:={name}", "laser:=true", "localise:=false"),
        )
        self._require(lambda: any("battery" in line for line in robot.output()), robot)
        place = (f"x:={start.x_m}", f"y:={start.y_m}", f"yaw:={start.yaw_rad}")
        self._start(
            "navigation", "roslaunch", "mrl_robots", "navigation.launch", *common, f"map:={file}", *place
        )

    def _start(self, name: str, *command: str) -> Child:
        """Start a program in a shell that has sourced the workspace."""
        shell = ("bash", "-c", '. "$0" && exec "$@"', str(self._setup), *command)
        self._parts.append(Child(name, shell, self._folder / f"{name}.log", self._env, ROOT))
        return self._parts[-1]

    def _finish(self, *command: str) -> None:
        done = subprocess.run(command, env=self._env, capture_output=True, text=True, check=False)
        if done.returncode:
            raise StackError(done.stderr.strip())

    def _require(self, condition: Any, part: Child) -> None:
        wait_until(lambda: condition() or part.exit_code is not None, START_S)
        if part.exit_code is not None or not condition():
            raise StackError(f"{part.name} did not start, see {part.log}: {part.last_words()}")

    def close(self) -> None:
        """End everything, the last started first."""
        for part in reversed(self._parts):
            part.signal(signal.SIGINT)
            part.finish(END_S)

    def __exit__(self, *_: Any) -> None:
        self.close()
