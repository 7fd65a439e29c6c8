"""An encoder's edges with sound and broken wires, and what the board counts of them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.protocol.table import TICK_S
from sim_arduino.board.encoder_inputs import EncoderInput
from sim_arduino.hardware.dc_motor import Motion
from sim_arduino.hardware.encoders import PULLED_UP, A, B, Bounce, PinEdge, Quadrature
from tests.models import ENCODER_PINS

EXACT_S = 1e-9
ORDER = {(0, 0): (1, 0), (1, 0): (1, 1), (1, 1): (0, 1), (0, 1): (0, 0)}  # Levels of A and B forward: A leads


def steady(counts_s, duration_s, travel=0.0):
    return Motion(0.0, duration_s, travel, counts_s, 0.0, 0.0)


def count(levels, edges):
    """Counts of a board that knows the order, and the number of edges that do not fit into it."""
    counted = impossible = 0
    for edge in edges:
        new = (edge.level, levels[B]) if edge.pin == A else (levels[A], edge.level)
        if ORDER[levels] == new:
            counted += 1
        elif ORDER[new] == levels:
            counted -= 1
        else:
            impossible += 1
        levels = new
    return counted, impossible


def at_board(encoder):
    return encoder.wires[A].level, encoder.wires[B].level


def test_edges_of_a_motion_that_speeds_up_come_at_its_times():
    """From rest at 20000 count/s2 the n-th edge comes after sqrt(2 (n - 0.5) / 20000) seconds."""
    edges = Quadrature().follow(0.0, 0.05, [Motion(0.0, 0.05, 0.0, 0.0, 20000.0, 0.0)])
    assert [edge.time_s for edge in edges] == pytest.approx(
        [math.sqrt((n + 0.5) / 10000.0) for n in range(25)], abs=EXACT_S
    )


@given(st.lists(st.floats(-30.0, 30.0), max_size=20), st.floats(-0.9, 0.9))
def test_there_and_back_leaves_no_count(ways, phase):
    """However often it turns round within a count, edges come in the right order, and none is lost."""
    encoder, travel, edges = Quadrature(phase_error=phase), 0.0, []
    start = at_board(encoder)
    for number, way in enumerate([*ways, -sum(ways)]):
        edges += encoder.follow(number, number + 1.0, [steady(way, 1.0, travel)])
        travel += way
    counted, impossible = count(start, edges)
    assert impossible == 0
    assert abs(counted) <= 1


def test_a_single_channel_has_an_edge_a_count_and_the_other_wire_is_pulled_up():
    encoder = Quadrature(single=True)
    edges = encoder.follow(0.0, 0.1, [steady(1000.0, 0.1)])
    assert [edge.pin for edge in edges] == [A] * 100
    assert encoder.wires[B].level == PULLED_UP


def test_an_open_wire_is_pulled_up_and_silent():
    encoder = Quadrature()
    encoder.open(A, True)
    edges = encoder.follow(1.0, 1.1, [steady(1000.0, 0.1)])
    assert [edge for edge in edges if edge.pin == A] == [(1.0, A, 1)]
    assert len([edge for edge in edges if edge.pin == B]) == 50


def test_a_mended_wire_shows_the_encoder_again():
    encoder = Quadrature()
    encoder.open(A, True)
    encoder.follow(0.0, 1.0, [])
    encoder.open(A, False)
    assert encoder.follow(1.0, 2.0, []) == [(1.0, A, 0)]


def test_an_open_wire_oscillates_at_its_rate_even_at_rest():
    encoder = Quadrature()
    encoder.open(B, True, 20000.0)
    edges = [edge for number in range(10) for edge in encoder.follow(number * 1e-3, (number + 1) * 1e-3, [])]
    assert [edge.time_s for edge in edges] == pytest.approx(
        [50e-6 * (n + 1) for n in range(199)], abs=EXACT_S
    )
    assert [edge.level for edge in edges[:4]] == [1, 0, 1, 0]


def test_bounces_go_on_in_the_next_step():
    """The edge comes at 0.5 ms; one step ends within its bounces."""
    encoder = Quadrature()
    encoder.bounce = Bounce(2, 20e-6)
    first = encoder.follow(0.0, 0.53e-3, [steady(1000.0, 0.53e-3)])
    second = encoder.follow(0.53e-3, 1e-3, [])
    assert [len(first), len(second)] == [2, 3]
    assert at_board(encoder) == (1, 0)


LOW = {pin: 0 for pins in ENCODER_PINS for pin in pins}
FORWARD = ((0, 1), (1, 1), (0, 0), (1, 0))  # Channel and level of the four edges of a cycle


def edges_of(encoder, steps, start_s=0.0):
    return [
        PinEdge(start_s + 1e-3 * n, ENCODER_PINS[encoder][channel], level)
        for n, (channel, level) in enumerate(steps, 1)
    ]


@pytest.fixture(params=[0, 1])
def encoder(request):
    return EncoderInput(ENCODER_PINS[request.param], LOW)


def test_an_edge_that_counts_has_its_time_on_the_boards_clock(encoder):
    encoder.take(edges_of(ENCODER_PINS.index(encoder.pins), FORWARD, start_s=0.5), 0.25)
    assert encoder.edge_tick == int(0.254 / TICK_S)


@pytest.mark.parametrize(("apart_s", "counted", "impossible"), [(0.5e-6, 0, 1), (2e-6, 2, 0)])
def test_edges_of_both_channels_within_an_interrupt_are_impossible(encoder, apart_s, counted, impossible):
    a, b = encoder.pins
    encoder.take([PinEdge(1e-3, a, 1), PinEdge(1e-3 + apart_s, b, 1)], 0.0)
    assert (encoder.count, encoder.impossible) == (counted, impossible)
