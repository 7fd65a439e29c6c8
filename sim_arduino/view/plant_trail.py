"""The path that an emulated robot has travelled, for pictures."""

from typing import Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.view.trail import Trail
from sim_arduino.hardware.wiring import Plant

PERIOD_S = 0.05


class PlantTrail(Trail):
    """True poses of a robot while it moves; `due_s` is the time of the next look [s]."""

    def __init__(self, plant: Plant) -> None:
        super().__init__()
        self.plant = plant
        self.due_s = 0.0

    def look(self, now_s: float) -> None:
        """Store the robot's pose if it has moved."""
        self.due_s = now_s + PERIOD_S
        self.add(self.plant.true_pose)


def frame(plant: Plant, poses: Sequence[Pose], margin_m: float = 0.2) -> Tuple[float, float, float, float]:
    """Left, bottom, right and top of a picture that shows the world and all poses [m]."""
    left, bottom, right, top = plant.world.bounds()
    xs, ys = [left, right, *(p.x_m for p in poses)], [bottom, top, *(p.y_m for p in poses)]
    return min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m
