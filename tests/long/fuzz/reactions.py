"""The long run of driver and emulator: `make reactions MINUTES=n`.  Adds to build/bench/reliability.json.

From 10 minutes on every count is the full one; a shorter run does its share.
"""

import signal
import sys
import time
from typing import Callable, Dict, Iterator, NamedTuple, Tuple

import click

from mrl_driver.errors import MrlError
from tests.long.bench import report
from tests.long.fuzz import reaction_measures as measures

FULL_MINUTES = 10.0
FAILED = "failed"
"""Not a figure, but that a part could not be measured."""


class Part(NamedTuple):
    """One measure, and how often it is repeated in a full run."""

    measure: Callable[[int], Dict[str, float]]
    count: int


PARTS: Tuple[Part, ...] = (
    Part(measures.host_dead, 40),
    Part(measures.source_dead, 40),
    Part(measures.unplugged, 40),
    Part(measures.silent, 20),
    Part(measures.late_moves, 24),
    Part(measures.stalls, 1),
    Part(measures.jumps, 200),
    Part(measures.stamps, 50),
    Part(measures.signals, 100),
    Part(measures.threads, 100000),
    Part(measures.closes, 1000),
)


def run(minutes: float) -> Iterator[Dict[str, float]]:
    """The figures of one part after the other; none of one that fails, which `FAILED` then says."""
    share = min(1.0, minutes / FULL_MINUTES)
    for part in PARTS:
        count = max(report.either(3, 2), round(part.count * share))
        yield attempt(part.measure.__name__, lambda measure=part.measure, count=count: measure(count))
    yield attempt("long_drive", lambda: measures.long_drive(minutes))


def attempt(name: str, measure: Callable[[], Dict[str, float]]) -> Dict[str, float]:
    """What a part measures, with its time on the console; the others go on where it fails."""
    begun_s = time.monotonic()
    try:
        figures = measure()
    except (MrlError, AssertionError) as error:
        click.echo(f"{name} FAILED: {error}", err=True)
        return {FAILED: 1}
    click.echo(f"{name}: {time.monotonic() - begun_s:.0f} s", err=True)
    return figures


@click.command()
@click.option("--minutes", type=click.FloatRange(0.1), default=FULL_MINUTES, show_default=True)
def main(minutes: float) -> None:
    """Measure reactions again and again, then drive on for so long; exit code 1 if a figure misses its goal."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background shells ignore it
    figures = {key: value for part in run(minutes) for key, value in part.items()}
    failed = figures.pop(FAILED, 0)
    sys.exit(report.conclude("reliability", figures) or failed)


if __name__ == "__main__":
    main()
