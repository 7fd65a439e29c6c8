"""Programs that a long run starts, asks, hangs and kills; each carries a mark, so that none is left behind unseen."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

from tests.waiting import wait_until

MARK = "MRL_SOAK"
ROOT = Path(__file__).resolve().parents[2]


class Program:
    """A child that takes orders on stdin and answers in JSON on stdout; what it says on stderr goes to `log`."""

    def __init__(self, command: Sequence[str], log: Path, env: Optional[Mapping[str, str]] = None) -> None:
        self.said: List[Tuple[float, Dict[str, Any]]] = []
        self.log = log
        with log.open("ab") as errors:
            self.process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**(env or os.environ), MARK: str(os.getpid()), "PYTHONPATH": str(ROOT)},
                cwd=str(ROOT),
                # When the shell that started the soak ends, the kernel continues the stopped programs of its group.
                start_new_session=True,
            )
        self._reader = threading.Thread(target=self._read, daemon=True, name="soak reader")
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with suppress(ValueError):
                self.said.append((time.monotonic(), json.loads(line)))

    def heard(self, key: str, value: Any, since_s: float = 0.0) -> Optional[Dict[str, Any]]:
        """The first answer with this value since then; None if there is none."""
        for at_s, answer in list(self.said):
            if at_s >= since_s and answer.get(key) == value:
                return answer
        return None

    def await_word(self, key: str, value: Any, since_s: float = 0.0) -> Dict[str, Any]:
        """Wait for such an answer.

        Raises:
            AssertionError: it did not come, or the program has ended.
        """
        wait_until(
            lambda: self.heard(key, value, since_s) or self.process.poll() is not None,
            step_s=0.005,
            what=f"{key} {value!r}",
        )
        answer = self.heard(key, value, since_s)
        assert answer is not None, f"the program ended with {self.process.poll()}, see {self.log}"
        return answer

    def send(self, order: str) -> None:
        """Give an order, without waiting for its end."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.write(order.encode() + b"\n")
            self.process.stdin.flush()

    def ask(self, order: str) -> Dict[str, Any]:
        """Give an order, and wait for its answer."""
        begun_s = time.monotonic()
        del self.said[:-100]
        self.send(order)
        return self.await_word("done", order.split()[0], begun_s)

    def send_signal(self, number: int) -> float:
        """Send a signal; when."""
        sent_s = time.monotonic()
        if self.process.poll() is None:
            self.process.send_signal(number)
        return sent_s

    def end(self, number: int = signal.SIGKILL, patience_s: float = 10.0) -> float:
        """Send a signal, and wait for the end; seconds from one to the other."""
        sent_s = self.send_signal(number)
        self.process.send_signal(signal.SIGCONT)
        try:
            self.process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        took_s = time.monotonic() - sent_s
        self._reader.join(5.0)
        for pipe in (self.process.stdin, self.process.stdout):
            with suppress(BrokenPipeError, OSError):
                pipe.close()  # type: ignore[union-attr]
        return took_s


def holds(pid: int) -> Dict[str, int]:
    """What a process holds: memory in RAM [kB], descriptors, threads."""
    status = Path(f"/proc/{pid}/status").read_text().splitlines()
    fields = dict(line.split(":", 1) for line in status)
    return {
        "memory_kb": int(fields["VmRSS"].split()[0]),
        "descriptors": len(os.listdir(f"/proc/{pid}/fd")),
        "threads": int(fields["Threads"]),
    }


def left_behind() -> List[str]:
    """Command lines of the processes that carry this soak's mark and still run."""
    mark, found = f"{MARK}={os.getpid()}".encode(), []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit() and int(folder.name) != os.getpid():
            with suppress(OSError):
                if mark in (folder / "environ").read_bytes().split(b"\0"):
                    words = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode("utf-8", "replace")
                    if words:
                        found.append(f"{folder.name} {words.strip()}")
    return found


PYTHON = sys.executable
