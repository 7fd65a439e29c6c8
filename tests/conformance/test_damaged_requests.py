"""No single damaged byte of a greeting turns a motor: each fault of each of its requests, on each engine.

`driver/test_neighbours.py` does the same with the decoders alone, and with boards of 2013.
"""

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.serve.factory import Options
from tests.neighbours import faults, sent

from .bench import ROBOTS

SETTLED_S = 0.02  # From the last bit of a request to motors that are driven
AS_BEFORE = encode_request(BY_NAME["set_check"].code, 0, checked=True) + b"@19e@16,0e"
"""Undoes what a fault may have turned on."""


def test_a_motor_command_is_noticed(bench):
    bench.send(b"@11,200,0e", SETTLED_S)
    assert bench.is_driven()


@pytest.mark.parametrize("rest", [b"", b"@30e"], ids=["alone", "with another behind it"])
def test_a_fault_of_a_greeting_turns_no_motor(bench, motors, rest):
    for wire in sent(Options(robot=ROBOTS[motors])).greeting:
        for fault in faults(wire):
            bench.send(fault.wire + rest, SETTLED_S)
            assert not bench.is_driven(), fault
            bench.send(AS_BEFORE, SETTLED_S)
