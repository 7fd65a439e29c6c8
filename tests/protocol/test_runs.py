"""Runs of frames are taken all at once, and give to the byte what the grammar gives that reads byte by byte."""

import itertools
import random
from typing import Iterator, List, NamedTuple
from unittest import mock

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mrl_driver.protocol import REPLIES, REQUESTS, Event, Frame, FrameDecoder, Stamp, decoder, encode_reply
from mrl_driver.protocol.table import BY_CODE, COMMANDS, INT16_MAX, INT16_MIN, MAX_NOISE, Field

STREAM = 8
ROWS = [row.code for row in COMMANDS if row.reply and not row.optional_reply]
SPELLINGS = (
    b"-0",
    b"00",
    b"0",
    b"+",
    b"-",
    b" ",
    b"_",
    b".",
    b",",
    b",,",
    b"99999",
    b"32768",
    b"7e5",
    b"]",
    b"\r",
    b"\n",
)
BETWEEN = (
    b"@",
    b"e",
    b"e\r\n@8,",
    b"@13e",
    b"@8,1,2,3e",
    b"[INFO] free @8,1,2,3,4,5e text\r\n",
    b"\xff\x00",
    b"9" * 70,
)


class Scanner(FrameDecoder):
    """The grammar alone: each byte is looked at on its own, no frame is quickly taken."""

    def feed(self, data: bytes) -> List[Event]:
        """What `data` completes."""
        events: List[Event] = []
        self._scan(data, events)
        return events


class Damage(NamedTuple):
    """`cut` bytes at `place` [share of all bytes] are replaced by `text`."""

    place: float
    cut: int
    text: bytes

    def done_to(self, wire: bytes) -> bytes:
        at = int(self.place * len(wire))
        return wire[:at] + self.text + wire[at + self.cut :]


def value(field: Field, rng: random.Random) -> int:
    """One of the field's range, often one that is spelt unlike others."""
    return rng.choice(
        [field.low, field.high, rng.randint(field.low, field.high), rng.randint(field.low, field.high)]
        + [n for n in (0, -1) if field.low <= n <= field.high]
    )


def lines(codes: List[int], checked: bool, seed: int) -> List[bytes]:
    """Replies in a row; sequence and board time wrap on their way."""
    rng = random.Random(seed)
    return [
        encode_reply(
            code,
            *(value(field, rng) for field in BY_CODE[code].reply),
            stamp=Stamp((seed + i + 32768) % 65536 - 32768, rng.randint(INT16_MIN, INT16_MAX)),
            checked=checked,
        )
        for i, code in enumerate(codes)
    ]


RUNS = st.builds(
    lambda code, count: [code] * count, st.sampled_from([STREAM, STREAM, *ROWS]), st.integers(1, 6)
)
CODES = st.lists(RUNS, min_size=1, max_size=3).map(lambda runs: [code for run in runs for code in run])
DAMAGES = st.lists(
    st.builds(
        Damage,
        st.floats(0, 1, exclude_max=True),
        st.sampled_from([0, 0, 1, 1, 2, 40]),
        st.sampled_from([b"", *SPELLINGS, *BETWEEN]) | st.binary(max_size=2),
    ),
    max_size=3,
)


def pieces_of(wire: bytes, cuts: List[float]) -> Iterator[bytes]:
    at = [0, *sorted(int(cut * len(wire)) for cut in cuts), len(wire)]
    return (wire[begin:end] for begin, end in zip(at, at[1:]))


RESTS = (b"e", b"@", b"\r\n@5,1,2,3,4,5e", b"x\r\n")
"""What may come last: it ends a frame that waits, breaks it off, or ends the line with what that held."""


@given(
    CODES,
    DAMAGES,
    st.lists(st.floats(0, 1), max_size=4),
    st.booleans(),
    st.booleans(),
    st.sampled_from([REPLIES, REPLIES, REPLIES, REQUESTS, None]),
    st.integers(0, 65535),
    st.sampled_from(RESTS),
)
def test_runs_and_pieces_give_what_single_bytes_give(
    codes, damages, cuts, sent, checked, direction, seed, rest
):
    """Frames, garbage with its reason, and what waits for more: whatever is damaged, mixed or cut."""
    wire = b"".join(lines(codes, sent, seed))
    for damage in damages:
        wire = damage.done_to(wire)
    quick, scanner = FrameDecoder(direction, checked), Scanner(direction, checked)
    with mock.patch.object(decoder, "LEAST_RUN", 1):
        for piece in (*pieces_of(wire, cuts), rest):
            assert quick.feed(piece) == scanner.feed(piece)


BEFORE = (
    b"",
    b"\r",
    b"text ",
    b"t" * MAX_NOISE,
    b"\xff",
    b"\xff" * MAX_NOISE,
    b"@8,1,2,3,4,",
    b"@8,1\r\n",
    b"x@8,1",
    b"@",
)


@pytest.mark.parametrize("checked", [False, True])
def test_what_stands_before_a_run_is_not_forgotten(checked):
    """Text and noise on its line, or an unfinished frame; nor does the run forget to end that line."""
    for before, begin in itertools.product(BEFORE, (b"@", b"\r\n@", b"\n@", b" @", b"x@", b"e@", b"5e\r\n@")):
        wire = begin + b"".join(lines([STREAM] * 40, checked, 7))[1:]
        quick, scanner = FrameDecoder(REPLIES, checked), Scanner(REPLIES, checked)
        for piece in (before, wire, b"y@6,1,2e"):
            assert quick.feed(piece) == scanner.feed(piece), (before, begin)


@pytest.mark.parametrize("before", [b"", b"text "])
@pytest.mark.parametrize("cut", [8, 20, 700])
@pytest.mark.parametrize("checked", [False, True])
def test_the_check_may_go_on_and_off_within_a_frame(checked, cut, before):
    """The session changes `checked` between two feeds, wherever they were cut."""
    wire = before + b"".join(lines([STREAM] * 40, not checked, 1))
    quick, scanner = FrameDecoder(REPLIES, checked), Scanner(REPLIES, checked)
    for each in (quick, scanner):
        each.feed(wire[:cut])
        each.checked = not checked
    assert quick.feed(wire[cut:]) == scanner.feed(wire[cut:])


def every_change(wire: bytes) -> Iterator[bytes]:
    """Each byte lost, replaced by and preceded by each that means anything, and by some that do not."""
    for i in range(len(wire)):
        yield wire[:i] + wire[i + 1 :]
        for byte in b"0123456789-+,@e\r\n .[]E_x\x00\xff":
            yield wire[:i] + bytes([byte]) + wire[i + 1 :]
            yield wire[:i] + bytes([byte]) + wire[i:]


@pytest.mark.parametrize("checked", [False, True])
def test_a_run_with_one_byte_wrong_is_never_read_otherwise(checked):
    """Where it is still taken at once, the frames are those of the grammar."""
    run, taken = REPLIES.runs[checked][b"@%d" % STREAM], 0
    wire = b"@8,-12345,20,300,0,-1e\r\n@8,0,-7,12,645,5e"
    if checked:
        wire = b"".join(lines([STREAM] * 2, True, 11))[:-2]
    for data in every_change(wire):
        frames = run.frames(data)
        if frames is not None:
            taken += 1
            assert list(frames) == Scanner(REPLIES, checked).feed(data)
    assert taken or checked


@pytest.mark.parametrize("checked", [False, True])
def test_every_row_makes_runs(checked):
    """So the laws above speak of runs, and none goes the slow way unnoticed."""
    for code in ROWS:
        wire = b"".join(lines([code] * 9, checked, 5))
        frames = REPLIES.runs[checked][b"@%d" % code].frames(wire[:-2])
        assert frames is not None, code
        assert list(frames) == Scanner(REPLIES, checked).feed(wire), code


def test_a_long_feed_looks_for_runs():
    wire, run = b"".join(lines([STREAM] * 60, False, 3)), type(REPLIES.runs[False][b"@8"])
    decoder, taken = FrameDecoder(REPLIES), []
    with mock.patch.object(run, "frames", autospec=True, side_effect=run.frames) as frames:
        for piece in (wire[:700], wire[700:]):
            taken += decoder.feed(piece)
    assert frames.call_count == 2
    assert taken == Scanner(REPLIES).feed(wire)


@given(st.lists(st.integers(INT16_MIN - 9, INT16_MAX + 9), min_size=10, max_size=10))
@example([INT16_MIN, INT16_MAX, -1, 645, -1] * 2)
@example([INT16_MIN - 1, 0, 0, 0, 0] * 2)
@example([0, 0, 0, 0, 646] * 2)
@example([0, 0, -2, 0, 0] * 2)
def test_runs_are_bounded_as_the_table_says(values):
    wire = b"e\r\n".join(b"@8,%d,%d,%d,%d,%d" % tuple(values[i : i + 5]) for i in (0, 5)) + b"e"
    frames = REPLIES.runs[False][b"@8"].frames(wire)
    good = [event for event in Scanner(REPLIES).feed(wire) if isinstance(event, Frame)]
    assert (list(frames) if frames is not None else None) == (good if len(good) == 2 else None)
