"""What the nodes of the experiments have in common: a master, the play, the result, an orderly end."""

import os
import signal
import sys
from typing import Any, Callable, Sequence

from mrl_driver.errors import MrlError
from sim_arduino.experiments import report
from sim_arduino.experiments.report import Result
from sim_arduino.experiments.stage import Setting

from .parts import Parts

TERMINATED = 143
Play = Callable[[str, Parts, Setting], Result]


def play_as_node(ros: Any, play: Play, arguments: Sequence[str]) -> int:
    """Starts the master, makes this process a node, plays, and saves the result beside the logs; the exit code.

    Args:
        ros: rospy.
        arguments: Name of the experiment, folder of the pictures, robot model, seed.
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
            report.save(result, str(parts.folder))
    except MrlError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0
