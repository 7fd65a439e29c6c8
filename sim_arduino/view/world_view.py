"""The world from above with the robot's path: live in a terminal (`mrl-sim --view`), and as a picture (`--plot`)."""

import math
from typing import Any, Iterable, Sequence, Tuple

from mrl_driver import figures
from mrl_driver.figures import BLUE, GREY, ORANGE
from mrl_driver.geometry import Pose
from mrl_driver.terminal.canvas import Canvas, View
from mrl_driver.view.trail import Trail
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.shapes import Wall

PERIOD_S, VIEW_S = 0.05, 0.1
_SOURCES = {"heat": "#d55e00", "gas": "#009e73", "dust": "#999999", "light": "#e69f00"}


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


# ---- in a terminal


def canvas_of(trail: PlantTrail, columns: int, rows: int) -> Canvas:
    """World, path and robots on `rows` lines of `columns` characters."""
    plant = trail.plant
    left, bottom, right, top = frame(plant, trail.poses[-1:])
    scale = min(2 * columns / (right - left), 4 * rows / (top - bottom))
    canvas = Canvas(columns, rows, View((left + right) / 2, (bottom + top) / 2, scale))
    for wall in plant.world.walls:
        canvas.line((wall[:2], wall[2:]), "")
    for pose in trail.poses:
        canvas.dot(pose[:2], "green")
    for mover in plant.world.robots():
        for side in mover.footprint.outline(mover.pose):
            canvas.line((side[:2], side[2:]), "bold")
    canvas.arrow(plant.true_pose)
    return canvas


def numbers(plant: Plant) -> str:
    """True pose and battery as a line of text."""
    pose, state = plant.true_pose, plant.robot.state
    bumped = "  against something" if state.bumped else ""
    return (
        f"x {pose.x_m:+.2f} m  y {pose.y_m:+.2f} m  yaw {math.degrees(pose.yaw_rad):+.0f} deg  "
        f"battery {state.battery_v:.1f} V{bumped}"
    )


class WorldView:
    """Draws a trail on stderr, ten times a second, until it is closed."""

    def __init__(self, trail: PlantTrail) -> None:
        from rich.console import Console
        from rich.live import Live

        self._trail = trail
        self._console = Console(stderr=True)
        self._live: Any = Live(console=self._console, auto_refresh=False, transient=True)
        self._live.start()
        self.due_s = 0.0

    def look(self, now_s: float) -> None:
        """Draw the present state."""
        self.due_s = now_s + VIEW_S
        canvas = canvas_of(
            self._trail, self._console.width - 1, max(1, min(40, self._console.height - 1) - 1)
        )
        text = canvas.text().append(f"\n{numbers(self._trail.plant)}")
        self._live.update(text, refresh=True)

    def close(self) -> None:
        """Restore the terminal."""
        self._live.stop()


# ---- as a picture; needs matplotlib


def draw_picture(trail: PlantTrail, path: str) -> None:
    """Draws world, sources, travelled path and robots to the file `path`."""
    left, bottom, right, top = frame(trail.plant, trail.poses)
    height = 6.0 * min(2.0, max(0.4, (top - bottom) / (right - left)))
    figure = figures.figure(7.0, height + 0.8)
    axes = figure.add_subplot()
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x [m]", ylabel="y [m]", aspect="equal")
    _draw_world(axes, trail)
    if trail.poses:
        _draw_robots(axes, trail)
    axes.legend(loc="upper right", fontsize="small")
    figures.save(figure, path)


def _draw_world(axes: Any, trail: PlantTrail) -> None:
    from matplotlib.patches import Circle

    world = trail.plant.world
    draw_walls(axes, world.walls, "wall")
    for kind, colour in _SOURCES.items():
        for number, source in enumerate(getattr(world.scene, kind)):
            label = kind if number == 0 else None
            place, reach_m = (source.x_m, source.y_m), source.reach_m
            axes.add_patch(Circle(place, reach_m, color=colour, alpha=0.25, label=label))


def _draw_robots(axes: Any, trail: PlantTrail) -> None:
    plant, poses = trail.plant, trail.poses
    label = f"path of {plant.name}, {trail.distance_m:.2f} m"
    axes.plot([p.x_m for p in poses], [p.y_m for p in poses], color=BLUE, linewidth=1.2, label=label)
    axes.plot(*poses[0][:2], "o", color=BLUE, markersize=5, label="start")
    if plant.footprint:
        draw_walls(axes, plant.footprint.outline(plant.true_pose), colour=ORANGE)
    tip = plant.true_pose.compose(0.15, 0.0)
    axes.annotate("", tip[:2], plant.true_pose[:2], arrowprops={"arrowstyle": "->", "color": ORANGE})
    for mover in plant.world.robots(plant.name):
        draw_walls(axes, mover.footprint.outline(mover.pose), colour=GREY)


def draw_walls(
    axes: Any, walls: Iterable[Wall], label: str = "", colour: str = "black", width: float = 1.5
) -> None:
    """Draws walls, or the sides of a robot, with one label for all."""
    for wall in walls:
        axes.plot([wall.x1, wall.x2], [wall.y1, wall.y2], color=colour, linewidth=width, label=label)
        label = ""
