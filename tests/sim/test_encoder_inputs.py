"""The emulated board's encoder inputs: what an edge counts, what a sample holds, when an input is masked."""

import pytest

from mrl_driver.protocol.table import TICK_S
from sim_arduino.board.bridge.encoder_inputs import MOST_EDGES, EncoderInputs
from sim_arduino.hardware.bridge_plant import ENCODER_PINS, PinEdge

LOW = {pin: 0 for pins in ENCODER_PINS for pin in pins}
FORWARD = ((0, 1), (1, 1), (0, 0), (1, 0))
"""Channel and level of the four edges of a cycle."""


def edges(encoder, steps, start_s=0.0):
    """Edges 1 ms apart."""
    return [
        PinEdge(start_s + 1e-3 * n, ENCODER_PINS[encoder][channel], level)
        for n, (channel, level) in enumerate(steps, 1)
    ]


def backward(steps):
    return tuple((channel, 1 - level) for channel, level in reversed(steps))


@pytest.fixture
def inputs():
    return EncoderInputs(LOW)


@pytest.mark.parametrize("encoder", [0, 1])
def test_each_edge_forward_counts_up(inputs, encoder):
    inputs.take(edges(encoder, FORWARD * 3), 0.0)
    assert inputs.read(0).counts[encoder] == 12 and inputs.read(0).counts[1 - encoder] == 0


def test_each_edge_backward_counts_down(inputs):
    inputs.take(edges(0, FORWARD + backward(FORWARD) * 2), 0.0)
    assert inputs.read(0).counts[0] == 65536 - 4 and inputs.impossible == 0


def test_edges_of_both_channels_within_an_interrupt_are_impossible(inputs):
    inputs.take([PinEdge(1e-3, 2, 1), PinEdge(1e-3 + 0.5e-6, 4, 1)], 0.0)
    assert inputs.read(0).counts[0] == 0 and inputs.impossible == 1


def test_edges_beyond_an_interrupt_are_counted_one_by_one(inputs):
    inputs.take([PinEdge(1e-3, 2, 1), PinEdge(1e-3 + 2e-6, 4, 1)], 0.0)
    assert inputs.read(0).counts[0] == 2 and inputs.impossible == 0


def test_a_sample_has_the_time_of_the_last_edge(inputs):
    inputs.take(edges(1, FORWARD, start_s=0.5), 0.25)
    assert inputs.read(7).edge_ticks[1] == int(0.254 / TICK_S)


def test_a_single_channel_counts_its_own_edges_up(inputs):
    inputs.single_channel = True
    inputs.take(edges(0, FORWARD + backward(FORWARD)), 0.0)
    assert inputs.read(0).counts[0] == 4


def oscillation(count, start_s=0.0):
    return [PinEdge(start_s + 1e-5 * n, 2, n & 1) for n in range(1, count + 1)]


def test_too_many_edges_between_two_samples_mask_an_encoder_alone(inputs):
    inputs.take(oscillation(MOST_EDGES), 0.0)
    assert inputs.masked(0) and not inputs.masked(1)


def test_as_many_edges_with_a_sample_between_do_not(inputs):
    inputs.take(oscillation(MOST_EDGES - 1), 0.0)
    inputs.sample(78)
    inputs.take(oscillation(MOST_EDGES - 1, 0.01), 0.0)
    assert not inputs.masked(0)


def test_a_masked_encoder_does_not_count_until_it_is_unmasked(inputs):
    inputs.take(oscillation(MOST_EDGES), 0.0)
    before = inputs.sample(78).counts[0]
    inputs.take(edges(0, FORWARD, 0.01), 0.0)
    assert inputs.read(0).counts[0] == before
    inputs.unmask(0, LOW)
    inputs.take(edges(0, FORWARD, 0.02), 0.0)
    assert inputs.read(0).counts[0] == before + 4
