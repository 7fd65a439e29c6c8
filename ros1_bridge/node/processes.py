"""Child processes that end with their parent, each with a log, and a ROS master of their own."""

import contextlib
import ctypes
import os
import random
import re
import signal
import socket
import subprocess
import time
from http.client import HTTPException
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Sequence
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error, ServerProxy, Transport

from mrl_driver.errors import MrlError

ROOT = Path(__file__).resolve().parent.parent.parent
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)
_POLL_S = 0.02
_ORDERS = re.compile(r"\x1b\[[\d;]*m|\x1b\]2;.*?\x07")
"""Colours and window titles, which roslaunch prints into its log as well."""
_NO_WORDS = ("", "The traceback for the exception was written to the log file")
"""Last lines that say nothing: rulers, and what roslaunch prints after its error."""
_ANSWER_S = 1.0
_LOCALHOST = "127.0.0.1"
_PORTS = range(20000, 32768)
"""Linux gives connections higher ports, so that no other program takes the port before the master does."""
_REFUSED = "Unable to start XML-RPC server"
"""rosmaster prints a line with these words if its port is taken."""


class RunError(MrlError):
    """A part of the run did not start, or it ended; carries the exit code of that part."""

    def __init__(self, message: str, exit_code: int = 1) -> None:
        super().__init__(message)
        self.exit_code = exit_code or 1


class Child:
    """A started program.

    Unless it uses the terminal, it runs in its own session: Ctrl-C then reaches only the parent, and the parent
    decides on the order in which programs end.  If the parent dies, the kernel sends SIGTERM to the program.
    """

    def __init__(
        self, name: str, command: Sequence[str], log: Optional[Path], env: Dict[str, str], cwd: Path
    ) -> None:
        """Start `command`; its output goes to the file `log`, or to the parent's terminal if `log` is None."""
        self.name = name
        self.log = log
        output = log.open("wb") if log else None
        try:
            self._process = subprocess.Popen(
                list(command),
                env=env,
                cwd=str(cwd),
                stdin=subprocess.DEVNULL if log else None,
                stdout=output,
                stderr=subprocess.STDOUT if log else None,
                start_new_session=log is not None,
                preexec_fn=_die_with_parent(os.getpid()),
            )
        finally:
            if output:
                output.close()
        self.pid = self._process.pid

    @property
    def exit_code(self) -> Optional[int]:
        """None while the program runs; 128 plus the signal number if a signal ended it, as in a shell."""
        code = self._process.poll()
        return 128 - code if code is not None and code < 0 else code

    def signal(self, number: int) -> None:
        """Send a signal, unless the program has ended."""
        if self.exit_code is None:
            self._process.send_signal(number)

    def wait(self, timeout_s: float) -> bool:
        """Wait until the program ends; False after `timeout_s`."""
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def finish(self, timeout_s: float) -> None:
        """Wait until the program ends; kill it after `timeout_s`."""
        if not self.wait(timeout_s):
            self.signal(signal.SIGKILL)
            self._process.wait()

    def output(self) -> List[str]:
        """The lines of the log so far."""
        if self.log is None or not self.log.exists():
            return []
        return self.log.read_text(encoding="utf-8", errors="replace").splitlines()

    def last_words(
        self, lines: Optional[Sequence[str]] = None, name: str = "", exit_code: Optional[int] = None
    ) -> str:
        """In one line: name, exit code, the last of `lines`, the log; by default those of the program and its log."""
        words = f"{name or self.name} ended with exit code {exit_code or self.exit_code}"
        said = [_ORDERS.sub("", line).strip() for line in (self.output() if lines is None else lines)]
        last = next((line for line in reversed(said) if line.strip("=") not in _NO_WORDS), "")
        return f"{words}: {last} (its log is {self.log})" if last else words


def wait_until(condition: Callable[[], bool], timeout_s: float) -> bool:
    """Poll until `condition` is true; False after `timeout_s`."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() >= deadline:
            return False
        time.sleep(_POLL_S)
    return True


def _die_with_parent(parent: int) -> Callable[[], None]:
    def prepare() -> None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGTERM)

    return prepare


def free_port() -> int:
    """A free TCP port."""
    while True:
        port = random.SystemRandom().choice(_PORTS)
        with contextlib.suppress(OSError), socket.socket() as probe:
            probe.bind(("", port))
            return port


def environment(logs: Path, port: int) -> Dict[str, str]:
    """The environment of the child processes: a ROS master on `port`, and all addresses on localhost.

    Each run has the folder of its master's port for its logs, and for the files that ROS writes into a home: two
    masters that make one home at the same time end with an error (roslaunch 1.15).
    """
    env = {name: value for name, value in os.environ.items() if name != "ROS_HOSTNAME"}
    env["ROS_MASTER_URI"], env["ROS_IP"] = f"http://{_LOCALHOST}:{port}", _LOCALHOST
    env["ROS_HOME"] = str(logs / str(port))
    env.setdefault("ROS_LOG_DIR", env["ROS_HOME"])
    env["ROS_PACKAGE_PATH"] = os.pathsep.join(filter(None, (str(ROOT), env.get("ROS_PACKAGE_PATH"))))
    env["PYTHONUNBUFFERED"] = "1"
    return env


class _Impatient(Transport):
    """A connection that fails if the other end says nothing, so that the waiting program can look at signals."""

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = _ANSWER_S
        return connection


def answers(master: Child, uri: str) -> bool:
    """Whether this rosmaster answers at its address, and no other one; RunError if another program has the port."""
    for line in master.output():
        if _REFUSED in line:  # after which rosmaster does nothing, and does not end
            raise RunError(f"{master.name}: {line.strip()}; run the same command again")
    with contextlib.suppress(OSError, HTTPException, Error, ExpatError), ServerProxy(
        uri, _Impatient()
    ) as proxy:
        return bool(proxy.getPid("/launcher") == [1, "", master.pid])
    return False
