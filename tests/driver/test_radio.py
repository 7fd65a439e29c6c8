"""Texts and searches of the radio: frames to values and back, and what the driver sends when."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, FrameError, MrlError
from mrl_driver.protocol import Frame
from mrl_driver.robot.radio import (
    BROADCAST,
    OLDEST_S,
    TEXT_IN,
    TEXT_OUT,
    WAITING,
    RadioQueue,
    RadioText,
    format_address,
    parse_address,
    text_of,
    text_request,
)
from tests.fake_board import FakeBoard
from tests.models import model
from tests.radio_board import NODES, PEER, Engine, RadioBoard

LINE_S = 34 * 10 / 9600  # Time of a text of 16 bytes on the line to the XBee
texts = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=16)


@given(st.integers(0, 2**64 - 1), texts)
def test_text_survives_the_words_of_the_wire(address, text):
    code, *fields = text_request(address, text)
    assert code == TEXT_OUT
    received = text_of(Frame(TEXT_IN, tuple(fields)))
    assert (received.address, received.text) == (address, text)


@given(st.integers(0, 2**64 - 1))
def test_address_is_read_as_it_was_written(address):
    assert parse_address(format_address(address)) == address


@pytest.mark.parametrize("text", ["", "robot", "-1", "1" * 17, " 1", "1_0", "\u0661"])
def test_address_that_is_none_is_refused_by_name(text):
    with pytest.raises(FrameError, match="radio address is"):
        parse_address(text)


@pytest.mark.parametrize("text", ["", "x" * 17, "\u00e9", b"", b"x" * 17])
def test_text_that_the_wire_cannot_carry_is_refused(text):
    with pytest.raises(FrameError, match="expected 1 to 16 ASCII"):
        text_request(1, text)


def queue(*lengths):
    made = RadioQueue()
    for length in lengths:
        made.add(text_request(1, "x" * length), 0.0)
    return made


def test_next_text_waits_until_the_one_before_is_on_the_air():
    texts = queue(16, 16)
    assert texts.take(0.0) and texts.take(LINE_S - 1e-6) is None
    assert texts.due_s == pytest.approx(LINE_S) and texts.take(LINE_S) and texts.due_s == math.inf


def test_text_that_waited_too_long_is_dropped_and_counted():
    texts = queue(4, 4)
    assert texts.take(OLDEST_S + 0.01) is None and (texts.dropped, texts.due_s) == (2, math.inf)


def test_more_texts_than_may_wait_are_refused():
    with pytest.raises(MrlError, match="16 texts wait for the radio"):
        queue(*[1] * (WAITING + 1))


@pytest.fixture
def robot():
    board = RadioBoard()
    with SteppedDriver(Engine(board), model("traxbot")) as driver:
        driver.board_ = board
        yield driver


def test_all_radios_that_answer_are_returned(robot):
    """`ask` keeps one reply of a code."""
    assert robot.radio.discover() == NODES


def test_answers_of_an_earlier_search_do_not_count(robot):
    robot.radio.discover(0.1)
    robot.board_.nodes = ()
    assert robot.radio.discover(0.1) == []


def test_two_searches_at_once_are_refused(robot):
    errors = []

    def search_again(_):
        if not errors:
            with pytest.raises(MrlError) as error:
                robot.radio.discover()
            errors.append(str(error.value))

    robot.on_telemetry(search_again)
    robot.radio.discover(0.1)
    assert errors == ["a search for radios is under way; try again when it has ended"]


def test_texts_follow_each_other_at_the_speed_of_the_radio(robot):
    for _ in range(4):
        robot.radio.send(BROADCAST, "x" * 16)
    robot.wait(0.5)
    times = [time_s for time_s, _ in robot.board_.sent]
    gaps = [b - a for a, b in zip(times, times[1:])]
    assert len(gaps) == 3 and min(gaps) >= LINE_S - 1e-6 and max(gaps) < LINE_S + 0.01


def test_each_received_text_is_told(robot):
    told = []
    robot.radio.on_text(told.append)
    for text in ("one", "two"):
        robot.board_.hear(PEER, text)
    robot.wait(0.1)
    assert told == [RadioText(PEER, b"one"), RadioText(PEER, b"two")]


def test_texts_of_the_time_before_a_silence_are_not_sent_after_it(robot):
    robot.board_.mute = True
    robot.wait(0.5)
    robot.radio.send(PEER, "old")
    robot.wait(OLDEST_S)
    robot.board_.mute = False
    robot.wait(1.0)
    assert robot.ready and not robot.board_.sent and robot.link.statistics.texts_dropped == 1


def test_board_without_a_radio_is_named():
    with SteppedDriver(Engine(FakeBoard()), model("traxbot")) as robot:
        for use in (lambda: robot.radio.send(1, "x"), robot.radio.discover, robot.radio.require):
            with pytest.raises(ConfigError, match="this board has no radio"):
                use()
