"""`mrl-sim --plot`: the world from above with the robot's path, as PNG, PDF or SVG.  Needs matplotlib."""

from typing import Any

from mrl_driver import figures
from mrl_driver.figures import BLUE, GREY, ORANGE
from sim_arduino.world.shapes import Wall

from .plant_trail import PlantTrail, frame

_SOURCES = {"heat": "#d55e00", "gas": "#009e73", "dust": "#999999", "light": "#e69f00"}


def draw(trail: PlantTrail, path: str) -> None:
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
    for number, wall in enumerate(world.walls):
        _line(axes, wall, "black", "wall" if number == 0 else None)
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
        for side in plant.footprint.outline(plant.true_pose):
            _line(axes, side, ORANGE)
    tip = plant.true_pose.compose(0.15, 0.0)
    axes.annotate("", tip[:2], plant.true_pose[:2], arrowprops={"arrowstyle": "->", "color": ORANGE})
    for mover in plant.world.robots(plant.name):
        for side in mover.footprint.outline(mover.pose):
            _line(axes, side, GREY)


def _line(axes: Any, wall: Wall, colour: str, label: Any = None) -> None:
    axes.plot([wall.x1, wall.x2], [wall.y1, wall.y2], color=colour, linewidth=1.5, label=label)
