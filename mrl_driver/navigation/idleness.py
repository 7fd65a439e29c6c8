"""How long the waypoints of a patrol are not visited.  No I/O.

The idleness of a waypoint is the time since its last visit (Machado et al. 2002).  At the start it is 0.
"""

from typing import List


class Idleness:
    """Idleness of the waypoints of one robot or of a team.

    Args:
        count: Number of waypoints.
        now_s: Time of the start [s].
    """

    def __init__(self, count: int, now_s: float) -> None:
        self._start_s = now_s
        self._last_s: List[float] = [now_s] * count
        self._area_s2 = self._worst_s = 0.0
        self.visits = 0  # number of visits of all waypoints

    def visit(self, place: int, now_s: float) -> None:
        """A robot has reached the waypoint at this place, from 0."""
        away_s = now_s - self._last_s[place]
        self._last_s[place] = now_s
        self._area_s2 += 0.5 * away_s**2
        self._worst_s = max(self._worst_s, away_s)
        self.visits += 1

    def mean_s(self, now_s: float) -> float:
        """Idleness as the mean of all waypoints and of the time since the start [s]; 0 at the start."""
        area_s2 = self._area_s2 + sum(0.5 * (now_s - last_s) ** 2 for last_s in self._last_s)
        return area_s2 / ((now_s - self._start_s) * len(self._last_s)) if area_s2 else 0.0

    def worst_s(self, now_s: float) -> float:
        """Longest time that a waypoint was not visited [s]."""
        return max([self._worst_s, *(now_s - last_s for last_s in self._last_s)])
