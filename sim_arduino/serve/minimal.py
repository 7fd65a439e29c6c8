"""Serves an emulated robot on a virtual serial port; sim.launch starts it.

It has the options that a launch file needs, and needs no command line library.  `mrl-sim` has all options.
"""

import argparse
import math
import signal
import sys
from contextlib import ExitStack
from typing import Any, Sequence

from mrl_driver.errors import MrlError

from . import factory
from .pty import PtyPort, SymbolicLink
from .server import PtyServer

CLOSE_WAIT_S, CHECK_S = 1.0, 0.02
"""Time that a board waits at its end for the host to close the port [s], and period of the check [s].

roslaunch ends both at the same time; without the wait, the host would report a lost link.
"""
_TEXTS = (
    ("robot", "traxbot", "model, or path of a robot's .yaml"),
    ("engine", "python", "python, or avr: the firmware binary on a simulated chip"),
    ("profile", "current", "current, 2013-august or 2013-january"),
    ("world", "room", "world by name, or path of a .yaml"),
    ("world_name", None, "share the world with all boards that give the same name"),
    ("name", None, "the robot's name in the world"),
    ("pose", None, "start as X,Y,YAW in metres and degrees"),
)


class Shutdown:
    """A watcher that ends the server after a signal, when the host closes the port or the timeout expires.

    Attributes:
        due_s: Time of the next look, in the board's time [s].
    """

    def __init__(self, port: PtyPort) -> None:
        self.due_s = math.inf
        self._port, self._until_s = port, math.inf
        self._server: Any = None

    def end(self, server: PtyServer) -> None:
        """Start to end the server, or end it at once at the second signal; safe in a signal handler."""
        if self._server is not None:
            server.stop()
        self._server, self.due_s = server, 0.0
        server.wake()

    def look(self, now_s: float) -> None:
        """Ends the server, or schedules the next look."""
        self._until_s = min(self._until_s, now_s + CLOSE_WAIT_S)
        self.due_s = now_s + CHECK_S
        if now_s >= self._until_s or not self._port.is_open:
            self._server.stop()


def serve(options: factory.Options, link: str) -> None:
    """Serve a robot until a signal ends it; `link` is a symbolic link to the port.

    Raises:
        MrlError: an option is wrong, or the link cannot be made.
    """
    with ExitStack() as stack:
        robot = factory.make(options)
        stack.callback(robot.close)
        port = PtyPort()
        stack.callback(port.close)
        shutdown = Shutdown(port)
        server = PtyServer(robot.engine, port, robot.plant, watchers=[shutdown])
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: shutdown.end(server))
        name = SymbolicLink(link)
        stack.callback(name.remove)
        name.move(port.path)
        sys.stdout.write(f"{port.path} as {link}\n")
        sys.stdout.flush()
        server.run()


def main(arguments: Sequence[str]) -> int:
    """Serve a robot with these arguments; returns the exit code, which is that of the error if there was one."""
    parser = argparse.ArgumentParser(prog="sim_board", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--link", required=True, help="name of the virtual serial port")
    for name, default, text in _TEXTS:
        parser.add_argument(f"--{name.replace('_', '-')}", default=default, help=text)
    parser.add_argument("--environment", action="store_true", help="the build with environment sensors")
    parser.add_argument("--imu", action="store_true", help="fit an IMU")
    parser.add_argument("--imu-seed", type=int, default=0, help="seed of the IMU's errors; 0: none")
    parser.add_argument(
        "--radio", nargs="?", const=factory.OWN_ADDRESS, help="fit an XBee, perhaps with this address"
    )
    parser.add_argument("--radio-range", type=float, default=math.inf, help="range of the radio [m]")
    parser.add_argument(
        "--radio-loss", type=float, default=0.0, help="share of the radio packets that are lost"
    )
    given = vars(parser.parse_args(arguments))
    link = given.pop("link")
    try:
        serve(factory.Options(**given), link)
    except MrlError as error:
        sys.stderr.write(f"sim_board: {error}\n")
        return error.exit_code
    return 0
