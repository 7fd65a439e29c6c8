"""Runs a node, from waiting for the master to its exit code.  For nodes."""

import io
import sys
from typing import Callable, List, Optional

import rosgraph
import rospy

from mrl_driver.errors import MrlError

from .master_watch import await_master


def run_node(name: str, run: Callable[[], Optional[int]], argv: Optional[List[str]] = None) -> int:
    """Start the node `name` and call `run`; returns the exit code.

    It is what `run` returns, 0 for None; or that of the error if `run` raises one.
    """
    log_line_by_line()
    await_master(rosgraph.get_master_uri(), rospy.logwarn)
    rospy.init_node(name, argv=argv or sys.argv)
    try:
        return run() or 0
    except rospy.ROSInterruptException:
        return 0
    except MrlError as error:
        rospy.logfatal(str(error))
        return error.exit_code


def log_line_by_line() -> None:
    """Show rospy's log on stdout at once; Python writes it in blocks if stdout is a file, as under roslaunch."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)
