"""Requests that are refused: the golden vectors, and each damaged byte of a greeting, on every board.

`driver/test_neighbours.py` damages them for the decoders alone, and for boards of 2013.
"""

import contextlib
from collections import Counter

from mrl_driver.protocol import Frame, Garbage, encode_request
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.serve.factory import Options
from tests.conftest import EXPLORE
from tests.neighbours import faults, sent
from tests.vectors import load

from .bench import ROBOTS, Bench

VECTORS = load("requests")


def counted(bench, vector):
    if vector.checked:
        bench.ask("set_check", 1)
    bench.send(vector.wire + b"\r\n")
    assert not bench.is_driven() or any(isinstance(event, Frame) for event in vector.events), vector
    bench.checked = bench.checked or "32,1," in vector.wire.decode("latin-1")
    found = bench.counters()
    found.pop("unavailable", None)  # a board without the part that a whole request is for
    return found


def test_refusals_are_counted_by_reason(engine, motors):
    for vector in VECTORS:
        refused = Counter(event.reason for event in vector.events_at_line_end if isinstance(event, Garbage))
        with contextlib.closing(Bench(engine, motors)) as bench:
            assert (vector.name, counted(bench.wake(), vector)) == (vector.name, refused)


EVERY = {"python": 1, "pc": 3, "avr": 19}
"""Of the faults of a greeting, of which a byte has 11, each engine gets every so many; with a seed all."""
SETTLED_S = 0.02  # From the last bit of a request to motors that are driven
AS_BEFORE = encode_request(BY_NAME["set_check"].code, 0, checked=True) + b"@19e@16,0e"
"""Undoes what a fault may have turned on."""


def test_a_motor_command_is_noticed(bench):
    bench.send(b"@11,200,0e", SETTLED_S)
    assert bench.is_driven()


def test_a_fault_of_a_greeting_turns_no_motor(bench, engine, motors):
    """Alone, and with others behind it."""
    for wire in sent(Options(robot=ROBOTS[motors])).greeting:
        for fault in list(faults(wire))[:: 1 if EXPLORE else EVERY[engine]]:
            for sent_next in (fault.wire, AS_BEFORE):
                bench.send(sent_next, SETTLED_S)
                assert not bench.is_driven(), fault
