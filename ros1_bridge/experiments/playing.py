"""Runs an experiment as a node: starts a master, runs the experiment, saves the result, and ends all programs."""

import os
import signal
import sys
from typing import Any, Callable, Sequence

from mrl_driver.errors import MrlError
from sim_arduino.experiments import experiment_report
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting

from .experiment_processes import Parts

TERMINATED = 143
Play = Callable[[str, Parts, Setting], Result]


def play_as_node(ros: Any, play: Play, arguments: Sequence[str]) -> int:
    """Starts the master, makes this process a node, runs `play`, and saves the result next to the logs.

    Args:
        ros: The module rospy.
        play: The experiment.
        arguments: Name of the experiment, folder of the pictures, robot model, seed.

    Returns:
        The exit code.
    """
    name, folder, robot, seed = arguments
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        with Parts(os.environ["ROS_HOME"]) as parts:
            parts.master()
            ros.init_node("experiment", disable_signals=True)
            try:
                result = play(name, parts, Setting(folder, None, robot, int(seed), True))
            finally:
                ros.signal_shutdown("the experiment is over")
            experiment_report.save(result, str(parts.folder))
    except MrlError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0
