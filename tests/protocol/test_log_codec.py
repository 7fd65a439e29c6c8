"""The vectorised decoder finds what the incremental one finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.protocol.codec import REPLIES, Frame, FrameDecoder, Garbage, Stamp, encode_reply
from mrl_driver.recording import frame_arrays
from mrl_driver.recording.frame_arrays import LogDecoder, decode_log
from tests.vectors import load

INT16 = st.integers(-32768, 32767)


def frame_8(args, sequence, checked):
    return encode_reply(8, *args, stamp=Stamp(sequence, 1), checked=checked)


GOOD = st.builds(frame_8, st.tuples(INT16, INT16, *[st.integers(-1, 1250)] * 3), INT16, st.booleans())
ODD = st.one_of(
    st.sampled_from(
        [
            b"@8,1,2,3,4e\r\n",
            b"@8,1,2,3,4,5,6e\r\n",
            b"@8,1,02,3,4,5e\r\n",
            b"@8,1,-0,3,4,5e\r\n",
            b"@8,1,40000,3,4,5e\r\n",
            b"@8,1,2,3,4,1251e\r\n",
            b"@8,1,,3,4,5e\r\n",
            b"@8,-,2,3,4,5e\r\n",
            b"[INFO] the frame @8,1,2,3,4,5e\r\n",
            b"@8,1@8,1,2,3,4,5e\r\n",
            b"@6,1,2e",
            b"@5,1,2,3,4,5e\r\n",
            b"@22,1,2,3,4,5,6,7,8e\r\n",
            b"@8,--1,2,3,4,5e\r\n",
            b"@8,1,2,3,4,123456e\r\n",
            b"@88,1e\r\n",
        ]
    ),
    st.binary(max_size=40),
)


def by_scalar(data, checked):
    events = FrameDecoder(REPLIES, checked).feed(data)
    return [e for e in events if isinstance(e, Frame)], [e for e in events if isinstance(e, Garbage)]


def by_log(events):
    frames = [
        (end, Frame(code, tuple(args), stamp))
        for code, found in events.frames.items()
        for end, args, stamp in zip(
            found.end.tolist(),
            found.args.tolist(),
            [Stamp(*s) for s in found.stamps.tolist()]
            if found.stamps is not None
            else [None] * len(found.end),
        )
    ]
    return [frame for _, frame in sorted(frames, key=lambda pair: pair[0])], events.garbage


@given(st.lists(st.one_of(GOOD, GOOD, ODD), max_size=12), st.booleans())
def test_log_equals_scalar(pieces, checked):
    data = b"".join(pieces)
    assert by_log(decode_log(data, checked)) == by_scalar(data, checked)


@given(st.lists(st.one_of(GOOD, ODD), max_size=12), st.lists(st.integers(0, 300), max_size=4))
def test_pieces_decode_as_the_whole(parts, cuts):
    data, decoder = b"".join(parts), LogDecoder()
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for a, b in zip(edges, edges[1:]):
        decoder.feed(data[a:b])
    assert by_log(decoder.events()) == by_scalar(data, False)


@given(st.binary(max_size=30), st.lists(GOOD, max_size=3))
def test_a_long_stretch_without_end_is_not_kept(head, tail):
    small, frame_arrays.CHUNK = frame_arrays.CHUNK, 8
    try:
        data = head + b"".join(tail)
        assert by_log(decode_log(data)) == by_scalar(data, False)
    finally:
        frame_arrays.CHUNK = small


@pytest.mark.parametrize("vector", load("replies"), ids=lambda v: v.name)
def test_golden_vectors(vector):
    data = b"\r\n" + vector.wire
    assert by_log(decode_log(data, vector.checked)) == by_scalar(data, vector.checked)


def test_offsets_point_behind_each_frame():
    found = decode_log(b"\r\n@6,1,2e\r\n@6,3,4e\r\n").frames[6]
    np.testing.assert_array_equal(found.end, [9, 18])


def test_an_empty_log_holds_nothing():
    assert decode_log(b"") == ({}, [])
