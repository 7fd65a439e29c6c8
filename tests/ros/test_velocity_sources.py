"""Which sources may move the robot after a stop, and at the start of the node; in stepped time."""

import gc
import tracemalloc

import pytest

from mrl_driver.protocol.stop_reason import StopReason
from ros1_bridge.control.velocity_sources import Source, VelocitySources

NONE, TOO_LATE = StopReason.NONE, StopReason.COMMAND_TOO_LATE
PAUSE_S, STEP_S = 0.5, 0.05
PLANNER, HAND = Source("/move_base"), Source("/joystick")


class Bench:
    def __init__(self, pause_s=PAUSE_S):
        self.sources, self.now_s = VelocitySources(pause_s), 100.0

    def sends(self, seconds, *sources):
        """The sources send a command to move at each step; which answers they got."""
        answers = set()
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            answers |= {(source, self.sources.may_move(source, self.now_s) is NONE) for source in sources}
        return answers


@pytest.fixture
def bench():
    return Bench()


def test_source_that_goes_on_after_a_stop_moves_nothing_however_long_it_goes_on(bench):
    assert bench.sends(1.0, PLANNER) == {(PLANNER, True)}
    bench.sources.distrust()
    assert bench.sends(100.0, PLANNER, HAND) == {(PLANNER, False), (HAND, True)}


def test_pause_before_the_stop_was_released_counts(bench):
    bench.sends(1.0, HAND)
    bench.now_s += 10.0
    bench.sources.distrust()
    assert bench.sends(STEP_S, HAND) == {(HAND, True)}


def test_operators_that_one_node_passes_on_are_several_sources(bench):
    mux, desk = Source("/mux"), Source("/mux", "desk")
    bench.sends(1.0, mux)
    bench.sources.distrust()
    assert bench.sends(1.0, mux, desk) == {(mux, False), (desk, True)}


def test_node_that_was_there_before_must_pause_when_it_is_heard_and_others_need_not(bench):
    """However late it is heard: it may have sent all the time."""
    bench.sources.expect([PLANNER.node])
    bench.now_s += 10.0
    assert bench.sends(1.0, PLANNER, HAND) == {(PLANNER, False), (HAND, True)}
    bench.now_s += PAUSE_S
    assert bench.sends(1.0, PLANNER) == {(PLANNER, True)}


@pytest.mark.parametrize("silent_s, moves", [(PAUSE_S - 2 * STEP_S, False), (PAUSE_S, True)])
@pytest.mark.parametrize("operator", ["", "desk"])
def test_node_that_was_there_before_is_silent_from_its_connection_on(bench, silent_s, moves, operator):
    """Also of operators it passes on: one may have held a stick since before the start."""
    source = Source(PLANNER.node, operator)
    bench.sources.expect([source.node])
    bench.now_s += 10.0
    assert not bench.sources.connected([HAND.node], bench.now_s)
    assert bench.sources.connected([HAND.node, source.node], bench.now_s)
    if operator:
        bench.sends(silent_s, PLANNER)
    else:
        bench.now_s += silent_s
    assert bench.sends(1.0, source) == {(source, moves)}


def test_sources_that_come_and_go_take_no_memory(bench):
    """As each `rostopic pub` has another name."""
    gc.collect()
    tracemalloc.start()
    for number in range(2000):
        bench.sends(STEP_S, Source(f"/rostopic_{number}"))
        bench.now_s += PAUSE_S
    grown_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grown_bytes < 20000


def times_of(bench, gaps_s, source=PLANNER, took_s=0.0):
    """The answers to commands with these times between them."""
    answers = []
    for gap_s in gaps_s:
        bench.now_s += gap_s
        answers.append(bench.sources.may_move(source, bench.now_s))
        bench.now_s += took_s
        bench.sources.done(source, bench.now_s)
    return answers


HELD_BACK = [2e-4] * 10


@pytest.mark.parametrize("pause_s", [0.0, PAUSE_S, 5.0])
@pytest.mark.parametrize("took_s", [0.0, 0.003])
def test_commands_that_come_all_at_once_after_a_silence_were_held_back(pause_s, took_s):
    """The first one cannot be told from a new command; the others stop the robot."""
    bench = Bench(pause_s)
    assert times_of(bench, [6.0, *HELD_BACK], took_s=took_s) == [NONE, *[TOO_LATE] * 10]


def test_what_was_held_back_may_come_in_many_parts(bench):
    parts = [0.04, *HELD_BACK] * 40
    assert times_of(bench, [3.0, 0.005, *HELD_BACK, *parts]) == [NONE, NONE, *[TOO_LATE] * (10 + 11 * 40)]


@pytest.mark.parametrize("silence_s, refused", [(STEP_S, 2), (0.3, 0)])
def test_commands_after_those_that_were_held_back_move_the_robot(bench, silence_s, refused):
    times_of(bench, [3.0, *HELD_BACK])
    assert times_of(bench, [silence_s, *[STEP_S] * 9]) == [TOO_LATE] * refused + [NONE] * (10 - refused)


def test_a_network_that_stutters_while_the_robot_drives_stops_nothing(bench):
    times_of(bench, [3.0, *[STEP_S] * 20])
    assert times_of(bench, [0.15, *HELD_BACK]) == [NONE] * 11


@pytest.mark.parametrize("gap_s", [0.002, 0.005, 0.008, 0.1])
def test_a_source_that_sends_often_moves_the_robot_at_once(bench, gap_s):
    assert times_of(bench, [3.0, *[gap_s] * 100]) == [NONE] * 101


def test_the_age_of_an_operators_command_is_known_otherwise(bench):
    """A page sends several at once when a control is pressed."""
    assert times_of(bench, [3.0, *HELD_BACK], source=Source("/web_node", "page")) == [NONE] * 11
