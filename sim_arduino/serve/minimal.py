"""Serves emulated robots on virtual serial ports; sim.launch and team.launch start it.

It has the options that a launch file needs, and needs no command line library.  `mrl-sim` has all options.
"""

import argparse
import math
import sys
from contextlib import ExitStack
from functools import partial
from typing import Any, List, Sequence, Tuple

from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.robot.models import ENVIRONMENT

from . import factory
from .pty import PtyPort, SymbolicLink
from .server import PtyServer, Waker, on_signals, serve_together

CLOSE_WAIT_S, CHECK_S = 1.0, 0.02
"""Time that a board waits at its end for the host to close the port [s], and period of the check [s].

roslaunch ends both at the same time; without the wait, the host would report a lost link."""
EMULATED = "sim"  # in the ports of a team: this robot is emulated


class Shutdown:
    """A watcher that ends the server after a signal, when the host closes the port or the timeout expires."""

    def __init__(self, port: PtyPort) -> None:
        self.due_s = math.inf  # time of the next look, in the board's time [s]
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


def emulated(
    ports: str, options: factory.Options, builds: str = ""
) -> Tuple[List[factory.Options], List[int]]:
    """Options and places of a team's robots whose port is `sim`; robot1 has place 0.

    Model and build of each are in lists, whose last one is for all further.
    """
    places = [i for i, port in enumerate(ports.split(",")) if port == EMULATED]
    if not places:
        raise ConfigError(f"no port of {ports!r} is {EMULATED}, expected one for each emulated robot")
    team = [
        factory.numbered(options, place, f"robot{place + 1}")._replace(
            robot=_nth(options.robot, place),
            environment=options.environment or _nth(builds, place) == ENVIRONMENT,
        )
        for place in places
    ]
    return team, places


def _nth(listed: str, place: int) -> str:
    parts = listed.split(",")
    return parts[min(place, len(parts) - 1)]


def serve(robots: Sequence[factory.Emulated], links: Sequence[str]) -> None:
    """Serve robots until a signal ends them; each link is a symbolic link to the port of its robot.

    Raises:
        MrlError: a link cannot be made.
        Exception: the error of the first board that failed; the others run on until the end.
    """
    with ExitStack() as stack:
        for robot in robots:
            stack.callback(robot.close)
        waker = Waker()
        stack.callback(waker.close)
        ports = [PtyPort() for _ in robots]
        for port in ports:
            stack.callback(port.close)
        ends = [Shutdown(port) for port in ports]
        servers = [
            PtyServer(robot.engine, port, robot.plant, watchers=[end], waker=waker)
            for robot, port, end in zip(robots, ports, ends)
        ]
        on_signals([partial(end.end, server) for server, end in zip(servers, ends)])
        for link, port in zip(links, ports):
            _announce(stack, link, port.path)

        def failed(server: PtyServer, error: Exception) -> None:
            sys.stderr.write(f"sim_board: {links[servers.index(server)]}: {error}; its board has stopped\n")

        errors = serve_together(servers, waker, failed)
        if errors:
            raise errors[0]


def _announce(stack: ExitStack, link: str, path: str) -> None:
    """Make the link, and print where the port is."""
    name = SymbolicLink(link)
    stack.callback(name.remove)
    name.move(path)
    sys.stdout.write(f"{path} as {link}\n")
    sys.stdout.flush()


def _parser() -> argparse.ArgumentParser:
    """What is not given is left out, so that the defaults are those of `factory.Options`."""
    parser = argparse.ArgumentParser(
        prog="sim_board",
        description=(__doc__ or "").splitlines()[0],
        argument_default=argparse.SUPPRESS,
    )
    add = parser.add_argument
    add("--link", required=True, help="name of the virtual serial port")
    add(
        "--robot",
        help="model, or path of a robot's .yaml; of a team a list, the last one also for all further",
    )
    add("--engine", help="python, or avr: the firmware binary on a simulated chip")
    add("--profile", help="current, 2013-august or 2013-january")
    add("--world", help="world by name, or path of a .yaml")
    add("--world-name", help="share the world with all boards that give the same name")
    add("--name", help="the robot's name in the world")
    add("--pose", help="start as X,Y,YAW in metres and degrees")
    add("--environment", action="store_true", help="the build with environment sensors")
    add("--imu", action="store_true", help="fit an IMU")
    add("--imu-seed", type=int, help="seed of the IMU's errors; 0: none")
    add("--radio", nargs="?", const=factory.OWN_ADDRESS, help="fit an XBee, perhaps with this address")
    add("--radio-range", type=float, help="range of the radio [m]")
    add("--radio-loss", type=float, help="share of the radio packets that are lost")
    add("--team", metavar="PORTS", help="serve robot1, robot2, ... where these ports are sim")
    add("--builds", default="", help="builds of a team's robots, separated by commas")
    return parser


def main(arguments: Sequence[str]) -> int:
    """Serve a robot with these arguments; returns the exit code, which is that of the error if there was one."""
    given = vars(_parser().parse_args(arguments))
    link, ports, builds = given.pop("link"), given.pop("team", None), given.pop("builds")
    options = factory.Options(**given)
    try:
        if ports is None:
            serve([factory.make(options)], [link])
        else:
            team, places = emulated(ports, options, builds)
            links = [link.replace("{name}", str(each.name)) for each in team]
            serve(factory.make_all(team, places), links)
    except MrlError as error:
        sys.stderr.write(f"sim_board: {error}\n")
        return error.exit_code
    return 0
