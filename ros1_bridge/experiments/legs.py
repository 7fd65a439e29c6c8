"""The experiments that run through ROS, and their processes: master, emulated boards and nodes.  No rospy."""

import importlib.util
import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from typing import ContextManager, Dict, List

from mrl_driver.errors import MrlError
from ros1_bridge.node import processes
from ros1_bridge.node.processes import ROOT, Child, answers, free_port, wait_until
from sim_arduino.experiments import experiment_report
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting

NODES = {
    "square": ("one_robot_node", "lap"),
    "l-course": ("one_robot_node", "drive"),
    "step-test": ("team_node", "drive_steps"),
    "mixed-team": ("team_node", "wander_team"),
    "shared-waypoint": ("team_node", "share_waypoint"),
}
"""Experiments by name; module and function of the part that runs through ROS, whose result the experiment gets."""
NEEDED = ("rospy", "tf2_ros", "actionlib", "move_base_msgs", "nav_msgs", "sensor_msgs")
REMEDY = "install ROS Noetic, or Debian's ros-base, python3-tf2-ros and python3-move-base-msgs"
MOST_S = 1800.0
START_S = 300.0
"""A part that has not started after this time has failed; generous, because the machine may be slow or busy."""
END_S = 5.0


def missing() -> str:
    """Which parts of ROS are missing, and how to install them; empty if ROS is complete."""
    absent = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if not absent and shutil.which("rosmaster") is None:
        absent = ["rosmaster"]
    return f"ROS is missing here ({', '.join(absent)}); {REMEDY}" if absent else ""


def run(name: str, setting: Setting) -> Result:
    """Runs an experiment through ROS, its picture in the setting's folder; MrlError has its last line if it fails."""
    with tempfile.TemporaryDirectory(prefix="mrl-experiment-") as folder:
        child = Child(name, _command(name, setting), Path(folder) / "log", environment(folder), ROOT)
        try:
            wait_until(lambda: child.exit_code is not None, MOST_S)
        finally:
            end(child)
        result = experiment_report.read(folder, name)
        if result is None:
            lines = [line for line in child.output() if line.strip()]
            raise MrlError(f"experiment {name}: {lines[-1] if lines else f'exit code {child.exit_code}'}")
        return result


def _command(name: str, setting: Setting) -> List[str]:
    """The command line of the child; paths are absolute, as the child gets another folder for its files."""
    robot = os.path.abspath(setting.robot) if setting.robot.endswith((".yaml", ".yml")) else setting.robot
    words = (name, os.path.abspath(setting.folder), robot, str(setting.seed), str(setting.seeds))
    return [sys.executable, "-m", f"{__package__}.experiment_node", *words]


def environment(folder: str) -> Dict[str, str]:
    """The environment of a run with a master of its own; ROS and shared worlds write their files into the folder."""
    own = dict.fromkeys(("ROS_HOME", "ROS_LOG_DIR", "XDG_RUNTIME_DIR"), folder)
    return {**processes.environment(Path(folder), free_port()), **own}


def end(*children: Child) -> None:
    """Ask programs to end, and kill those that do not."""
    for child in children:
        child.signal(signal.SIGTERM)
    for child in children:
        child.finish(END_S)


class Parts(ContextManager["Parts"]):
    """The programs of an experiment, with their logs in a folder; at its end the nodes end first, the master last."""

    def __init__(self, folder: str) -> None:
        self.folder = Path(folder)
        self._nodes: List[Child] = []
        self._boards: List[Child] = []
        self._masters: List[Child] = []

    def _start(self, name: str, command: List[str], among: List[Child]) -> Child:
        """Starts a program with a log."""
        log = self.folder / f"{name.replace('/', '_')}.log"
        among.append(Child(name, command, log, dict(os.environ), ROOT))
        return among[-1]

    def master(self) -> None:
        """Starts the ROS master that the environment names, and waits for it; MrlError if it does not start."""
        uri = os.environ["ROS_MASTER_URI"]
        child = self._start("rosmaster", ["rosmaster", "--core", "-p", uri.rsplit(":", 1)[1]], self._masters)

        def is_there() -> bool:
            self.check()
            return answers(child, uri)

        if not wait_until(is_there, START_S):
            raise MrlError(f"no ROS master answers at {uri} after {START_S:g} s; is rosmaster sound?")

    def node(self, kind: str, space: str, *names: str, **parameters: object) -> Child:
        """Starts a node of this package by its executable, such as `robot_node`, in the namespace `space`.

        `names` are remappings, such as `sonar/front:=heard/front`, and `parameters` the private ones of the node.
        """
        given = [
            f"_{key}:={str(value).lower() if isinstance(value, bool) else value}"
            for key, value in parameters.items()
        ]
        node = str(ROOT / "ros1_bridge" / "nodes" / kind)
        command = [sys.executable, node, f"__ns:=/{space}", *names, *given]
        return self._start(f"{space}/{kind}", command, self._nodes)

    def robot(self, name: str, model: str, rate: int, *options: str) -> None:
        """Starts a board with options of `mrl-sim`, and its robot node in the robot's namespace and frames."""
        port = str(self.folder / f"{name}.port")
        command = [sys.executable, "-m", "sim_arduino.serve.main", "--link", port, "--name", name]
        self._start(f"{name}-board", [*command, "--robot", model, *options], self._boards)
        frames = {"odom_frame": f"{name}/odom", "base_frame": f"{name}/base_link"}
        self.node("robot_node", name, port=port, port_timeout=START_S, robot=model, rate=rate, **frames)

    def check(self) -> None:
        """Raises MrlError if a program has ended."""
        for child in self._masters + self._boards + self._nodes:
            if child.exit_code is not None:
                raise MrlError(child.last_words())

    def close(self) -> None:
        """Ends all programs: first the nodes, which stop their robots, then the boards, then the master."""
        for children in (self._nodes, self._boards, self._masters):
            end(*children)
            children.clear()

    def __exit__(self, *_: object) -> None:
        """Ends all programs."""
        self.close()
