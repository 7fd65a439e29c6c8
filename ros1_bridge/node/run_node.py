"""Runs a node, from waiting for the master to its exit code.  For nodes."""

import io
import os
import sys
import threading
from typing import Any, Callable, Optional, Sequence, Union

import rosgraph
import rospy
from rospy.impl.registration import get_registration_listeners

from mrl_driver.clocks import later, wait_until
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.program import handle_end_signals

from .master_watch import await_master
from .parameters import Row, read, usage

RESPAWN = "MRL_RESPAWN"
"""Variable of the environment: true if roslaunch starts the node again when it ends."""
RETRY_S = 30.0  # An address of this computer may be there then, as behind Wi-Fi
CLOCK_S = 5.0  # A simulation that starts together with the node publishes /clock within this time


def node(
    name: str,
    parameters: Union[Sequence[Row], Callable[[Any, str], Any]],
    run: Callable[[Any], Optional[int]],
    rows: Sequence[Row] = (),
) -> Callable[[], int]:
    """The `main` of a node: it returns the exit code.

    That is what `run` returns, 0 for None; or that of the error if it raises one.  `run` gets the checked private
    parameters, by their rows or by what checks the contents of a namespace; `rows` are for `--help` then.

    A node that roslaunch would start again at once, and most often in vain, first waits `RETRY_S` after a ConfigError.
    roslaunch does not say that it would, so launch files with `respawn` set `RESPAWN`.
    """
    return lambda: _run_node(name, parameters, run, rows)


def _run_node(name: str, parameters: Any, run: Callable[[Any], Optional[int]], rows: Sequence[Row]) -> int:
    if {"-h", "--help"}.intersection(sys.argv[1:]):
        about = sys.modules[run.__module__].__doc__ or ""
        sys.stdout.write(usage(name, about, rows if callable(parameters) else parameters))
        return 0
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # Python writes a file, as under roslaunch, in blocks
    try:
        await_master(rosgraph.get_master_uri(), rospy.logwarn)
        rospy.init_node(name, disable_signals=True)
        if not rospy.rostime.is_wallclock():
            later(CLOCK_S, _tell_missing_clock)
        # A node that has taken this one's name ends it, and would be ended by what this one registers after that.
        # What it unregisters, it still reports.
        rospy.on_shutdown(lambda: setattr(get_registration_listeners(), "notify_added", lambda *_: None))
        _end_on_signals()
        space = rospy.get_name()
        found = rospy.get_param(space, {})
        given = found if isinstance(found, dict) else {}
        return run(parameters(given, space) if callable(parameters) else read(parameters, given, space)) or 0
    except rospy.ROSException:  # the shutdown has closed a publisher or a service meanwhile
        if not rospy.is_shutdown():
            raise
    except MrlError as error:
        if not rospy.is_shutdown():
            waits = isinstance(error, ConfigError) and os.environ.get(RESPAWN) == "true"
            rospy.logfatal(f"{error.line}; it is tried again in {RETRY_S:g} s" if waits else error.line)
            if waits:
                wait_until(rospy.is_shutdown, RETRY_S)
            return error.exit_code
    return 0


def _tell_missing_clock() -> None:
    if not rospy.get_time():
        rospy.logwarn(
            "use_sim_time is true, and nobody publishes /clock: the time stands at 0, and nodes refuse such stamps; "
            "start what publishes it, or for a real robot run: rosparam set use_sim_time false, and start all nodes "
            "again"
        )


def _end_on_signals() -> None:
    """Shut down from another thread.

    rospy's own handler runs in the main thread, which may hold locks that the shutdown needs: the handler would wait
    forever if the signal came during a call to the master.
    """

    def end(number: int, _frame: Any) -> None:
        threading.Thread(target=rospy.signal_shutdown, args=(f"signal {number}",)).start()

    handle_end_signals(end, even_ignored=True)
