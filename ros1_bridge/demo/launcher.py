"""`make run`: starts the nodes by roslaunch, on a ROS master of their own, and the live view, which ends first.

Run it as `python -m ros1_bridge.demo.launcher`.  The master is on a free port of localhost: on a shared one the
demonstration's `/cmd_vel` would drive other robots too.
"""

import math
import os
import re
import shlex
import shutil
import signal
import sys
import time
from pathlib import Path
from typing import Dict, List, Optional

import click

from mrl_driver.cli.commands.shared import Between
from mrl_driver.errors import ConfigError, MrlError, SimulatorError
from mrl_driver.program import handle_end_signals
from mrl_driver.robot import models
from mrl_driver.transport.link import require_device
from ros1_bridge.node.processes import ROOT, Child, RunError, answers, environment, free_port

LOGS = ROOT / "build" / "run"
IMAGE = ROOT / "build" / "firmware" / "mrl_firmware.elf"
SLOW_S = 20.0  # A master that takes longer to start is said to be slow; it is waited for while it lives
END_S = 25.0  # A part that takes longer than this to end is killed; roslaunch itself kills a node after 17 s
_POLL_S = 0.05
_DEFAULT_ROBOT = "traxbot"
_NEXT = """next:
  . .venv/bin/activate; mrl demo                  drives without ROS
  mrl flash --build virtual --port /dev/ttyACM0   makes a bare board a robot
  make run PORT=/dev/ttyACM0                      drives it, or a real robot"""
_DIED = re.compile(r"REQUIRED process \[(\w+)-\d+\] has died!\nprocess has died \[pid \d+, exit code (-?\d+)")
"""What roslaunch prints when a node ends."""


class Run:
    """The started parts, in order; `stop` ends them, the last first."""

    def __init__(self, env: Dict[str, str], logs: Path) -> None:
        self.env, self.logs = env, logs
        self._children: List[Child] = []
        self.signal: Optional[int] = None  # The signal that requested the end, or None

    def on_signal(self, number: int, _frame: object) -> None:
        """Signal handler: store the signal; the main loop acts on it."""
        self.signal = self.signal or number

    def start(self, name: str, *command: str, terminal: bool = False) -> Child:
        """Start a part; its output goes to the terminal or to a log."""
        log = None if terminal else self.logs / f"{name}.log"
        self._children.append(Child(name, command, log, self.env, ROOT))
        return self._children[-1]

    def check_signal(self) -> None:
        """Exit the program if a signal has requested the end."""
        if self.signal:
            sys.exit(128 + self.signal)

    def check(self) -> None:
        """Exit after a signal; RunError if a part or a node has ended."""
        self.check_signal()
        for child in self._children:
            if child.exit_code is not None:
                raise _ended(child)

    def stop(self) -> None:
        """End all parts: first the view, which restores the terminal, then the nodes and their master."""
        for child in reversed(self._children):
            child.signal(signal.SIGTERM if child.log is None else signal.SIGINT)
            child.finish(END_S)


def _ended(child: Child) -> RunError:
    """The error for a part that has ended: of a node that roslaunch says has ended, if it says so."""
    text = "\n".join(child.output())
    died = _DIED.search(text)
    if died is None:
        return RunError(child.last_words(), child.exit_code or 1)
    code = int(died.group(2))
    code = 128 - code if code < 0 else code
    return RunError(child.last_words(text[: died.start()].splitlines(), died.group(1), code), code)


def start_master(run: Run) -> None:
    """Start the run's own master, and wait until it answers; RunError if it ends or its port is taken.

    roslaunch would start one too, but gives it 10 s, which is too little on a slow computer.
    """
    uri = run.env["ROS_MASTER_URI"]
    master = run.start("rosmaster", "rosmaster", "--core", "-p", uri.rsplit(":", 1)[1])
    slow_s = time.monotonic() + SLOW_S
    while not answers(master, uri):
        run.check()
        if time.monotonic() > slow_s:
            slow_s = math.inf
            click.echo(f"the ROS master is still starting; its log is {master.log}")
        time.sleep(_POLL_S)


def best_engine() -> str:
    """`avr` if the firmware's image is there and can be run; otherwise `python`, and the reason is printed."""
    from mrl_driver.robot.chips import ATMEGA328P
    from sim_arduino.avr import native

    try:
        if not IMAGE.exists():
            raise SimulatorError(
                f"there is no firmware image {IMAGE.relative_to(ROOT)} (make run ENGINE=avr builds it)"
            )
        native.load(ATMEGA328P.name)
        return "avr"
    except SimulatorError as error:
        click.echo(f"the board is emulated in Python: {error}")
        return "python"


def supervise(run: Run, robot: Optional[str], port: str, engine: Optional[str], duration_s: float) -> None:
    """Start all parts, and wait until the view ends; RunError if a part fails."""
    robot = robot or ("auto" if port else _DEFAULT_ROBOT)
    board = f"the robot on {port}" if port else f"an emulated {robot}"
    click.echo(f"starting the ROS node for {board}; Ctrl-C ends everything")
    emulated = [] if port else [f"engine:={engine or best_engine()}"]
    rviz = not port and bool(os.environ.get("DISPLAY")) and shutil.which("rviz") is not None
    start_master(run)
    launch = str(Path(__file__).with_name("run.launch"))
    arguments = (f"port:={port or run.logs / 'robot'}", f"robot:={robot}", f"rviz:={rviz}", *emulated)
    run.start("roslaunch", "roslaunch", launch, *arguments)
    click.echo(
        f"for rostopic, rosbag and rviz in another terminal: export ROS_MASTER_URI={run.env['ROS_MASTER_URI']}"
    )
    demo = str(ROOT / "ros1_bridge" / "nodes" / "demo_view")
    moves, ends = f"_square:={'false' if port else 'true'}", f"_duration:={duration_s}"
    view = run.start("demo_view", sys.executable, demo, moves, ends, f"_robot:={robot}", terminal=True)
    while view.exit_code != 0:
        run.check()
        time.sleep(_POLL_S)
    run.check_signal()
    if not port:
        click.echo(_NEXT)


@click.command()
@click.option(
    "--robot",
    metavar="NAME|FILE",
    help="Robot model; default: that of the board's id, or traxbot for an emulated robot.",
)
@click.option("--port", default="", help="Serial port of a real robot; it moves only when you press a key.")
@click.option(
    "--engine",
    type=click.Choice(["avr", "python"]),
    help="Emulate the board in Python, or run the firmware binary on a simulated chip (avr).",
)
@click.option("--duration", type=Between(min=0.1), help="End after this many seconds of odometry.")
@click.option(
    "--logs", type=click.Path(path_type=Path, file_okay=False), default=LOGS, help="Folder for the logs."
)
def main(
    robot: Optional[str], port: str, engine: Optional[str], duration: Optional[float], logs: Path
) -> None:
    """Drive a robot through ROS, an emulated one unless --port names a real one, with a live view."""
    try:
        logs = logs.absolute()  # the parts have other working folders
        if robot and robot.endswith((".yaml", ".yml")):
            robot = os.path.abspath(robot)
        if Path(port).is_char_device():
            port = os.path.abspath(port)
        if robot and robot != "auto":
            models.load(robot).require_odometry()
        if os.path.isabs(port):  # neither an address nor the name of a robot
            require_device(port)
        master_port = free_port()
        run = Run(environment(logs, master_port), logs / str(master_port))
        for folder in (logs, run.logs):
            folder.mkdir(parents=True, exist_ok=True)
        handle_end_signals(run.on_signal, even_ignored=True)
        try:
            supervise(run, robot, port, engine, duration or 0.0)
        finally:
            run.stop()
    except MrlError as error:
        click.echo(error.line, err=True)
        sys.exit(error.exit_code)
    except OSError as error:
        reason = f"{error.filename} cannot be written: {error.strerror}"
        click.echo(
            f"{reason}; is it another user's? Then: sudo chown -R $USER {shlex.quote(str(logs))}", err=True
        )
        sys.exit(ConfigError.exit_code)


if __name__ == "__main__":
    main()
