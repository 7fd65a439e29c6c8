"""Runs an experiment as a node: starts a master, runs the experiment, saves the result, and ends all programs."""

import importlib
import os
import signal
import sys
from typing import Sequence

import rospy

from mrl_driver.errors import MrlError
from sim_arduino.experiments import experiment_report
from sim_arduino.experiments.experiment_robot import Setting

from .experiment_processes import Parts

TERMINATED = 143


def main(arguments: Sequence[str]) -> int:
    """Starts the master, makes this process a node, runs the experiment, and saves the result next to the logs.

    Args:
        arguments: Module and name of the experiment, folder of the pictures, robot model, seed.

    Returns:
        The exit code.
    """
    node, name, folder, robot, seed = arguments
    module = importlib.import_module(f"{__package__}.{node}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        with Parts(os.environ["ROS_HOME"]) as parts:
            parts.master()
            rospy.init_node("experiment", disable_signals=True)
            try:
                result = module.play(name, parts, Setting(folder, None, robot, int(seed), True))
            finally:
                rospy.signal_shutdown("the experiment is over")
            experiment_report.save(result, str(parts.folder))
    except MrlError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
