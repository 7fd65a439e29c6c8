"""Runs a node, from waiting for the master to its exit code.  For nodes."""

import io
import signal
import sys
import threading
from typing import Any, Callable, List, Optional

import rosgraph
import rospy

from mrl_driver.errors import MrlError

from .master_watch import await_master


def run_node(name: str, run: Callable[[], Optional[int]], argv: Optional[List[str]] = None) -> int:
    """Start the node `name` and call `run`; returns the exit code.

    It is what `run` returns, 0 for None; or that of the error if `run` raises one.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # Python writes a file, as under roslaunch, in blocks
    try:
        await_master(rosgraph.get_master_uri(), rospy.logwarn)
        rospy.init_node(name, argv=argv or sys.argv, disable_signals=True)
        _end_on_signals()
        return run() or 0
    except rospy.ROSException:  # the shutdown has closed a publisher or a service meanwhile
        if not rospy.is_shutdown():
            raise
    except MrlError as error:
        if not rospy.is_shutdown():
            rospy.logfatal(error.line)
            return error.exit_code
    return 0


def _end_on_signals() -> None:
    """Shut down from another thread.

    rospy's own handler runs in the main thread, which may hold locks that the shutdown needs: the handler would wait
    forever if the signal came during a call to the master.
    """

    def end(number: int, _frame: Any) -> None:
        threading.Thread(target=rospy.signal_shutdown, args=(f"signal {number}",)).start()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # as nohup sets it
            signal.signal(number, end)
