"""`mrl` as a process: on a terminal of its own, or where no file may grow any more."""

import contextlib
import os
import pty
import re
import subprocess
import sys
import threading

from tests.waiting import PATIENCE_S, wait_until

MRL = [sys.executable, "-m", "mrl_driver"]
_COLOURS = re.compile(r"\x1b\[[\d;?]*[A-Za-z]")
# No .pyc is written: one that is cut off would break every later import of its module.
_FULL = "import resource, sys; sys.dont_write_bytecode = True; resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0})); "


class Terminal:
    """A command of `mrl` on a terminal, which takes what it shows until `stalled` is set."""

    def __init__(self, *args, mrl=MRL, folder=".", term="xterm"):
        self.pid, self._fd = pty.fork()
        if self.pid == 0:
            os.environ["TERM"] = term
            os.chdir(folder)
            os.execv(mrl[0], [*map(str, (*mrl, *args))])
        self.seen = bytearray()
        self.stalled = threading.Event()
        self._reader = threading.Thread(target=self._drain, daemon=True)
        self._reader.start()

    def _drain(self):
        with contextlib.suppress(OSError):
            while not self.stalled.is_set():
                self.seen += os.read(self._fd, 65536)

    def press(self, keys):
        os.write(self._fd, keys)

    def wait_for(self, pattern, keys=b"", timeout_s=30.0):
        """The match of a pattern in what it has shown, without colours; the keys are pressed until then."""

        def match():
            running = self._reader.is_alive()
            shown = _COLOURS.sub("", self.seen.decode(errors="replace"))
            found = re.search(pattern, shown)
            assert found or running, f"expected {pattern!r}, got {shown!r}"
            if keys and not found:
                self.press(keys)
            return found

        return wait_until(match, timeout_s, step_s=0.05, what=repr(pattern))

    def answer(self, question, words):
        """Wait for a question, and type an answer."""
        self.wait_for(re.escape(question))
        self.press(words.encode() + b"\n")

    def end(self, number=0):
        """Wait for the end, after a signal if need be; the exit code, negative for a signal's."""
        if number:
            os.kill(self.pid, number)
        _, status = os.waitpid(self.pid, 0)
        if not self.stalled.is_set():
            self._reader.join(PATIENCE_S)
        os.close(self._fd)
        return os.WEXITSTATUS(status) if os.WIFEXITED(status) else -os.WTERMSIG(status)


def on_a_full_disk(most_bytes, module, *args, folder="."):
    """Run a command whose files cannot grow beyond so many bytes; it as `subprocess.run` has it."""
    code = _FULL.format(most_bytes)
    code += f"sys.argv[0] = {module!r}; import runpy; runpy.run_module({module!r}, run_name='__main__')"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, args)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
