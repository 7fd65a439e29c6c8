"""`make run`: starts roscore, an emulated board, the robot node and the live view, and ends them in order.

Run it as `python -m ros1_bridge.demo.launcher`.  It always starts its own roscore, on a free port of localhost.
On a shared roscore the demonstration's `/cmd_vel` would drive other robots too.
"""

import fcntl
import itertools
import os
import signal
import socket
import sys
import time
import xmlrpc.client
from pathlib import Path
from typing import IO, Any, Callable, Dict, List, NamedTuple, Optional, Tuple

import click

from mrl_driver.cli.commands.shared import Between
from mrl_driver.errors import ConfigError, MrlError, SimulatorError

from .processes import Child, adopt_orphans, end_orphans, wait_until

ROOT = Path(__file__).resolve().parent.parent.parent
LOGS = ROOT / "build" / "run"
IMAGE = ROOT / "build" / "firmware" / "mrl_firmware.elf"
NODES = ROOT / "ros1_bridge" / "nodes"
ROSCORE_TIMEOUT_S = SIMULATOR_TIMEOUT_S = 30.0
END_S = 3.0
"""A part that takes longer than this to end is killed; the node needs at most 2 s."""
_ENDS: Tuple[Dict[str, int], ...] = (
    {"robot_node": signal.SIGINT, "demo_view": signal.SIGTERM},
    {"mrl-sim": signal.SIGINT, "roscore": signal.SIGINT},
)
"""The signal that ends each part, in two stages: parts of the first stage depend on those of the second."""
_POLL_S = 0.05
_DEFAULT_ROBOT = "traxbot"
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_LOCALHOST = "127.0.0.1"
_OF_ROSCORE = {"/rosout"}


class RunError(MrlError):
    """A part of the run did not start, or it ended; carries the exit code of that part."""

    def __init__(self, message: str, exit_code: int = 1) -> None:
        super().__init__(message)
        self.exit_code = exit_code or 1


class Stopped(Exception):
    """A signal has requested the end of the run."""


class Plan(NamedTuple):
    """What the user asked for."""

    robot: Optional[str]
    """Model name; None means the model that the board reports."""
    port: str
    """Serial port of a real robot; empty for an emulated robot."""
    engine: Optional[str]
    """`avr` or `python`; None means `avr` if it is available."""
    duration_s: Optional[float]
    """None means no limit."""


class Run:
    """The started parts, in order; `stop` ends them, the robot node first."""

    def __init__(self, env: Dict[str, str], logs: Path) -> None:
        self.env = env
        self.logs = logs
        self._children: List[Child] = []
        self.signal: Optional[int] = None
        """The signal that requested the end, or None."""

    def on_signal(self, number: int, _frame: object) -> None:
        """Signal handler: store the signal; the main loop acts on it."""
        self.signal = self.signal or number

    def start(self, name: str, command: List[str], terminal: bool = False) -> Child:
        """Start a part; its output goes to the terminal or to a log."""
        log = None if terminal else self.logs / f"{name}.log"
        child = Child(name, command, log, self.env, ROOT)
        self._children.append(child)
        return child

    def forget(self, child: Child) -> None:
        """Remove a part that has ended as expected."""
        self._children.remove(child)

    def check(self) -> None:
        """Raises Stopped after a signal, and RunError if a part has ended."""
        if self.signal:
            raise Stopped
        for child in self._children:
            if child.exit_code is not None:
                raise RunError(child.last_words(), child.exit_code)

    def stop(self) -> None:
        """End all parts: first the node, which stops the robot, and the view, which restores the terminal."""
        for stage in _ENDS:
            ending = [child for name in stage for child in self._children if child.name == name]
            for child in ending:
                child.signal(stage[child.name])
            for child in ending:
                child.finish(END_S)
        end_orphans()


def free_port() -> int:
    """A free TCP port of localhost."""
    with socket.socket() as probe:
        probe.bind((_LOCALHOST, 0))
        return int(probe.getsockname()[1])


def environment(logs: Path) -> Dict[str, str]:
    """The environment of the child processes: their own ROS master, and all addresses on localhost."""
    env = {name: value for name, value in os.environ.items() if name != "ROS_HOSTNAME"}
    env["ROS_MASTER_URI"], env["ROS_IP"] = f"http://{_LOCALHOST}:{free_port()}", _LOCALHOST
    env.setdefault("ROS_LOG_DIR", str(logs / "ros"))
    env["PYTHONUNBUFFERED"] = "1"
    return env


def lock_folder(wanted: Path) -> Tuple[Path, IO[str]]:
    """A log folder that no other run uses: `wanted`, with a number if necessary.

    Returns the folder and its lock; keep the lock open during the run.
    """
    for number in itertools.count(1):
        folder = wanted if number == 1 else wanted.with_name(f"{wanted.name}-{number}")
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return folder, lock
        except BlockingIOError:
            lock.close()
    raise AssertionError("unreachable: the numbers do not end")


def master_answers(uri: str) -> bool:
    """Whether a ROS master runs there."""
    try:
        with xmlrpc.client.ServerProxy(uri) as master:
            reply = master.getPid("/mrl_run")
            return isinstance(reply, list) and reply[0] == 1
    except (OSError, xmlrpc.client.Error, ValueError, TypeError, IndexError):
        return False


def require_alone(uri: str) -> None:
    """Check that no other node receives this run's commands.

    Raises:
        RunError: a node is registered at the master; the message names it.
    """
    with xmlrpc.client.ServerProxy(uri) as master:
        reply: Any = master.getSystemState("/mrl_run")
    others = {node for kind in reply[2] for _, nodes in kind for node in nodes} - _OF_ROSCORE
    if others:
        raise RunError(
            f"{', '.join(sorted(others))} on the ROS master {uri}, expected no other node: the demonstration would "
            "drive its robot; end it, or run again for another port"
        )


def start_roscore(run: Run) -> None:
    """Start this run's own roscore."""
    run.start("roscore", ["roscore", "-p", run.env["ROS_MASTER_URI"].rsplit(":", 1)[1]])


def await_roscore(run: Run) -> None:
    """Wait for the ROS master.

    Raises:
        RunError: the master did not start, or it has other nodes.
        Stopped: a signal came.
    """
    uri = run.env["ROS_MASTER_URI"]
    _await(run, lambda: master_answers(uri), ROSCORE_TIMEOUT_S, f"roscore does not answer at {uri}")
    require_alone(uri)


def start_simulator(run: Run, robot: str, engine: Optional[str]) -> str:
    """Start the emulated board and return its port; if `avr` fails, print why and use the Python engine.

    Raises:
        RunError: the board did not start.
        Stopped: a signal came.
    """
    if engine is None:
        try:
            if not IMAGE.exists():
                raise SimulatorError(f"there is no firmware image {IMAGE.relative_to(ROOT)} (make firmware)")
            return _serve(run, robot, "avr")
        except SimulatorError as error:
            click.echo(f"the board is emulated in Python: {error}")
    return _serve(run, robot, engine or "python")


def _serve(run: Run, robot: str, engine: str) -> str:
    command = [sys.executable, "-m", "sim_arduino.serve.main", "--robot", robot, "--engine", engine]
    child = run.start("mrl-sim", command)

    def port() -> str:
        return next((line.split()[0] for line in child.output() if line.startswith("/dev/")), "")

    try:
        _await(run, lambda: bool(port()), SIMULATOR_TIMEOUT_S, "mrl-sim names no port")
    except RunError:
        if child.exit_code == SimulatorError.exit_code:
            run.forget(child)
            raise SimulatorError((child.output() or ["mrl-sim has no such engine"])[-1]) from None
        raise
    return port()


def _await(run: Run, condition: Callable[[], bool], timeout_s: float, failure: str) -> None:
    def settled() -> bool:
        if condition():
            return True
        run.check()
        return False

    if not wait_until(settled, timeout_s):
        raise RunError(f"{failure} within {timeout_s:.0f} s; its log is in {run.logs}")


def start_node(run: Run, plan: Plan) -> None:
    """Start the robot node with the system Python."""
    command = [str(NODES / "robot_node"), f"_port:={plan.port}", f"_robot:={plan.robot or 'auto'}"]
    run.start("robot_node", command)


def start_view(run: Run, plan: Plan, moves: bool) -> Child:
    """Start the live view; it drives the square only if `moves`."""
    command = [
        sys.executable,
        str(NODES / "demo_view"),
        f"_square:={'true' if moves else 'false'}",
        f"_title:='{plan.robot or 'robot'} on {plan.port}'",
        f"_duration:={plan.duration_s or 0.0}",
    ]
    return run.start("demo_view", command, terminal=True)


def supervise(run: Run, plan: Plan) -> int:
    """Start all parts, wait until the view ends, and return the exit code.

    Raises:
        RunError: a part did not start, or it ended.
        Stopped: a signal came.
    """
    real = bool(plan.port)
    board = f"the robot on {plan.port}" if real else f"an emulated {plan.robot or _DEFAULT_ROBOT}"
    click.echo(f"starting the ROS node for {board}; Ctrl-C ends everything")
    start_roscore(run)
    if not real:
        plan = plan._replace(robot=plan.robot or _DEFAULT_ROBOT)
        plan = plan._replace(port=start_simulator(run, plan.robot or "", plan.engine))
    await_roscore(run)
    uri = run.env["ROS_MASTER_URI"]
    click.echo(f"for rostopic, rosbag and rviz in another terminal: export ROS_MASTER_URI={uri}")
    start_node(run, plan)
    view = start_view(run, plan, moves=not real)
    while view.exit_code != 0:
        run.check()
        time.sleep(_POLL_S)
    if run.signal:
        raise Stopped
    return 0


@click.command()
@click.option("--robot", metavar="NAME|FILE", help="Model; the board's own by default, emulated: traxbot.")
@click.option("--port", default="", help="Serial port of a real robot; it moves only when you press a key.")
@click.option("--engine", type=click.Choice(["avr", "python"]), help="What the emulated board runs on.")
@click.option("--duration", type=Between(min=0.1), help="End after this many seconds of odometry.")
@click.option(
    "--logs", type=click.Path(path_type=Path, file_okay=False), default=LOGS, help="Folder of the logs."
)
def main(
    robot: Optional[str], port: str, engine: Optional[str], duration: Optional[float], logs: Path
) -> None:
    """Drive a robot through ROS, an emulated one unless --port names a real one, with a live view."""
    adopt_orphans()
    try:
        logs, lock = lock_folder(logs)
        with lock:
            run = Run(environment(logs), logs)
            for number in _SIGNALS:
                signal.signal(number, run.on_signal)
            sys.exit(_run_to_end(run, Plan(robot, port, engine, duration)))
    except MrlError as error:
        click.echo(str(error), err=True)
        sys.exit(error.exit_code)
    except OSError as error:
        reason = f"{error.filename} cannot be written: {error.strerror}"
        click.echo(f"{reason}; is it another user's? Then: sudo chown -R $USER {logs}", err=True)
        sys.exit(ConfigError.exit_code)


def _run_to_end(run: Run, plan: Plan) -> int:
    try:
        return supervise(run, plan)
    except Stopped:
        return 128 + (run.signal or 0)
    finally:
        run.stop()


if __name__ == "__main__":
    main()
