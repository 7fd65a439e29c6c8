"""The long run of driver and emulator: `make soak MINUTES=n`.  Adds to build/bench/reliability.json.

From 10 minutes on every count is the full one; a shorter run does its share.
"""

import time
from typing import Callable, Dict, NamedTuple, Tuple

import click

from tests.fuzz import goals
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
    goals.conclude(run(minutes))


if __name__ == "__main__":
    main()
