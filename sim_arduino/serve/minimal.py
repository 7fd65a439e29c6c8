"""Serves emulated robots on virtual serial ports; sim.launch and team.launch start it.

It has the options that a launch file needs, and needs no command line library.  `mrl-sim` has all options.
"""

import argparse
import math
import signal
import sys
from contextlib import ExitStack
from typing import Any, List, NamedTuple, Sequence

from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.robot.models import ENVIRONMENT

from . import factory
from .pty import PtyPort, SymbolicLink
from .server import PtyServer, Waker, serve_together

CLOSE_WAIT_S, CHECK_S = 1.0, 0.02
"""Time that a board waits at its end for the host to close the port [s], and period of the check [s].

roslaunch ends both at the same time; without the wait, the host would report a lost link.
"""
EMULATED = "sim"
"""In the ports of a team: this robot is emulated."""
_TEXTS = (
    (
        "robot",
        "traxbot",
        "model, or path of a robot's .yaml; of a team a list, the last one also for all further",
    ),
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


class Team(NamedTuple):
    """Which robots of a team are emulated: robot1, robot2 and so on, by the ports of all robots."""

    names: List[str]
    places: List[int]
    options: List[factory.Options]

    @classmethod
    def of(cls, ports: str, options: factory.Options, builds: str = "") -> "Team":
        """The robots whose port is `sim`; model and build of each are in lists, whose last one is for all further."""
        places = [i for i, port in enumerate(ports.split(",")) if port == EMULATED]
        if not places:
            raise ConfigError(f"no port of {ports!r} is {EMULATED}, expected one for each emulated robot")
        names = [f"robot{i + 1}" for i in places]
        own = [
            factory.numbered(options, place, name)._replace(
                robot=_nth(options.robot, place),
                environment=options.environment or _nth(builds, place) == ENVIRONMENT,
            )
            for name, place in zip(names, places)
        ]
        return cls(names, places, own)


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
        _end_on_signals(servers, ends)
        for link, port in zip(links, ports):
            _announce(stack, link, port.path)
        errors: List[Exception] = []

        def failed(server: PtyServer, error: Exception) -> None:
            sys.stderr.write(f"sim_board: {links[servers.index(server)]}: {error}; its board has stopped\n")
            errors.append(error)

        serve_together(servers, waker, failed)
        if errors:
            raise errors[0]


def _end_on_signals(servers: Sequence[PtyServer], ends: Sequence[Shutdown]) -> None:
    def end_all(*_: Any) -> None:
        for server, end in zip(servers, ends):
            end.end(server)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end_all)


def _announce(stack: ExitStack, link: str, path: str) -> None:
    """Make the link, and print where the port is."""
    name = SymbolicLink(link)
    stack.callback(name.remove)
    name.move(path)
    sys.stdout.write(f"{path} as {link}\n")
    sys.stdout.flush()


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
    parser.add_argument("--team", metavar="PORTS", help="serve robot1, robot2, ... where these ports are sim")
    parser.add_argument("--builds", default="", help="builds of a team's robots, separated by commas")
    given = vars(parser.parse_args(arguments))
    link, ports, builds = (given.pop(name) for name in ("link", "team", "builds"))
    options = factory.Options(**given)
    try:
        if ports is None:
            serve([factory.make(options)], [link])
        else:
            team = Team.of(ports, options, builds)
            links = [link.replace("{name}", name) for name in team.names]
            serve(factory.make_all(team.options, team.places), links)
    except MrlError as error:
        sys.stderr.write(f"sim_board: {error}\n")
        return error.exit_code
    return 0
