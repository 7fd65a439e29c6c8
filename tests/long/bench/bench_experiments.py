"""`make experiments`: the figures of the papers' experiments; build/bench/experiments.json.

The figures have the names `EXPERIMENT.KEY`, with the suffixes `_worst`, `_control` and `_published`.  They are in
simulated time.  FAST=1 takes one seed, and shorter drives.
"""

import importlib
import tempfile
from concurrent.futures import ProcessPoolExecutor
from typing import Any, Dict, Tuple

from sim_arduino.experiments import (
    arena,
    crossing,
    gyro,
    l_course,
    mixed_team,
    power,
    shared_waypoint,
    square,
    step_test,
    tip_over,
)
from sim_arduino.experiments.cli import EXPERIMENTS
from sim_arduino.experiments.experiment_report import Figure
from sim_arduino.experiments.experiment_robot import Setting
from tests.long.bench import report

SHORT: Tuple[Tuple[Any, Dict[str, Any]], ...] = (
    (arena, {"LANE": 8, "EDGE_M": 1.6}),
    (gyro, {"TURNS": 1, "CALIBRATION_LEGS": 2, "CALIBRATION_TURNS": 1}),
    (l_course, {"WAYPOINTS": l_course.WAYPOINTS[:1]}),
    (mixed_team, {"DURATION_S": 5.0, "CONTROL_S": 3.0, "SLIPPING_S": 5.0}),
    (power, {"FASTER": 600.0, "NEAR_END": 60.0}),
    (step_test, {"WAYPOINTS": step_test.WAYPOINTS[:2], "LOOP_POSES": 10}),
    (crossing, {"TIME_LIMIT_S": 10.0}),
    (shared_waypoint, {"ROUNDS": 1, "TIME_LIMIT_S": 8.0}),
    (tip_over, {"DRIVE": tip_over.DRIVE[:4], "COMMAND_S": 1.0}),
    (square, {"LAPS": 2, "SIDE_M": 0.2, "CASES": square.CASES[:2]}),
)
"""What is another with FAST=1."""


def figures_of(name: str) -> Dict[str, Any]:
    module = importlib.import_module(f"sim_arduino.experiments.{EXPERIMENTS[name].module}")
    for shortened, others in SHORT * report.FAST:
        vars(shortened).update(others)
    with tempfile.TemporaryDirectory() as folder:
        rows = module.run(Setting(folder, seeds=report.either(0, 1))).rows
    return {f"{name}.{key}": value for row in rows for key, value in values(row).items()}


def values(row: Figure) -> Dict[str, Any]:
    """A figure's own value and others; of `0 of 10` the first number."""
    found = {row.key: row.ours, f"{row.key}_worst": row.worst, f"{row.key}_control": row.control}
    numbers = {key: _number(value) for key, value in found.items() if value is not None}
    return {**numbers, **({f"{row.key}_published": row.published} if row.published else {})}


def _number(value: Any) -> Any:
    return int(value.split()[0]) if isinstance(value, str) and " of " in value else value


def figures() -> Dict[str, report.Measured]:
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(figures_of, EXPERIMENTS))
    return {key: value for one in found for key, value in one.items()}
