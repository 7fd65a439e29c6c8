"""Goals in the emulated worlds, and their judgement by ground truth.  No ROS."""

import math
import statistics
from typing import Any, Dict, Iterable, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import Pose, wrap_angle
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World

Goal = Tuple[float, float, float]  # x, y in the world [m], yaw [deg]
GOALS: Dict[str, Sequence[Goal]] = {
    "room": [
        (1.2, 0.0, 0),
        (1.2, 1.2, 90),
        (-1.2, 1.2, 180),
        (-1.2, -1.2, -90),
        (0.0, 0.0, 0),
        (1.2, -1.2, 45),
        (0.0, 1.3, 0),
        (-1.3, 0.0, 180),
        (0.0, -1.3, -90),
        (0.5, 0.5, 0),
    ],
    "house": [  # each way but two leads through one or two doors
        (4.5, 1.0, 0),
        (5.3, 3.2, 90),
        (1.6, 3.2, 180),
        (2.4, 0.6, 0),
        (2.0, 4.4, 90),
        (3.3, 3.1, 0),
        (3.8, 1.6, -90),
        (1.5, 1.4, 180),
        (5.2, 1.5, 90),
        (0.8, 0.8, 0),
    ],
}
ROBOTS = ("traxbot", "stingbot", "omni", "duo")
SENSORS = ("laser", "sonars", "both")
LIMIT_S = 180.0
"""A goal takes longer than this only if the robot is stuck: the longest way in the house is 8 m."""
REACHED_M = 0.25
"""A robot this near to the goal in truth is there: planner's tolerance 0.1 m, and localisation."""
CONTACT_M = 0.005  # A wall nearer to the body than this counts as touched


class Outcome(NamedTuple):
    """How one goal ended."""

    succeeded: bool  # What the action said
    error_m: float  # True distance to the goal at the end
    turn_deg: float  # True error of the heading at the end
    contact: bool  # The body touched something on the way
    seconds: float
    recoveries: int  # Times that move_base began to recover

    @property
    def reached(self) -> bool:
        """The action succeeded, and the robot is there."""
        return self.succeeded and self.error_m <= REACHED_M


class Judge:
    """Sees the true poses of a robot."""

    def __init__(self, world: World, body: Footprint) -> None:
        self._world = world
        margin = 2 * CONTACT_M
        self._body = Footprint(body.length_m + margin, body.width_m + margin, body.is_circle)
        self.pose = Pose(math.nan, math.nan, math.nan)
        self.contact = False
        self.recoveries = 0

    def see(self, pose: Pose) -> None:
        """Take the next true pose; `contact` stays true until it is set false."""
        self.pose = pose
        self.contact = self.contact or bool(self._world.touching(pose, self._body))

    def recover(self) -> None:
        """Count a recovery of move_base."""
        self.recoveries += 1

    def errors(self, goal: Goal) -> Tuple[float, float]:
        """Distance [m] and difference of heading [deg] to a goal."""
        turn = wrap_angle(self.pose.yaw_rad - math.radians(goal[2]))
        return math.hypot(self.pose.x_m - goal[0], self.pose.y_m - goal[1]), abs(math.degrees(turn))


def row_of(run: Dict[str, Any], outcomes: Sequence[Outcome]) -> Dict[str, object]:
    """The figures of a run with this robot, world and sensors; the errors are those of the goals that were reached."""
    reached = [outcome for outcome in outcomes if outcome.reached]

    def mean(values: Iterable[float]) -> Optional[float]:
        each = list(values)
        return round(statistics.mean(each), 1) if each else None

    return {
        **run,
        "goals": len(outcomes),
        "reached": len(reached),
        "mean_error_cm": mean(100 * outcome.error_m for outcome in reached),
        "mean_error_deg": mean(outcome.turn_deg for outcome in reached),
        "contacts": sum(outcome.contact for outcome in outcomes),
        "recoveries": sum(outcome.recoveries for outcome in outcomes),
        "mean_seconds": mean(outcome.seconds for outcome in outcomes),
    }


FIGURES = {
    "reached": "reached",
    "cm": "mean_error_cm",
    "deg": "mean_error_deg",
    "s": "mean_seconds",
    "contacts": "contacts",
    "recoveries": "recoveries",
}


def figures_of(row: Dict[str, Any]) -> Dict[str, float]:
    """Figures of a run, by key; none of one with other arguments than `clear_range`, or of what no goal has given."""
    run, cap = (
        "_".join((row["robot"], row["world"], row["sensors"])) + "_busy" * bool(row["busy"]),
        row["more"].replace("clear_range:=", "_cap_"),
    )
    kept = row["more"] == "" or cap.startswith("_cap_") and " " not in cap
    return {f"{run}{cap}_{unit}": row[key] for unit, key in FIGURES.items() if kept and row[key] is not None}


def table_of(rows: Sequence[Dict[str, object]]) -> str:
    """The rows in Markdown."""
    keys = list(rows[0])
    lines = [keys, ["---"] * len(keys), *([str(row[key]) for key in keys] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
