"""Goals in the emulated worlds, and their judgement by ground truth.  No ROS."""

import math
import statistics
from typing import Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.geometry import Pose
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World

Goal = Tuple[float, float, float]
"""x, y in the world [m], yaw [deg]."""
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
ROBOTS = ("traxbot", "stingbot", "omni")
LIMIT_S = 180.0
"""A goal takes longer than this only if the robot is stuck: the longest way in the house is 8 m."""
REACHED_M = 0.25
"""A robot this near to the goal in truth is there: planner's tolerance 0.1 m, and localisation."""
CONTACT_M = 0.005
"""A wall nearer to the body than this counts as touched."""


class Outcome(NamedTuple):
    """How one goal ended."""

    succeeded: bool
    """What the action said."""
    error_m: float
    """True distance to the goal at the end."""
    contact: bool
    """The body touched something on the way."""
    seconds: float

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

    def see(self, pose: Pose) -> None:
        """Take the next true pose; `contact` stays true until it is set false."""
        self.pose = pose
        self.contact = self.contact or bool(self._world.touching(pose, self._body))

    def distance_m(self, goal: Goal) -> float:
        return math.hypot(self.pose.x_m - goal[0], self.pose.y_m - goal[1])


def row_of(robot: str, world: str, outcomes: Sequence[Outcome]) -> Dict[str, object]:
    """The figures of one robot in one world; the error is that of the goals that were reached."""
    errors = [outcome.error_m for outcome in outcomes if outcome.reached]
    return {
        "robot": robot,
        "world": world,
        "goals": len(outcomes),
        "reached": len(errors),
        "mean_error_cm": round(100 * statistics.mean(errors), 1) if errors else None,
        "contacts": sum(outcome.contact for outcome in outcomes),
        "mean_seconds": round(statistics.mean(outcome.seconds for outcome in outcomes), 1),
    }


def table_of(rows: Sequence[Dict[str, object]]) -> str:
    lines: List[str] = ["| robot, world | reached | mean error | goals with contact |", "|---|---|---|---|"]
    for row in rows:
        error = "" if row["mean_error_cm"] is None else f"{row['mean_error_cm']} cm"
        place = f"{row['robot']}, `{row['world']}`"
        lines.append(f"| {place} | {row['reached']} of {row['goals']} | {error} | {row['contacts']} |")
    return "\n".join(lines)
