"""`mrl-sim`: an emulated robot on a virtual serial port."""

import math
import shlex
import sys
from contextlib import ExitStack
from functools import partial
from typing import Any, Callable, List, NamedTuple, Optional, TextIO, Tuple

import click

from mrl_driver import figures
from mrl_driver.errors import ConfigError
from sim_arduino.faults import fault_table, key_values
from sim_arduino.view import world_picture
from sim_arduino.view.plant_trail import PlantTrail

from . import factory
from .control import ORDERS, Control
from .one_line import OneLine
from .pty import PtyPort, SymbolicLink
from .server import FASTEST, SLOWEST, PtyServer, Waker, Watcher, on_signals, serve_together
from .socket_port import BoardPort, SocketPort


def _indented(text: str) -> str:
    return "\n".join("  " + line for line in text.splitlines())


_EPILOG = "\b\nKeys of --error:\n{}\n\n\b\nKeys of --sonar:\n{}\n\n{}".format(
    _indented(key_values.usage(key_values.ROBOT_KEYS)),
    _indented(key_values.usage(key_values.SONAR_KEYS)),
    "\b\nFaults, such as --fault loss:rate=0.01,at=5 (keys with their defaults):\n{}\n\n\b\n"
    "Orders of --control:\n{}".format(
        _indented(fault_table.usage()),
        "\n".join(f"  {order:18}{text}" for order, text in ORDERS),
    ),
)


class _PortOptions(NamedTuple):
    """The options of a robot's port and files; `name` is set if there are several robots."""

    link: Optional[str]
    listen: Optional[str]
    truth: Optional[str]
    log: Optional[str]
    reset_on_open: bool
    control: bool
    speed: float
    plot: Optional[str]
    view: bool
    name: str = ""

    def of(self, name: str) -> "_PortOptions":
        """The options of the robot with this name."""
        link, truth, log = (
            file and file.replace("{name}", name) for file in (self.link, self.truth, self.log)
        )
        return self._replace(link=link, truth=truth, log=log, name=name)


@click.command(
    "mrl-sim", cls=OneLine, epilog=_EPILOG, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.option("--robot", default="traxbot", metavar="NAME|FILE", help="Robot model.", show_default=True)
@click.option("--id", "robot_id", type=click.IntRange(0, 32767), help="Robot id; default: the model's first.")
@click.option(
    "--engine",
    type=click.Choice(factory.ENGINES),
    default="python",
    show_default=True,
    help="Emulate the board in Python, or run the firmware binary on a simulated chip.",
)
@click.option(
    "--profile",
    type=click.Choice(factory.PROFILES),
    default="current",
    show_default=True,
    help="Firmware to emulate.",
)
@click.option("--environment", is_flag=True, help="Emulate the build with environment sensors.")
@click.option("--elf", type=click.Path(dir_okay=False), help="Firmware binary for --engine avr.")
@click.option("--link", metavar="NAME", help="Make a symbolic link to the port, and remove it at the end.")
@click.option(
    "--listen",
    metavar="URL",
    help="Instead, serve one client on tcp://ADDRESS:PORT or udp://ADDRESS:PORT; 127.0.0.1 accepts only this computer.",
)
@click.option(
    "--world",
    default="room",
    metavar="NAME|FILE",
    show_default=True,
    help="World around the robot: a packaged world, a world file, or a map of map_server.",
)
@click.option(
    "--pose",
    "poses",
    multiple=True,
    metavar="X,Y,YAW",
    help="Start pose in metres and degrees; default: the robot's or the start of the world.",
)
@click.option("--world-name", metavar="NAME", help="Share the world with all boards that give the same name.")
@click.option(
    "--name",
    "names",
    multiple=True,
    metavar="NAME",
    help="The robot's name in the world; repeat it, and --pose in the same order, for several robots.",
)
@click.option("--slip", is_flag=True, help="Let the tracks slip in turns.")
@click.option(
    "--error", default="", metavar="KEYS|FILE", help="Deviations of the robot from its model, see below."
)
@click.option(
    "--wiring",
    type=click.IntRange(0, 255),
    metavar="SUM",
    help="How motors and encoders of a robot with an H-bridge are connected, a sum of rows of the wiring table in "
    "PROTOCOL.md; the board does not know it.",
)
@click.option("--imu", is_flag=True, help="Fit an IMU, an MPU-6050, where the model's section imu says.")
@click.option(
    "--imu-seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Seed of the IMU's errors: bias, drift, scale and noise within its data sheet; 0: none.",
)
@click.option(
    "--radio",
    is_flag=False,
    flag_value=factory.OWN_ADDRESS,
    metavar="[ADDRESS]",
    help="Fit an XBee with this 64-bit address in hexadecimal, or one made of the robot's name; --engine avr runs the "
    "radio build.",
)
@click.option(
    "--radio-range",
    type=click.FloatRange(0.0),
    default=math.inf,
    metavar="M",
    help="Largest distance in metres at which two radios receive each other; default: any.",
)
@click.option(
    "--radio-loss",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    metavar="SHARE",
    help="Share of the radio packets that the radio does not receive.",
)
@click.option("--sonar", default="", metavar="KEYS|FILE", help="Errors of the sonars, see below.")
@click.option(
    "--footprint",
    default="box",
    metavar="box|none|circle:R",
    show_default=True,
    help="Outline of the robot for collisions.",
)
@click.option("--omni", is_flag=True, help="Emulate a base with three omnidirectional wheels.")
@click.option(
    "--speed",
    type=click.FloatRange(SLOWEST, FASTEST),
    default=1.0,
    show_default=True,
    help="Factor over real time.",
)
@click.option(
    "--seed",
    type=int,
    default=0,
    help="Seed of faults, sonar errors, and the initial RAM of the simulated chip.",
)
@click.option(
    "--battery", type=click.FloatRange(0.0, 15.0), metavar="V", help="Battery voltage at the start."
)
@click.option("--truth", metavar="FILE", help="Append the true pose as JSON lines, 20 per second.")
@click.option("--log", metavar="FILE", help="Append all bytes of both directions as JSON lines.")
@click.option(
    "--reset-on-open", is_flag=True, help="Reset the board when its port is opened, as a real Uno does."
)
@click.option(
    "--fault", "faults", multiple=True, metavar="FAULT", help="Inject a fault, see below; may be repeated."
)
@click.option("--plot", metavar="FILE", help="At the end, draw a map of the path; needs matplotlib.")
@click.option("--view", is_flag=True, help="Show the robot live on the terminal (stderr).")
@click.option("--control", is_flag=True, help="Read orders from stdin, one per line, see below.")
@click.version_option(
    package_name="mrl-driver", message="mrl-sim, version %(version)s", help="Show the version."
)
def main(names: Tuple[str, ...], poses: Tuple[str, ...], **given: Any) -> None:
    """Serve an emulated robot on a virtual serial port.

    Prints the path of the port when the robot is ready.  Runs until Ctrl-C.  With several names, all robots are in one
    world and process: each prints its name and path, and {name} in --link, --truth and --log stands for its name.

    \b
    Examples:
      mrl-sim --link /tmp/robot
      mrl-sim --robot stingbot --world square --view
      mrl-sim --fault loss:rate=0.01 --truth truth.jsonl
      mrl-sim --name one --name two --pose 0,0,0 --pose 1,1,90 --link /tmp/{name}
    """
    port = _PortOptions(**{name: given.pop(name) for name in _PortOptions._fields[:-1]})
    if port.plot:
        figures.require_writable(port.plot)
    _require_single(names, poses, port)
    with ExitStack() as stack:
        robots = factory.make_team(factory.Options(**given), names, poses)
        for robot in robots:
            stack.callback(robot.close)
        _serve(stack, robots, port)


def _require_single(names: Tuple[str, ...], poses: Tuple[str, ...], port: _PortOptions) -> None:
    """Refuses options that do not fit the number of robots."""
    if len(poses) > max(1, len(names)):
        raise ConfigError(f"--pose is given {len(poses)} times, expected at most once for each --name")
    if len(names) < 2:
        return
    for option in ("listen", "control", "plot", "view"):
        if getattr(port, option):
            raise ConfigError(f"--{option} is given with {len(names)} names, expected one --name with it")
    for option in ("link", "truth", "log"):
        if "{name}" not in (getattr(port, option) or "{name}"):
            raise ConfigError(
                f"--{option} is {getattr(port, option)!r}, expected {{name}} in it: each robot needs its own"
            )


def _serve(stack: ExitStack, robots: List[factory.Emulated], port: _PortOptions) -> None:
    """Serves robots; if one of several fails, it says so, and the others run on.

    Raises:
        Exception: the error of the first robot that failed, at the end.
    """
    waker = Waker()
    stack.callback(waker.close)
    names, several = {}, len(robots) > 1
    for robot in robots:
        its = stack.enter_context(ExitStack())
        own = port.of(robot.plant.name) if several else port
        server, announce = _server(its, robot, own, waker)
        names[server] = robot.plant.name, its, announce

    def failed(server: PtyServer, error: Exception) -> None:
        name, its, _ = names[server]
        its.close()
        if several:
            _print_message(f"robot {name}: {error}; it has no port any more")

    on_signals([server.stop for server in names])
    for _, _, announce in names.values():
        announce()
    errors = serve_together(list(names), waker, failed)
    if errors:
        raise errors[0]


def _server(
    stack: ExitStack, robot: factory.Emulated, given: _PortOptions, waker: Waker
) -> Tuple[PtyServer, Callable[[], None]]:
    """The server of a robot, and a function that announces its port."""
    port = _port(stack, given.link, given.listen)
    files = _open(stack, "--truth", given.truth), _open(stack, "--log", given.log)
    announce = _announcer(stack, given)
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
        watchers=_watchers(stack, PlantTrail(robot.plant), given.plot, given.view),
        waker=waker,
    )
    return server, partial(announce, port.path)


def _port(stack: ExitStack, link: Optional[str], listen: Optional[str]) -> BoardPort:
    if link and listen:
        raise ConfigError(
            "--link is given with --listen, expected one of them: a network address has no file"
        )
    port: BoardPort = SocketPort(listen) if listen else PtyPort()
    stack.callback(port.close)
    return port


def _watchers(stack: ExitStack, trail: PlantTrail, plot: Optional[str], view: bool) -> List[Watcher]:
    """The watchers that draw, if any."""
    watchers: List[Watcher] = [trail] if plot or view else []
    if plot:
        stack.callback(world_picture.draw, trail, plot)
    if view:
        from sim_arduino.view.world_view import WorldView

        watchers.append(WorldView(trail))
        stack.callback(watchers[-1].close)  # type: ignore[attr-defined]
    return watchers


def _announcer(stack: ExitStack, given: _PortOptions) -> Callable[[str], None]:
    """A function that prints the path of each plugged-in port, after the robot's name, and points the link to it."""
    link = SymbolicLink(given.link) if given.link else None
    if link:
        stack.callback(link.remove)

    def announce(path: str) -> None:
        if link:
            link.move(path)
        if path:
            click.echo(f"{given.name} {path}".strip())
        if path and sys.stderr.isatty():
            name = given.link or path
            place = "" if given.listen or name.startswith("/") else ", in this folder"
            _print_message(
                f"Ctrl-C ends it; drive it from another terminal{place}: mrl drive --port {shlex.quote(name)}"
            )
        if path and given.listen:
            _print_message(f"listening on {path}; everybody who can reach this address can drive the robot")

    return announce


def _print_message(text: str) -> None:
    click.echo(f"mrl-sim: {text}", err=True)


def _open(stack: ExitStack, option: str, path: Optional[str]) -> Optional[TextIO]:
    if path is None:
        return None
    try:
        return stack.enter_context(open(path, "a", encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{option} {path} cannot be written: {error.strerror}; give another file") from None


if __name__ == "__main__":
    main()
