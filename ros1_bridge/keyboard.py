"""Keys of a terminal, and the speeds they ask for."""

import math
import os
import select
import sys
import termios
import tty
from typing import Any, Dict, List, Optional, Tuple

_SEQUENCES = {
    "\x1b[A": "w",
    "\x1b[B": "s",
    "\x1b[C": "d",
    "\x1b[D": "a",
    "\x1bOA": "w",
    "\x1bOB": "s",
    "\x1bOC": "d",
    "\x1bOD": "a",
}
"""Arrow keys in both of a terminal's modes."""
HOLD_S = 0.6
"""A terminal reports presses, not releases; a held key repeats after about 0.5 s, so a press lasts longer."""
LINEAR_M_S, ANGULAR_RAD_S = 0.25, 0.9
_DIRECTIONS: Dict[str, Tuple[float, float]] = {"w": (1, 0), "s": (-1, 0), "a": (0, 1), "d": (0, -1)}


def split(text: str) -> List[str]:
    """Keys in what a terminal sent; arrows come back as w, a, s, d, other escape sequences as nothing."""
    keys = []
    while text:
        size = 3 if text[0] == "\x1b" and text[1:2] in ("[", "O") else 1
        keys.append(_SEQUENCES.get(text[:3]) if size == 3 else text[0].lower())
        text = text[size:]
    return [key for key in keys if key and key != "\x1b"]


class Teleop:
    """Speeds from keys: each press drives for `HOLD_S`, w and a pressed in turn drive a curve."""

    def __init__(self) -> None:
        self._until_s: Dict[str, float] = {}

    def press(self, key: str, now_s: float) -> bool:
        """Take a key; True if it asks for a movement or, as the space bar, for a stop."""
        if key == " ":
            self._until_s.clear()
            return True
        if key not in _DIRECTIONS:
            return False
        opposite = {"w": "s", "s": "w", "a": "d", "d": "a"}[key]
        self._until_s.pop(opposite, None)
        self._until_s[key] = now_s + HOLD_S
        return True

    def command(self, now_s: float) -> Tuple[float, float]:
        """Speeds (linear [m/s], angular [rad/s]) at a time; zero once every key is released."""
        held = [_DIRECTIONS[key] for key, until_s in self._until_s.items() if now_s < until_s]
        linear, angular = math.fsum(d[0] for d in held), math.fsum(d[1] for d in held)
        return linear * LINEAR_M_S, angular * ANGULAR_RAD_S


class Keyboard:
    """The terminal's keys without waiting for a line; use as a context, which gives the terminal back."""

    def __init__(self) -> None:
        self._fd = sys.stdin.fileno()
        self._saved: Optional[List[Any]] = None

    def __enter__(self) -> "Keyboard":
        self._saved = termios.tcgetattr(self._fd)
        tty.setcbreak(self._fd)
        return self

    def __exit__(self, *_: object) -> None:
        if self._saved is not None:
            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._saved)

    def read(self, timeout_s: float) -> List[str]:
        """Keys pressed since the last call; waits up to `timeout_s` for a first one."""
        if not select.select([self._fd], [], [], timeout_s)[0]:
            return []
        return split(os.read(self._fd, 1024).decode("utf-8", "replace"))
