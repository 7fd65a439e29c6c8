"""Whether the emulated body tips over: its zero moment point leaves the polygon of its contacts.

The point is where weight and inertia of the centre of mass meet the ground (Vukobratovic and Borovac 2004).
"""

import math
from collections import deque
from typing import Deque, List, Sequence, Tuple

from mrl_driver.geometry import GRAVITY_M_S2

PART_S, PARTS = 0.01, 5
"""An acceleration is the change between the mean speeds of two intervals, each of 5 parts [s].  So a jerk of a few
milliseconds counts little: it rocks a body, but does not tip it over."""
Point = Tuple[float, float]


class Tipping:
    """Follows one body; `moved` takes what `RobotPhysics.report_motion` reports."""

    def __init__(self, contacts: Sequence[Point], centre: Tuple[float, float, float]) -> None:
        """`contacts`: where it touches the ground; `centre`: of its mass, x, y and height above the ground [m]."""
        self._contacts, self._centre = contacts, centre
        self.point: Point = centre[:2]
        """The zero moment point now [m]."""
        self.tips_s = 0.0
        """How long it has been outside the contacts [s]; a real body lies on the ground by then."""
        self.most_m_s2 = 0.0  # largest acceleration of the centre of mass
        self._part = [0.0] * 4
        self._parts: Deque[List[float]] = deque(maxlen=2 * PARTS)

    def moved(self, *motion: float) -> None:
        """The body has moved, see `robot_physics.Moved`."""
        self._part = [total + new for total, new in zip(self._part, motion)]
        if self._part[0] >= PART_S:
            self._parts.append(self._part)
            if len(self._parts) == 2 * PARTS:
                self._evaluate(self._part[0])
            self._part = [0.0] * 4

    def _evaluate(self, dt_s: float) -> None:
        parts = list(self._parts)
        early, late = ([sum(each) for each in zip(*half)] for half in (parts[:PARTS], parts[PARTS:]))
        between_s = (early[0] + late[0]) / 2
        ax, ay, spin = ((new / late[0] - old / early[0]) / between_s for old, new in zip(early[1:], late[1:]))
        vx, vy, turn = ((old + new) / (2 * between_s) for old, new in zip(early[1:], late[1:]))
        x, y, height = self._centre
        ax += -turn * vy - spin * y - turn**2 * x
        ay += turn * vx + spin * x - turn**2 * y
        self.most_m_s2 = max(self.most_m_s2, math.hypot(ax, ay))
        self.point = x - height * ax / GRAVITY_M_S2, y - height * ay / GRAVITY_M_S2
        self.tips_s += 0.0 if self._stands else dt_s

    @property
    def _stands(self) -> bool:
        """No line through the point has all contacts on one side."""
        x, y = self.point
        angles = sorted(math.atan2(to_y - y, to_x - x) for to_x, to_y in self._contacts)
        gaps = [b - a for a, b in zip(angles, [*angles[1:], angles[0] + 2 * math.pi])]
        return max(gaps) <= math.pi
