"""Speeds from the keys of a terminal.  No I/O."""

import math
from typing import Dict, List, Tuple

HOLD_S = 0.6
"""A press lasts this long [s].  A terminal reports presses but not releases, and a held key repeats after about 0.5 s.
"""
LINEAR_M_S, ANGULAR_RAD_S = 0.25, 0.9
_LETTERS = {"w": "up", "s": "down", "a": "left", "d": "right"}
_DIRECTIONS: Dict[str, Tuple[float, float]] = {
    "up": (1, 0),
    "down": (-1, 0),
    "left": (0, 1),
    "right": (0, -1),
}
_SIDEWAYS = {",": 1, ".": -1}  # sideways motion, if the robot can: `,` to the left, `.` to the right
_OPPOSITES = {"up": "down", "down": "up", "left": "right", "right": "left", ",": ".", ".": ","}


class Teleop:
    """Speeds from key names: each press drives for `HOLD_S`; two directions together drive a curve."""

    def __init__(self) -> None:
        self._until_s: Dict[str, float] = {}

    def press(self, key: str, now_s: float) -> bool:
        """Handle a key; return True if it commands a motion or, as the space bar, a stop."""
        if key == "space":
            self._until_s.clear()
            return True
        direction = _LETTERS.get(key, key)
        if direction not in _DIRECTIONS and direction not in _SIDEWAYS:
            return False
        self._until_s.pop(_OPPOSITES[direction], None)
        self._until_s[direction] = now_s + HOLD_S
        return True

    @staticmethod
    def moves(key: str, sideways: bool = False) -> bool:
        """Return whether the key drives a robot; `sideways` is True if the robot can move sideways."""
        return _LETTERS.get(key, key) in _DIRECTIONS or (sideways and key in _SIDEWAYS)

    def command(self, now_s: float) -> Tuple[float, float]:
        """Return the speeds (linear [m/s], angular [rad/s]) at a time; zero if no key is held."""
        held = [_DIRECTIONS[key] for key in self._held(now_s) if key in _DIRECTIONS]
        linear, angular = math.fsum(d[0] for d in held), math.fsum(d[1] for d in held)
        return linear * LINEAR_M_S, angular * ANGULAR_RAD_S

    def slide(self, now_s: float) -> float:
        """Return the speed to the left at a time [m/s], for robots that can; 0 if no key is held."""
        return LINEAR_M_S * sum(_SIDEWAYS.get(key, 0) for key in self._held(now_s))

    def _held(self, now_s: float) -> List[str]:
        return [key for key, until_s in self._until_s.items() if now_s < until_s]
