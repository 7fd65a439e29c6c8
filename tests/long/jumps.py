"""Steps of a robot's pose compared with what its wheels can do in the time."""

import math
from typing import Sequence

from mrl_driver.geometry import ORIGIN
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import QUANTUM_COUNTS
from mrl_driver.robot.robot_state import fastest_m_s

SLACK_S = 0.002  # What odometry allows beyond the board's time between two readings [s]


class Jumps:
    """Judges one pose after the other.

    Attributes:
        farthest_m: Largest step beyond the reach of the wheels [m].
    """

    def __init__(self, fastest_m_s: float, quantum_m: float) -> None:
        self._fastest_m_s, self._quantum_m = fastest_m_s, quantum_m
        self.farthest_m = -math.inf
        self.begin_anew()

    @classmethod
    def of(cls, model: RobotModel) -> "Jumps":
        return cls(fastest_m_s(model), QUANTUM_COUNTS * model.base.metres_per_count)

    def begin_anew(self) -> None:
        """Another odometry begins, at the origin."""
        self._pose: Sequence[float] = ORIGIN
        self._refused = 0
        self.restart()

    def restart(self) -> None:
        self.used_s = 0.0

    def see(self, pose: Sequence[float], time_s: float, refused: int = 0) -> float:
        """How far a step went beyond the reach [m]; if its counts were refused, the next may be longer."""
        reach_m = self._fastest_m_s * (time_s - self.used_s + SLACK_S) + self._quantum_m
        jump_m = math.dist(pose[:2], self._pose[:2]) - reach_m
        self.farthest_m = max(self.farthest_m, jump_m)
        if refused == self._refused:
            self.used_s = time_s
        self._pose, self._refused = pose, refused
        return jump_m
