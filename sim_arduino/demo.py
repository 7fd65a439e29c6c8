"""`mrl demo`: an emulated robot and what drives it, in one terminal."""

import contextlib
import importlib.util
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Iterator, Optional

import click

from mrl_driver.errors import ConfigError, PortBusy
from mrl_driver.terminal.keyboard import Keyboard

_NEXT = """next:
  mrl-sim --link ttySIM0        serves it on a port, for other programs
  mrl flash --build virtual     makes a bare Uno, Nano or Mega such a robot
  mrl new                       makes a robot of your own
"""


@click.command(short_help="Drive an emulated robot; needs no hardware.")
@click.option("--robot", metavar="NAME|FILE", help="Robot model to emulate.  [default: traxbot]")
@click.option("--world", metavar="NAME|FILE", help="World or map around it.  [default: room]")
@click.option("--web", "way", flag_value="web", help="Show and drive it on a web page.")
@click.option(
    "--ros", "way", flag_value="ros", help="Drive a square through ROS, with rviz if there is a screen."
)
@click.pass_context
def demo(ctx: click.Context, robot: Optional[str], world: Optional[str], way: Optional[str]) -> None:
    """Emulate a robot and drive it, in this terminal; q ends all.

    \b
    Examples:
      mrl demo                      arrow keys drive, space stops
      mrl demo --web                the same in a browser
      mrl demo --robot omni         a base with three omnidirectional wheels
    """
    robot = robot or ctx.find_root().params.get("robot") or "traxbot"
    if way == "ros":
        if world is not None:
            raise ConfigError("--world is given with --ros, expected one of them: its square is in the room")
        _run_ros(robot)
        return
    from sim_arduino.testing.emulated_board import EmulatedBoard

    with EmulatedBoard(robot=robot, world=world or "room") as board:
        if way == "web":
            from mrl_driver.apps.web.command import web

            browser = ["--browser"] if {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ) else []
            options = ["--port", board.port, "--robot", robot, "--listen", _free_address(), *browser]
            with _q_is_ctrl_c():
                web.main(options, standalone_mode=False, obj="q" if sys.stdin.isatty() else None)
            click.echo()
        else:
            from mrl_driver.cli.commands.drive import drive

            drive.main(["--port", board.port, "--robot", robot], standalone_mode=False)
    click.echo(_NEXT, nl=False)


def _run_ros(robot: str) -> None:
    """Become `make run`; ConfigError if ROS or the checkout is missing."""
    found = importlib.util.find_spec("ros1_bridge")
    node = Path(str(found and found.origin)).with_name("nodes") / "demo_view"
    if not node.exists() or importlib.util.find_spec("rospy") is None:
        raise ConfigError(
            "--ros needs ROS and a clone of mrl-driver, expected: make run, in the clone's folder"
        )
    os.execv(sys.executable, [sys.executable, "-m", "ros1_bridge.demo.launcher", "--robot", robot])


def _free_address() -> str:
    """Return the address of `mrl web`, with any free port if another program has its own."""
    from mrl_driver.apps.web.listening import HOST, PORT, listening_socket

    try:
        listening_socket(HOST, PORT).close()
        return f"{HOST}:{PORT}"
    except PortBusy:
        return f"{HOST}:0"


@contextlib.contextmanager
def _q_is_ctrl_c() -> Iterator[None]:
    """In this block the key q ends the program in this terminal, as Ctrl-C does, but without an error.

    Ctrl-C does so too where it was ignored, as in a program that a script has started in the background.
    """
    pressed = threading.Event()

    def read() -> None:
        while not pressed.is_set():
            if "q" in keys.read(1.0):
                pressed.set()
                os.kill(os.getpid(), signal.SIGINT)

    with Keyboard() as keys:
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        threading.Thread(target=read, daemon=True).start()
        try:
            yield
        except (KeyboardInterrupt, click.Abort):
            if not pressed.is_set():
                raise
        finally:
            pressed.set()
            signal.signal(signal.SIGINT, before)
