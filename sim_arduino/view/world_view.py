"""`mrl-sim --view`: the world from above, live in a terminal."""

import math
from typing import Any

from mrl_driver.terminal.canvas import Canvas, View
from sim_arduino.hardware.wiring import Plant

from .plant_trail import PlantTrail, frame

VIEW_S = 0.1


def draw(trail: PlantTrail, columns: int, rows: int) -> Canvas:
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
        canvas = draw(self._trail, self._console.width - 1, max(1, min(40, self._console.height - 1) - 1))
        text = canvas.text().append(f"\n{numbers(self._trail.plant)}")
        self._live.update(text, refresh=True)

    def close(self) -> None:
        """Restore the terminal."""
        self._live.stop()
