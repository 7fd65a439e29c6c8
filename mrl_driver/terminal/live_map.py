"""Map of the robot: its path, its body and its sonars' cones.  No I/O."""

import math
from typing import List, Sequence, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import SonarMount
from mrl_driver.robot.sonar import FIELD_OF_VIEW_RAD, NEAREST_M
from mrl_driver.view.rows import range_style
from mrl_driver.view.shown_state import ShownState

from .canvas import Canvas, Point, fit

_GRIDS_M = (0.5, 1.0, 2.0, 5.0, 10.0)
_LEAST_GRID_COLUMNS = 5
LONGEST_CONE_M = 2.5
"""A cone without an echo within this range is drawn with this length and without an arc [m]."""


def draw(state: ShownState, trail: Sequence[Pose], columns: int, rows: int) -> Tuple[Canvas, float]:
    """Return the drawing, scaled to the path and the sonars' cones, and the step of its grid [m]."""
    pose, model = state.pose, state.model
    mounts = model.sonars if model else {}
    cones = [_Cone(pose, mounts[name], value) for name, value in state.ranges.items() if name in mounts]
    points = [each[:2] for each in (*trail, pose)]
    seen = [*points, *(point for cone in cones for point in cone.corners)]
    canvas = Canvas(columns, rows, fit(seen, columns, rows))
    for cone in cones:
        cone.draw(canvas)
    for start, end in zip(points, points[1:]):
        canvas.line(start, end, "green")
    if model is not None:
        x_m, y_m = model.body.length_m / 2, model.body.width_m / 2
        sides = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))
        corners = [pose.compose(x * x_m, y * y_m)[:2] for x, y in sides]
        for start, end in zip(corners, corners[1:]):
            canvas.line(start, end, "bold")
    canvas.arrow(pose)
    step_m = next(
        (each for each in _GRIDS_M if each * canvas.view.scale >= 2 * _LEAST_GRID_COLUMNS), _GRIDS_M[-1]
    )
    canvas.grid(step_m, "grey37")
    return canvas, step_m


class _Cone:
    """The cone of one sonar: two edges, and an arc at the range of an echo."""

    def __init__(self, pose: Pose, mount: SonarMount, range_m: float) -> None:
        x_m, y_m, middle = pose.compose(*mount.pose)
        self._origin = x_m, y_m
        self._range_m = range_m
        self._length_m = max(NEAREST_M, min(LONGEST_CONE_M, range_m)) if not math.isnan(range_m) else 0.0
        self._from, self._to = middle - FIELD_OF_VIEW_RAD / 2, middle + FIELD_OF_VIEW_RAD / 2

    @property
    def corners(self) -> List[Point]:
        """The two far corners of the cone; empty without a reading."""
        return [self._end(self._from), self._end(self._to)] if self._length_m else []

    def _end(self, angle: float) -> Point:
        x, y = self._origin
        return x + self._length_m * math.cos(angle), y + self._length_m * math.sin(angle)

    def draw(self, canvas: Canvas) -> None:
        """Draw the cone; without a reading there is none."""
        if not self._length_m:
            return
        for angle in (self._from, self._to):
            canvas.line(self._origin, self._end(angle), "blue", every=2)
        if self._range_m <= LONGEST_CONE_M:
            canvas.arc(self._origin, self._length_m, self._from, self._to, range_style(self._range_m))
