"""Each link of the chain of stops, alone, in simulated time: on the Python board and on the real image."""

import math

import pytest

from .stop_chain import BOARD, DEAD, DRIVER, FAULTS, HUNG, LIFTED, LIMIT_S, PAGE, SERVER, SILENT, stop_times

BOARDS = [("python", 5), ("avr", 2)]
"""Engines, and how many phases between two messages of the page are tried."""
ALONE = [(LIFTED, PAGE), (SILENT, SERVER), (SILENT, DRIVER), (HUNG, DRIVER), (DEAD, BOARD)]


def name(value):
    return getattr(value, "name", None)


@pytest.mark.parametrize("engine, runs", BOARDS)
@pytest.mark.parametrize("fault, link", ALONE, ids=name)
def test_each_link_alone_stops_the_robot_within_300_ms(engine, runs, fault, link):
    assert max(stop_times([link], fault, engine=engine, runs=runs)) <= LIMIT_S


@pytest.mark.parametrize("engine, runs", BOARDS)
def test_all_links_together_stop_it_after_the_first(engine, runs):
    """150 ms without a command, the way of the last one, and that of the stop."""
    assert max(stop_times([PAGE, SERVER, DRIVER, BOARD], SILENT, engine=engine, runs=runs)) <= 0.17


@pytest.mark.parametrize("fault", FAULTS, ids=name)
def test_without_any_link_the_robot_drives_on(fault):
    assert stop_times([], fault, runs=1) == [math.inf]
