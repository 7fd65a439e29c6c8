"""Runs an experiment as a node: starts a master, runs the experiment, saves the result, and ends all programs."""

import importlib
import os
import signal
import sys
from typing import Sequence

import rospy

from mrl_driver.errors import MrlError
from sim_arduino.experiments import experiment_report
from sim_arduino.experiments.cli import EXPERIMENTS
from sim_arduino.experiments.experiment_robot import Setting

from .legs import NODES, Parts

TERMINATED = 143


def main(arguments: Sequence[str]) -> int:
    """Runs the part through ROS, then the experiment in simulated time; returns the exit code.

    The arguments are the name of the experiment, folder of the pictures, robot model, seed and number of seeds.
    """
    name, folder, robot, seed, seeds = arguments
    setting = Setting(folder, None, robot, int(seed), True, int(seeds))
    node, function = NODES[name]
    through_ros = getattr(importlib.import_module(f"{__package__}.{node}"), function)
    experiment = importlib.import_module(f"sim_arduino.experiments.{EXPERIMENTS[name].module}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        with Parts(os.environ["ROS_HOME"]) as parts:
            parts.master()
            rospy.init_node("experiment", disable_signals=True)
            try:
                live = through_ros(parts, setting)
                parts.close()
                result = experiment.run(setting, live)
            finally:
                rospy.signal_shutdown("the experiment is over")
            experiment_report.save(result, str(parts.folder))
    except MrlError as error:
        sys.stderr.write(f"{error.line}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
