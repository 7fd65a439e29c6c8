"""`mrl-sim`: an emulated robot on a virtual serial port."""

import os
import signal
import sys
from contextlib import ExitStack
from typing import Any, Callable, Dict, Optional, TextIO, Tuple

import click

from mrl_driver import robots
from mrl_driver.errors import ConfigError, MrlError

from . import fault_table, world_file
from .control import ORDERS, Control
from .engine import Engine
from .faults import FaultyEngine
from .plant import Plant
from .port import Link, PtyPort
from .server import PtyServer

PROFILES = ("current", "2013-august", "2013-january")


class _OneLine(click.Command):
    """Ends with one line and the error's own exit code."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """As click's, but an error costs one line."""
        try:
            super().main(*args, **{**kwargs, "standalone_mode": False})
        except (MrlError, click.ClickException) as error:
            text = error.format_message() if isinstance(error, click.ClickException) else str(error)
            click.echo(f"mrl-sim: {' '.join(text.split())}", err=True)
            sys.exit(error.exit_code)
        except click.Abort:
            sys.exit(130)


_EPILOG = "\b\nFaults, such as --fault loss:rate=0.01,at=5 (keys with their defaults):\n{}\n\n\b\nOrders:\n{}".format(
    "\n".join("  " + line for line in fault_table.usage().splitlines()),
    "\n".join(f"  {order:18}{text}" for order, text in ORDERS),
)


@click.command(cls=_OneLine, epilog=_EPILOG)
@click.option("--robot", default="traxbot", metavar="NAME|FILE", help="Robot model.", show_default=True)
@click.option(
    "--id", "robot_id", type=click.IntRange(0, 32767), help="Robot id; the model's first one if absent."
)
@click.option(
    "--engine",
    type=click.Choice(["python", "avr"]),
    default="python",
    show_default=True,
    help="Emulated in Python, or the real image on a simulated chip.",
)
@click.option(
    "--profile",
    type=click.Choice(PROFILES),
    default="current",
    show_default=True,
    help="Firmware to imitate.",
)
@click.option("--environment", is_flag=True, help="The environment-sensor build.")
@click.option("--elf", type=click.Path(dir_okay=False), help="Image for --engine avr.")
@click.option("--link", metavar="NAME", help="Symbolic link to the port, removed at the end.")
@click.option(
    "--world", default="room", metavar="NAME|FILE", show_default=True, help="Walls around the robot."
)
@click.option("--pose", metavar="X,Y,YAW", help="Start in metres and degrees; the world's start if absent.")
@click.option("--slip", is_flag=True, help="Tracks slip in turns.")
@click.option(
    "--seed",
    type=int,
    default=0,
    help="Seed of the faults, and of the RAM noise that the simulated chip starts with.",
)
@click.option(
    "--battery", type=click.FloatRange(0.0, 15.0), metavar="V", help="Battery voltage at the start."
)
@click.option("--truth", metavar="FILE", help="Append the true pose as JSON lines, 20 a second.")
@click.option("--log", metavar="FILE", help="Append all bytes of both directions as JSON lines.")
@click.option("--reset-on-open", is_flag=True, help="Opening the port resets the board, as on a real Uno.")
@click.option("--fault", "faults", multiple=True, metavar="FAULT", help="What goes wrong; may be repeated.")
@click.option("--control", is_flag=True, help="Take orders as lines on stdin.")
def main(
    robot: str,
    world: str,
    pose: Optional[str],
    link: Optional[str],
    truth: Optional[str],
    log: Optional[str],
    reset_on_open: bool,
    slip: bool,
    battery: Optional[float],
    faults: Tuple[str, ...],
    control: bool,
    **board: Any,
) -> None:
    """Serve an emulated robot on a virtual serial port.

    Prints the port's path when it is ready and runs until Ctrl-C.
    """
    parsed = [fault_table.parse(spec) for spec in faults]
    model = robots.load(robot)
    walls = world_file.load(world)
    plant = Plant(
        model,
        walls,
        world_file.parse_pose(pose, walls.start),
        slip=slip,
        battery_v=battery,
        sonars=not board["environment"],
    )
    with ExitStack() as stack:
        files = _open(stack, "--truth", truth), _open(stack, "--log", log)
        engine = FaultyEngine(_make_engine(plant, board), parsed, board["seed"])
        stack.callback(engine.close)
        port = PtyPort()
        stack.callback(port.close)
        tell = _announcer(stack, link)
        orders = sys.stdin.fileno() if control else None
        attendant = Control(engine, orders, tell, _complain) if parsed or control else None
        server = PtyServer(
            engine if attendant else engine.engine, port, plant, *files, reset_on_open, attendant
        )
        _stop_on_signals(server)
        tell(port.path)
        server.run()


def _announcer(stack: ExitStack, name: Optional[str]) -> Callable[[str], None]:
    """Prints the path of each port that is plugged in, and has the link lead to it."""
    link = Link(name) if name else None
    if link:
        stack.callback(link.remove)

    def tell(path: str) -> None:
        if link:
            link.move(path)
        if path:
            click.echo(path)
            sys.stdout.flush()

    return tell


def _complain(text: str) -> None:
    click.echo(f"mrl-sim: {text}", err=True)


def _make_engine(plant: Plant, board: Dict[str, Any]) -> Engine:
    if board["engine"] == "avr":
        return _make_avr_engine(plant, board)
    if board["profile"] != "current":
        from .profiles import Board2013

        return Board2013(plant, january=board["profile"] == "2013-january", robot_id=board["robot_id"])
    from .board import PythonBoard

    return PythonBoard(plant, board["robot_id"], board["environment"])


def _make_avr_engine(plant: Plant, board: Dict[str, Any]) -> Engine:
    from .avr_engine import AvrEngine

    if board["profile"] != "current":
        raise ConfigError(f"profile {board['profile']} has no image, expected --engine python")
    image = "mrl_firmware_environment.elf" if board["environment"] else "mrl_firmware.elf"
    checkout = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    elf = board["elf"] or os.path.join(checkout, "build", "firmware", image)
    if not os.path.exists(elf):
        raise ConfigError(f"image {elf} is missing; make it with 'make firmware', or name one with --elf")
    robot_id = plant.model.ids[0] if board["robot_id"] is None else board["robot_id"]
    return AvrEngine(plant, elf, robot_id or None, seed=board["seed"])


def _open(stack: ExitStack, option: str, path: Optional[str]) -> Optional[TextIO]:
    if path is None:
        return None
    try:
        return stack.enter_context(open(path, "a", encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{option} {path}: {error.strerror}; expected a file that can be written") from None


def _stop_on_signals(server: PtyServer) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: server.stop())


if __name__ == "__main__":
    main()
