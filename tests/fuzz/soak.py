"""The long run of driver and emulator: `make soak MINUTES=n`.  Adds to build/bench/reliability.json.

From 10 minutes on every count is the full one; a shorter run does its share.
"""

import time
from typing import Callable, Dict, NamedTuple, Tuple

import click

from tests.bench import report
from tests.fuzz import soak_measures as measures

FULL_MINUTES = 10.0


class Part(NamedTuple):
    """One measure, and how often it is repeated in a full run."""

    measure: Callable[[int], Dict[str, float]]
    count: int


PARTS: Tuple[Part, ...] = (
    Part(measures.host_dead, 40),
    Part(measures.source_dead, 40),
    Part(measures.unplugged, 40),
    Part(measures.silent, 20),
    Part(measures.jumps, 200),
    Part(measures.stamps, 50),
    Part(measures.signals, 100),
    Part(measures.threads, 100000),
    Part(measures.closes, 1000),
)
GOALS = {
    "stop_host_dead_ms_max": 300,
    "stop_cmd_source_dead_ms_max": 300,
    "link_loss_noticed_ms_max": 100,
    "silent_noticed_ms_max": 300,
    "reconnect_s_max": 2,
    "odometry_jump_mm_max": 0,
    "stamp_error_ms_p99": 1,
    "signal_stop_ms_max": 100,
    "signal_exit_ms_max": 2000,
    "interleaved_frames": 0,
    "close_ms_max": 1000,
    "soak_memory_growth_mb": 5,
    "soak_lost_frames": 0,
}


def run(minutes: float) -> Dict[str, float]:
    """All figures."""
    share = min(1.0, minutes / FULL_MINUTES)
    figures: Dict[str, float] = {}
    for part in PARTS:
        begun_s = time.monotonic()
        count = max(3, round(part.count * share))
        figures.update(part.measure(count))
        took_s = time.monotonic() - begun_s
        click.echo(f"{part.measure.__name__} {count} times: {took_s:.0f} s", err=True)
    figures.update(measures.long_drive(minutes))
    return figures


@click.command()
@click.option("--minutes", type=click.FloatRange(0.1), default=FULL_MINUTES, show_default=True)
def main(minutes: float) -> None:
    """Measure reactions again and again, then drive on for so long; exit code 1 if a figure misses its goal."""
    figures = run(minutes)
    for key, value in figures.items():
        goal = GOALS.get(key)
        verdict = "" if goal is None else f"<= {goal}{'' if value <= goal else '  MISSED'}"
        click.echo(f"{key:32}{value:12.2f}  {verdict}".rstrip())
    click.echo(report.write("reliability", {key: round(value, 3) for key, value in figures.items()}))
    if any(value > GOALS.get(key, value) for key, value in figures.items()):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
