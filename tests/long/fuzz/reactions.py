"""The long run of driver and emulator: `make reactions MINUTES=n`.  Adds to build/bench/reliability.json.

From 10 minutes on every count is the full one; a shorter run does its share.
"""

import signal
import sys
import time
from functools import partial
from typing import Callable, Dict, Iterator

import click

from mrl_driver.errors import MrlError
from tests.long.bench import report
from tests.long.fuzz import reaction_measures as measures

FULL_MINUTES = 10.0
FAILED = "failed"  # Not a figure, but that a part could not be measured
PARTS: Dict[Callable[[int], Dict[str, float]], int] = {
    measures.host_dead: 40,
    measures.source_dead: 40,
    measures.unplugged: 40,
    measures.silent: 20,
    measures.late_moves: 24,
    measures.stalls: 1,
    measures.jumps: 200,
    measures.stamps: 50,
    measures.signals: 100,
    measures.threads: 100000,
    measures.closes: 1000,
}
"""How often each is repeated in a full run."""


def run(minutes: float) -> Iterator[Dict[str, float]]:
    """The figures of one part after the other; none of one that fails, which `FAILED` then says."""
    share = min(1.0, minutes / FULL_MINUTES)
    parts = [
        partial(measure, max(report.either(3, 2), round(count * share))) for measure, count in PARTS.items()
    ]
    for part in (*parts, partial(measures.long_drive, minutes)):
        begun_s = time.monotonic()
        try:
            yield part()
        except (MrlError, AssertionError) as error:
            click.echo(f"{part.func.__name__} FAILED: {error}", err=True)
            yield {FAILED: 1}
        click.echo(f"{part.func.__name__}: {time.monotonic() - begun_s:.0f} s", err=True)


@click.command()
@click.option("--minutes", type=click.FloatRange(0.02), default=FULL_MINUTES, show_default=True)
def main(minutes: float) -> None:
    """Measure reactions again and again, then drive on for so long; exit code 1 if a figure misses its goal."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background shells ignore it
    figures = {key: value for part in run(minutes) for key, value in part.items()}
    failed = figures.pop(FAILED, 0)
    sys.exit(report.conclude("reliability", figures) or failed)


if __name__ == "__main__":
    main()
