"""Reading single keys from a terminal, without Enter."""

import contextlib
import os
import re
import select
import sys
import termios
import tty
from typing import Any, List, Optional

from mrl_driver.clocks import clock_s

_KEY = re.compile(rb"\x1b(?:O[!-~]|\[\[[A-E]|\[[0-?]*[!-/@-~])|.", re.DOTALL)
"""A key is a byte, or a sequence such as `ESC [ D` (left), `ESC [ 1 ; 2 D` (left with Shift), `ESC [ 7 $` (rxvt) and
`ESC [ [ A` (F1 of Linux's console).  A space ends what was begun: it is the stop, and never part of a key."""
_BEGUN = re.compile(rb"\x1b(?:O|\[\[?[0-?]*)\Z")
_ESCAPE_S = 0.05  # the rest of a sequence arrives within this time after its ESC, or the key is Escape [s]
_ARROWS = {b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left"}
_NO_KEY = b"\0"  # POSIX's _POSIX_VDISABLE on Linux
_NAMES = {b" ": "space", b"\x1b": "escape"}


def split(data: bytes) -> List[str]:
    """Return the names of the keys in a terminal's bytes: `up down left right space escape`, or the letter.

    Other keys with a sequence, such as Home, keep it as their name: no letter of it is a key.
    """
    keys = (key.replace(b"\x1bO", b"\x1b[") for key in _KEY.findall(data))
    return [_ARROWS.get(key) or _NAMES.get(key) or key.decode("ascii", "replace").lower() for key in keys]


class Keyboard:
    """Reads keys from stdin inside a `with` block, which restores the terminal's settings at its end.

    If stdin is not a terminal, no key is ever pressed.
    Ctrl-Z is a key as any other and does not suspend the program: the shell would get the terminal as it is here.

    Attributes:
        pressed_s: earliest time at which the keys that `read` returned last may have reached the terminal
            [s, `clock_s`]: when the `read` before it looked for keys, if they waited already.
    """

    def __init__(self) -> None:
        self.pressed_s = self._looked_s = clock_s()
        self._fds = [sys.stdin.fileno()] if sys.stdin.isatty() else []
        self._settings: Optional[List[Any]] = None
        self._begun = b""  # a sequence whose rest has not arrived

    def __enter__(self) -> "Keyboard":
        for fd in self._fds:
            self._settings = termios.tcgetattr(fd)
            tty.setcbreak(fd)
            changed = termios.tcgetattr(fd)
            changed[6][termios.VSUSP] = _NO_KEY
            termios.tcsetattr(fd, termios.TCSANOW, changed)
        return self

    def __exit__(self, *_: object) -> None:
        if self._settings is not None:
            with contextlib.suppress(termios.error):  # the terminal was closed
                termios.tcsetattr(self._fds[0], termios.TCSADRAIN, self._settings)

    def read(self, timeout_s: float) -> List[str]:
        """Return the keys pressed, after waiting at most `timeout_s` for the first; `q` if the terminal was closed."""
        self.pressed_s, self._looked_s = self._looked_s, clock_s()
        ready, _, _ = select.select(self._fds, [], [], 0)
        if not ready:
            ready, _, _ = select.select(self._fds, [], [], timeout_s)
            # A program that is suspended while it waits does not count a key of that time as pressed now.
            self.pressed_s = self._looked_s = min(clock_s(), self._looked_s + timeout_s)
        return self._keys(ready[0]) if ready else []

    def _keys(self, fd: int) -> List[str]:
        """Return the keys whose bytes have arrived; a sequence may be cut, by `os.read` or by a slow network."""
        data = os.read(fd, 64)
        if not data:
            return ["q"]
        data = self._begun + data
        if data.endswith(b"\x1b") and select.select([fd], [], [], _ESCAPE_S)[0]:
            data += os.read(fd, 64)
        begun = _BEGUN.search(data)
        self._begun = begun[0] if begun else b""
        return split(data[: len(data) - len(self._begun)])
