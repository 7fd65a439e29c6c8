"""The golden request vectors on every board: what is refused is counted by reason, and nothing else is."""

from collections import Counter

import pytest

from mrl_driver.protocol import Garbage
from tests.vectors import load

VECTORS = load("requests")


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector.name)
def test_refusals_are_counted_by_reason(bench, vector):
    if vector.checked:
        bench.ask("set_check", 1)
    bench.send(vector.wire + b"\r\n")
    bench.checked = bench.checked or "32,1," in vector.wire.decode("latin-1")
    refused = Counter(event.reason for event in vector.events_at_line_end if isinstance(event, Garbage))
    assert bench.counters() == refused
