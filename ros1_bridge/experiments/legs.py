"""Lists the experiments that run through ROS, and runs one.  No rospy: each node is a process."""

import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import List

from mrl_driver.errors import MrlError
from ros1_bridge.demo.processes import Child, wait_until
from sim_arduino.experiments import experiment_report
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting

from .experiment_processes import ROOT, end, environment

NODES = {
    "square": ("one_robot_node", "lap"),
    "sonar-calibration": ("one_robot_node", "approach"),
    "l-course": ("one_robot_node", "drive"),
    "step-test": ("team_node", "drive_steps"),
    "mixed-team": ("team_node", "wander_team"),
    "shared-waypoint": ("team_node", "share_waypoint"),
    "patrol": ("team_node", "patrol_team"),
    "turnaround": ("turnaround_node", "measure"),
}
"""Experiments by name; module and function of the part that runs through ROS, whose result the experiment gets."""
NEEDED = ("rospy", "tf2_ros", "actionlib", "move_base_msgs", "nav_msgs", "sensor_msgs")
REMEDY = "install ROS Noetic, or Debian's ros-base, python3-tf2-ros and python3-move-base-msgs"
MOST_S = 1800.0


def missing() -> str:
    """Which parts of ROS are missing, and how to install them; empty if ROS is complete."""
    absent = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if not absent and shutil.which("rosmaster") is None:
        absent = ["rosmaster"]
    return f"ROS is missing here ({', '.join(absent)}); {REMEDY}" if absent else ""


def run(name: str, setting: Setting) -> Result:
    """Runs an experiment through ROS, its picture in the setting's folder; MrlError has its last line if it fails."""
    with tempfile.TemporaryDirectory(prefix="mrl-experiment-") as folder:
        given = {**os.environ, "PYTHONUNBUFFERED": "1"}
        log, own = Path(folder) / "log", environment(folder, given)
        child = Child(name, _command(name, setting), log, own, ROOT)
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
