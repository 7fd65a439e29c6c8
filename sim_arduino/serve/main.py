"""`mrl-sim`: an emulated robot on a virtual serial port."""

import signal
import sys
from contextlib import ExitStack
from typing import Any, Callable, List, Optional, TextIO

import click

from mrl_driver import figures
from mrl_driver.errors import ConfigError
from sim_arduino.faults import fault_table, key_values
from sim_arduino.view import world_picture
from sim_arduino.view.plant_trail import PlantTrail

from . import factory
from .control import ORDERS, Control
from .one_line import OneLine
from .pty import BoardPort, PtyPort, SymbolicLink
from .server import FASTEST, SLOWEST, PtyServer, Watcher
from .socket_port import SocketPort


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
    "--pose", metavar="X,Y,YAW", help="Start pose in metres and degrees; default: the start of the world."
)
@click.option("--world-name", metavar="NAME", help="Share the world with all boards that give the same name.")
@click.option("--name", help="The robot's name in the world.")
@click.option("--slip", is_flag=True, help="Let the tracks slip in turns.")
@click.option(
    "--error", default="", metavar="KEYS|FILE", help="Deviations of the robot from its model, see below."
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
def main(
    link: Optional[str],
    listen: Optional[str],
    truth: Optional[str],
    log: Optional[str],
    reset_on_open: bool,
    control: bool,
    speed: float,
    plot: Optional[str],
    view: bool,
    **options: Any,
) -> None:
    """Serve an emulated robot on a virtual serial port.

    Prints the path of the port when the robot is ready.  Runs until Ctrl-C.

    \b
    Examples:
      mrl-sim --link /tmp/robot
      mrl-sim --robot stingbot --world square --view
      mrl-sim --fault loss:rate=0.01 --truth truth.jsonl
    """
    if plot:
        figures.require_writable(plot)
    robot = factory.make(factory.Options(**options))
    with ExitStack() as stack:
        stack.callback(robot.close)
        port = _port(stack, link, listen)
        files = _open(stack, "--truth", truth), _open(stack, "--log", log)
        announce = _announcer(stack, link, bool(listen))
        attendant = _attendant(robot, control, announce)
        engine = robot.board if attendant else robot.engine
        watchers = _watchers(stack, PlantTrail(robot.plant), plot, view)
        server = PtyServer(
            engine, port, robot.plant, *files, reset_on_open, attendant, speed=speed, watchers=watchers
        )
        _stop_on_signals(server)
        announce(port.path)
        server.run()


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


def _attendant(robot: factory.Emulated, control: bool, announce: Callable[[str], None]) -> Optional[Control]:
    """What triggers faults and takes orders, if there are any."""
    if not robot.has_faults and not control:
        return None
    return Control(robot.board, sys.stdin.fileno() if control else None, announce, _print_message)


def _announcer(stack: ExitStack, name: Optional[str], network: bool) -> Callable[[str], None]:
    """A function that prints the path of each plugged-in port, and points the link to it."""
    link = SymbolicLink(name) if name else None
    if link:
        stack.callback(link.remove)

    def announce(path: str) -> None:
        if link:
            link.move(path)
        if path:
            click.echo(path)
        if network:
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


def _stop_on_signals(server: PtyServer) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: server.stop())


if __name__ == "__main__":
    main()
