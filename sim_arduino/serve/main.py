"""`mrl-sim`, and `sim_board` of the launch files: emulated robots on virtual serial ports.

It needs no command line library, as that of ROS Noetic is too old.
"""

import argparse
import os
import re
import shlex
import sys
from contextlib import ExitStack, closing
from functools import partial
from typing import Any, Callable, List, NoReturn, Optional, Sequence, TextIO, Tuple

from mrl_driver import figures, program
from mrl_driver.errors import ConfigError, MrlError, SimulatorError, shortages
from mrl_driver.host.firmware_images import VIRTUAL
from mrl_driver.robot.models import ENVIRONMENT
from sim_arduino.faults import fault_table, key_values

from . import factory
from .control import ORDERS, Control
from .pty import PtyPort, SymbolicLink
from .server import PtyServer, Waker, Watcher, on_signals, serve_together
from .socket_port import BoardPort, SocketPort

_OPTIONS = factory.Options._fields
EMULATED = "sim"  # in the ports of a team: this robot is emulated
_TEXT = """Serve an emulated robot on a virtual serial port.

Prints the path of the port when the robot is ready.  Runs until Ctrl-C; while a program has the port open, up to 1 s
longer.  With several names, all robots are in one world and process: each prints its name and path, and {name} in
--link, --truth and --log stands for its name.

examples:
  mrl-sim --link /tmp/robot
  mrl-sim --robot stingbot --world square --view
  mrl-sim --fault loss:rate=0.01 --truth truth.jsonl
  mrl-sim --name one --name two --pose 0,0,0 --pose 1,1,90 --link /tmp/{name}
"""


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Serves robots with these arguments, or those of the program; an error is one line, and its exit code."""
    try:
        with shortages("the emulator cannot go on", SimulatorError), ExitStack() as stack:
            port = parser().parse_args(arguments)
            if port.version:
                sys.stdout.write(f"mrl-sim, version {program.version()}\n")
                return
            _require_single(port)
            if port.plot:
                figures.require_writable(port.plot)
            robots = _robots(port)
            for robot in robots:
                stack.callback(robot.close)
            _serve(stack, robots, port)
    except MrlError as error:
        _print_message(error.line)
        sys.exit(error.exit_code)
    except OSError as error:
        _print_message(f"{error}; the last lines of the log are lost")
        sys.exit(SimulatorError.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)


# ---- options


class _Parser(argparse.ArgumentParser):
    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._negative_number_matcher = re.compile(r"-[\d.]")  # so that a pose may begin with a minus

    def error(self, message: str) -> NoReturn:
        raise ConfigError(f"{message}; see: {self.prog} --help")


def parser() -> argparse.ArgumentParser:
    """The options; those of `factory.Options` that are not given are left out."""
    parts = {
        "keys of --error": "\n".join(key.line for key in key_values.ROBOT_KEYS),
        "keys of --sonar": "\n".join(key.line for key in key_values.SONAR_KEYS),
        "faults, such as --fault loss:rate=0.01,at=5 (keys with their defaults)": fault_table.usage(),
        "orders of --control": "\n".join(f"{order:18}{text}" for order, text in ORDERS),
    }
    made = _Parser(
        "mrl-sim",
        description=_TEXT,
        epilog="\n\n".join(f"{title}:\n{text}".replace("\n", "\n  ") for title, text in parts.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("--version", action="store_true", help="show the version")
    for title, add_to in (("robot", _add_robot), ("equipment and errors", _add_errors), ("port", _add_port)):
        add_to(made.add_argument_group(title).add_argument)
    return made


def _add_robot(add: Callable[..., Any]) -> None:
    given = partial(add, default=argparse.SUPPRESS)
    given("--robot", metavar="NAME|FILE", help="robot model; default: traxbot, or for --build virtual duo")
    given("--id", dest="robot_id", type=int, metavar="ID", help="robot id; default: the model's first")
    given(
        "--engine", choices=factory.ENGINES, help="emulated board (default), or firmware on a simulated chip"
    )
    given("--profile", choices=factory.PROFILES, help="firmware to emulate; default: current")
    given("--environment", action="store_true", help="emulate the build with environment sensors")
    given(
        "--build",
        choices=(VIRTUAL,),
        help="serve a bare board, which calculates its robot: the image on a chip",
    )
    given("--elf", metavar="FILE", help="firmware binary for --engine avr")
    given("--omni", action="store_true", help="emulate a base with three omnidirectional wheels")
    given("--world", metavar="NAME|FILE", help="world or map_server map around the robot; default: room")
    given("--world-name", metavar="NAME", help="share the world with all boards that give the same name")
    again = partial(add, action="append", default=[])
    again(
        "--name",
        dest="names",
        metavar="NAME",
        help="the robot's name in the world; repeat it for several robots",
    )
    again(
        "--pose",
        dest="poses",
        metavar="X,Y,YAW",
        help="its start [m, m, deg]; repeat it in the order of the names",
    )
    add(
        "--team",
        metavar="PORTS",
        help="serve robot1, robot2, ... where these ports are sim; --robot is a list",
    )
    add("--builds", default="", metavar="LIST", help="with --team, builds of the robots")


def _add_errors(add: Callable[..., Any]) -> None:
    given = partial(add, default=argparse.SUPPRESS)
    given("--imu", action="store_true", help="fit an MPU-6050, where the model's section imu says")
    given(
        "--imu-seed",
        type=int,
        metavar="N",
        help="seed of its errors, as in its data sheet; 0 (default): none",
    )
    given(
        "--radio",
        nargs="?",
        const=factory.OWN_ADDRESS,
        metavar="ADDRESS",
        help="fit an XBee with this 64-bit address in hexadecimal, or one made of the robot's name",
    )
    given("--radio-range", type=float, metavar="M", help="distance at which two radios receive each other")
    given("--radio-loss", type=float, metavar="SHARE", help="share of the packets that it does not receive")
    given(
        "--wiring",
        type=int,
        metavar="SUM",
        help="how motors and encoders of a robot with an H-bridge are connected, a sum of rows of the wiring table in "
        "PROTOCOL.md; the board does not know it",
    )
    given("--battery", type=float, metavar="V", help="battery voltage at the start")
    given("--slip", action="store_true", help="let the tracks slip in turns")
    given("--error", metavar="KEYS|FILE", help="deviations of the robot from its model, see below")
    given("--sonar", metavar="KEYS|FILE", help="errors of the sonars, see below")
    given("--footprint", metavar="box|none|circle:R", help="outline for collisions; default: box")
    text = "inject a fault, see below; may be repeated"
    add("--fault", dest="faults", action="append", default=[], metavar="FAULT", help=text)
    given("--seed", type=int, help="seed of faults, sonar errors, and the initial RAM of the simulated chip")


def _add_port(add: Callable[..., Any]) -> None:
    add("--link", metavar="NAME", help="make a symbolic link to the port, and remove it at the end")
    add(
        "--listen",
        metavar="URL",
        help="instead, serve one client on tcp://ADDRESS:PORT or udp://ADDRESS:PORT; 127.0.0.1 accepts only this "
        "computer",
    )
    add("--speed", type=float, default=1.0, help="factor over real time, 0.01 to 1000; default: 1")
    add("--truth", metavar="FILE", help="append the true pose as JSON lines, 20 per second")
    add("--log", metavar="FILE", help="append all bytes of both directions as JSON lines")
    add(
        "--reset-on-open", action="store_true", help="reset the board when its port is opened, as an Uno does"
    )
    add("--control", action="store_true", help="read orders from stdin, one per line, see below")
    add("--plot", metavar="FILE", help="at the end, draw a map of the path; needs matplotlib")
    add("--view", action="store_true", help="show the robot live on the terminal (stderr)")


def _require_single(port: argparse.Namespace) -> None:
    """Refuses options that do not fit the number of robots."""
    if len(port.poses) > max(1, len(port.names)):
        raise ConfigError(f"--pose is given {len(port.poses)} times, expected at most once for each --name")
    if not _several(port):
        return
    for option in ("listen", "control", "plot", "view"):
        if getattr(port, option):
            raise ConfigError(f"--{option} is given for a team, expected one --name with it")
    for option in ("link", "truth", "log"):
        text = getattr(port, option)
        if text is not None and "{name}" not in text:
            raise ConfigError(f"--{option} is {text!r}, expected {{name}} in it: each robot needs its own")


def _several(port: argparse.Namespace) -> bool:
    return port.team is not None or len(port.names) > 1


# ---- robots


def _robots(port: argparse.Namespace) -> List[factory.Emulated]:
    options = factory.Options(**{name: each for name, each in vars(port).items() if name in _OPTIONS})
    if port.team is not None:
        return factory.make_all(*emulated(port.team, options, port.builds))
    return factory.make_team(options, port.names, port.poses)


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


# ---- serving


def _serve(stack: ExitStack, robots: List[factory.Emulated], port: argparse.Namespace) -> None:
    """Serves robots; if one of several fails, it says so, the others run on, and its error is raised at the end."""
    waker = Waker()
    stack.callback(waker.close)
    served = {}
    for robot in robots:
        its = stack.enter_context(ExitStack())
        server, announce = _server(its, robot, port, waker)
        served[server] = robot.plant.name, its, announce

    def failed(server: PtyServer, error: Exception) -> None:
        name, its, _ = served[server]
        its.close()
        if _several(port):
            _print_message(f"robot {name}: {error}; it has no port any more")

    on_signals([server.end for server in served])
    for _, _, announce in served.values():
        announce()
    errors = serve_together(list(served), waker, failed)
    if errors:
        raise errors[0]


def _server(
    stack: ExitStack, robot: factory.Emulated, given: argparse.Namespace, waker: Waker
) -> Tuple[PtyServer, Callable[[], None]]:
    """The server of a robot, and a function that announces its port."""
    link, truth, log = (
        file and file.replace("{name}", robot.plant.name) for file in (given.link, given.truth, given.log)
    )
    if link and given.listen:
        raise ConfigError(
            "--link is given with --listen, expected one of them: a network address has no file"
        )
    port: BoardPort = SocketPort(given.listen) if given.listen else PtyPort()
    stack.callback(port.close)
    files = _open(stack, "--truth", truth), _open(stack, "--log", log)
    announce = _announcer(stack, robot.plant.name if _several(given) else "", link, given.listen)
    orders = sys.stdin.fileno() if given.control else None
    watched = given.control or robot.has_faults
    attendant = Control(robot.board, orders, announce, _print_message) if watched else None
    server = PtyServer(
        robot.board if attendant else robot.engine,
        port,
        robot.plant,
        *files,
        given.reset_on_open,
        attendant,
        speed=given.speed,
        watchers=_watchers(stack, robot, given.plot, given.view),
        waker=waker,
    )
    return server, partial(announce, port.path)


def _watchers(stack: ExitStack, robot: factory.Emulated, plot: Optional[str], view: bool) -> List[Watcher]:
    """The watchers that draw, if any."""
    if not plot and not view:
        return []
    from sim_arduino.view.world_view import PlantTrail, WorldView, draw_picture

    trail = PlantTrail(robot.plant)
    watchers: List[Watcher] = [trail]
    if plot:
        stack.callback(draw_picture, trail, plot)
    if view:
        watchers.append(stack.enter_context(closing(WorldView(trail))))
    return watchers


def _announcer(
    stack: ExitStack, name: str, link: Optional[str], listen: Optional[str]
) -> Callable[[str], None]:
    """A function that prints the path of each plugged-in port, after the robot's name, and points the link to it."""
    symbolic = SymbolicLink(link) if link else None
    if symbolic:
        stack.callback(symbolic.remove)

    def announce(path: str) -> None:
        if symbolic:
            symbolic.move(path)
        if path:
            sys.stdout.write(f"{name} {path}\n".lstrip())
            sys.stdout.flush()
        if path and _in_foreground():
            shown = link or path
            place = "" if listen or shown.startswith("/") else ", in this folder"
            _print_message(
                f"Ctrl-C ends it; drive it from another terminal{place}: mrl drive --port {shlex.quote(shown)}"
            )
        if path and listen:
            _print_message(f"listening on {path}; everybody who can reach this address can drive the robot")

    return announce


def _in_foreground() -> bool:
    """Whether Ctrl-C at the terminal ends this program.  Not below roslaunch, whose nodes drive the robot."""
    try:
        return os.tcgetpgrp(sys.stderr.fileno()) == os.getpgrp()
    except OSError:  # no terminal, or that of another session
        return False


def _print_message(text: str) -> None:
    sys.stderr.write(f"mrl-sim: {' '.join(text.split())}\n")


def _open(stack: ExitStack, option: str, path: Optional[str]) -> Optional[TextIO]:
    if path is None:
        return None
    try:
        return stack.enter_context(open(path, "a", encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{option} {path} cannot be written: {error.strerror}; give another file") from None


if __name__ == "__main__":
    main()
