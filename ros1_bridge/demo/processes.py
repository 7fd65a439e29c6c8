"""Child processes that end with their parent; each has a log."""

import ctypes
import os
import re
import signal
import subprocess
import time
from pathlib import Path
from typing import Callable, Dict, List, Optional, Sequence

_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True)
_POLL_S = 0.02
_ORDERS = re.compile(r"\x1b\[[\d;]*m|\x1b\]2;.*?\x07")
"""Colours and window titles, which roslaunch prints into its log as well."""
_NO_WORDS = ("", "The traceback for the exception was written to the log file")
"""Last lines that say nothing: rulers, and what roslaunch prints after its error."""


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
