"""Figures of build/bench/reliability.json and what they must reach, for `make fuzz` and `make reactions`."""

import math
from typing import Dict, List

import click

from tests.bench import report

GOALS = {
    "wrong_accepted": 0,
    "drive_wrong_accepted": 0,
    "drive_jump_mm_max": 0,
    "lost_byte_wrong_per_million": 30,
    "wrong_accepted_unchecked_1bit_percent": 22,
    "stop_host_dead_ms_max": 300,
    "stop_cmd_source_dead_ms_max": 300,
    "link_loss_noticed_ms_max": 100,
    "silent_noticed_ms_max": 300,
    "reconnect_s_max": 2,
    "late_move_ms_max": 200,
    "odometry_jump_mm_max": 0,
    "stamp_error_ms_p99": 1,
    "signal_stop_ms_max": 100,
    "signal_exit_ms_max": 2000,
    "interleaved_frames": 0,
    "close_ms_max": 1000,
    "soak_memory_growth_mb": 5,
    "soak_lost_frames": 0,
}
"""At most."""
FAILED = "failed_"
"""Begins the name of a part that could not be measured; it is a miss, and no figure."""


def conclude(figures: Dict[str, float]) -> None:
    """Prints the figures beside their goals and adds them to the file; exit code 1 if one misses its goal."""
    missed = misses(figures)
    for key, value in figures.items():
        goal = f"<= {GOALS[key]}" if key in GOALS else ""
        click.echo(f"{key:40}{value:14.2f}  {goal}{'  MISSED' if key in missed else ''}".rstrip())
    done = {key: round(value, 3) for key, value in figures.items() if not key.startswith(FAILED)}
    click.echo(report.write("reliability", done))
    if missed:
        raise SystemExit(1)


def misses(figures: Dict[str, float]) -> List[str]:
    """Keys of the figures that miss their goal; a short run's share of lost bytes may exceed it by chance."""
    missed = [
        key for key, value in figures.items() if key.startswith(FAILED) or value > GOALS.get(key, math.inf)
    ]
    key = "lost_byte_wrong_per_million"
    if key in missed:
        expected = GOALS[key] * figures["lost_byte_frames_tried"] / 1e6
        if figures[key] <= GOALS[key] * (1 + 3 / math.sqrt(expected)):
            missed.remove(key)
    return missed
