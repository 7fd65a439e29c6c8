"""The golden request vectors on every board: what is refused is counted by reason, and nothing else is."""

import contextlib
from collections import Counter

from mrl_driver.protocol import Garbage
from tests.vectors import load

from .bench import Bench

VECTORS = load("requests")


def counted(bench, vector):
    if vector.checked:
        bench.ask("set_check", 1)
    bench.send(vector.wire + b"\r\n")
    bench.checked = bench.checked or "32,1," in vector.wire.decode("latin-1")
    found = bench.counters()
    found.pop("unavailable", None)  # a board without the part that a whole request is for
    return found


def test_refusals_are_counted_by_reason(engine, motors):
    for vector in VECTORS:
        refused = Counter(event.reason for event in vector.events_at_line_end if isinstance(event, Garbage))
        with contextlib.closing(Bench(engine, motors)) as bench:
            assert (vector.name, counted(bench.wake(), vector)) == (vector.name, refused)
