"""The radio: frames to values and back, what the driver sends when, claims of a team, and holds of other robots."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, FrameError, MrlError
from mrl_driver.navigation.claims import MOST_ROBOTS, ClaimMessage, RadioTeam, read_radios
from mrl_driver.navigation.radio_holder import REPEAT_S, RadioHolder
from mrl_driver.protocol import Frame
from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.robot import radio
from sim_arduino.board.radio_port import RadioHold
from tests.fake_board import FakeBoard
from tests.models import model
from tests.radio_board import NODES, PEER, Engine, RadioBoard

LINE_S = 34 * 10 / 9600  # Time of a text of 16 bytes on the line to the XBee
texts = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=16)


@given(st.integers(0, 2**64 - 1), texts)
def test_text_survives_the_words_of_the_wire(address, text):
    code, *fields = radio.text_request(address, text)
    assert code == radio.TEXT_OUT
    received = radio.text_of(Frame(radio.TEXT_IN, tuple(fields)))
    assert (received.address, received.text) == (address, text)


@given(st.integers(0, 2**64 - 1))
def test_address_is_read_as_it_was_written(address):
    assert radio.parse_address(radio.format_address(address)) == address


@pytest.mark.parametrize("text", ["", "robot", "-1", "1" * 17, " 1", "1_0", "\u0661"])
def test_address_that_is_none_is_refused_by_name(text):
    with pytest.raises(FrameError, match="radio address is"):
        radio.parse_address(text)


@pytest.mark.parametrize("text", ["", "x" * 17, "\u00e9", b"", b"x" * 17])
def test_text_that_the_wire_cannot_carry_is_refused(text):
    with pytest.raises(FrameError, match="expected 1 to 16 ASCII"):
        radio.text_request(1, text)


def queue(*lengths):
    made = radio.RadioQueue()
    for length in lengths:
        made.add(radio.text_request(1, "x" * length), 0.0)
    return made


def test_next_text_waits_until_the_one_before_is_on_the_air():
    texts = queue(16, 16)
    assert texts.take(0.0) and texts.take(LINE_S - 1e-6) is None
    assert texts.due_s == pytest.approx(LINE_S) and texts.take(LINE_S) and texts.due_s == math.inf


def test_text_that_waited_too_long_is_dropped_and_counted():
    texts = queue(4, 4)
    assert texts.take(radio.OLDEST_S + 0.01) is None and (texts.dropped, texts.due_s) == (2, math.inf)


def test_more_texts_than_may_wait_are_refused():
    with pytest.raises(MrlError, match="16 texts wait for the radio"):
        queue(*[1] * (radio.WAITING + 1))


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
        robot.radio.send(radio.BROADCAST, "x" * 16)
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
    assert told == [radio.RadioText(PEER, b"one"), radio.RadioText(PEER, b"two")]


def test_texts_of_the_time_before_a_silence_are_not_sent_after_it(robot):
    robot.board_.mute = True
    robot.wait(0.5)
    robot.radio.send(PEER, "old")
    robot.wait(radio.OLDEST_S)
    robot.board_.mute = False
    robot.wait(1.0)
    assert robot.ready and not robot.board_.sent and robot.link.statistics.texts_dropped == 1


def test_board_without_a_radio_is_named():
    with SteppedDriver(Engine(FakeBoard()), model("traxbot")) as robot:
        for use in (lambda: robot.radio.send(1, "x"), robot.radio.discover, robot.radio.require):
            with pytest.raises(ConfigError, match="this board has no radio"):
                use()


ONE, TWO = 0x0013A20040000001, 0x0013A20040000002
TEAM = {"1": ONE, "2": TWO}


def test_radios_are_read():
    assert read_radios("1=0013a20040000001, 2=0013A20040000002") == TEAM


@pytest.mark.parametrize("text", ["", "1", "1=", "=5", "1=x", "1=5,1=6", "1=5,,2=6"])
def test_other_texts_are_refused(text):
    with pytest.raises(ConfigError, match="expected NAME=ADDRESS of each robot"):
        read_radios(text)


def test_message_goes_to_the_radio_of_its_receiver():
    assert RadioTeam("1", TEAM).text_to(ClaimMessage("1", 3, "2", 0)) == (TWO, "1 3 2 0")


def test_claim_is_taken_from_the_radio_of_its_sender():
    assert RadioTeam("1", TEAM).message_of(TWO, "2 4 1 3") == ClaimMessage("2", 4, "1", 3)


def test_claim_from_another_radio_is_refused_by_name():
    """Two robots with the same name might grant each other's claim and both go."""
    with pytest.raises(ConfigError, match="comes from radio 0013a20040000003, expected 0013a20040000002"):
        RadioTeam("1", TEAM).message_of(ONE + 2, "2 4 1 3")


@pytest.mark.parametrize("text", ["hello", "3 4 1 3", "2 4 1", "\\xf8H\\x00\\x01"])
def test_other_texts_of_the_radio_are_no_claims(text):
    assert RadioTeam("1", TEAM).message_of(TWO, text) is None


@pytest.mark.parametrize(
    "name, addresses, error",
    [
        ("3", TEAM, "expected 2 to 6 robots, 3 among them"),
        ("1", {"1": ONE}, "expected 2 to 6 robots"),
        ("0", {str(i): ONE + i for i in range(MOST_ROBOTS + 1)}, "expected 2 to 6 robots"),
        ("1", {"1": ONE, "2": ONE}, "0013a20040000001 cannot be used, expected one of its own"),
        ("1", {"1": ONE, "2": radio.BROADCAST}, "000000000000ffff cannot be used"),
        ("robot1", {"robot1": ONE, "robot2": TWO}, "at most 5 characters together"),
    ],
)
def test_teams_that_cannot_talk_by_radio_are_refused(name, addresses, error):
    with pytest.raises(ConfigError, match=error):
        RadioTeam(name, addresses)


OWN, HELD, SECOND = 0x0013A20040000000, 0x0013A20040000001, 0x0013A20040000002
SILENT = 20  # Parameter `radio_hold` [100 ms]


class Air:
    """A holder and two boards; `cut` has the addresses of boards out of range."""

    def __init__(self):
        self.now_s = 10.0
        self.boards = {address: self.board() for address in (HELD, SECOND)}
        self.cut = set()
        self.holder = RadioHolder([HELD, SECOND])

    def board(self, started_s=0.0):
        made = RadioHold({"radio_hold": SILENT}, lambda: None, started_s)
        made.run(self.now_s)
        return made

    def exchange(self, times=3):
        for _ in range(times):
            self.now_s += REPEAT_S
            for address, data in self.holder.texts(self.now_s):
                if address not in self.cut:
                    self.boards[address].receive(OWN, data, self.now_s)
                    for _, answer in self.boards[address].answers():
                        self.holder.receive(radio.RadioText(address, answer), self.now_s)

    @property
    def held(self):
        return {address for address, board in self.boards.items() if board.held}

    @property
    def holds_all(self):
        return self.holder.holds_all(self.now_s)


@pytest.fixture
def air():
    return Air()


def test_holder_knows_that_all_are_held(air):
    air.holder.hold()
    assert not air.holds_all
    air.exchange(1)
    assert air.holds_all and air.held == {HELD, SECOND}


def test_robot_that_does_not_answer_is_named_and_not_counted_as_held(air):
    air.cut.add(SECOND)
    air.holder.hold()
    air.exchange(10)
    assert not air.holds_all and air.holder.unanswered(air.now_s) == (SECOND,)


def test_freed_robots_are_not_held(air):
    air.holder.hold()
    air.exchange()
    air.holder.free()
    assert not air.holds_all and not air.holder.all_freed
    air.exchange(1)
    assert air.holder.all_freed and not air.held and not air.holds_all


def test_robot_that_does_not_hear_the_end_stays_held_and_is_named(air):
    air.holder.hold()
    air.exchange()
    air.cut.add(HELD)
    air.holder.free()
    air.exchange()
    assert air.held == {HELD} and air.holder.unfreed == (HELD,)


def test_answer_of_the_last_hold_does_not_count_for_the_next_one(air):
    air.holder.hold()
    air.exchange()
    air.holder.free()
    air.exchange()
    air.holder.hold()
    for address in (HELD, SECOND):
        air.holder.receive(radio.RadioText(address, HoldText("held", 1).data), air.now_s)
    assert not air.holds_all
    air.exchange(1)
    assert air.holds_all and air.held == {HELD, SECOND}


@pytest.mark.parametrize("freed", [False, True])
def test_holder_that_has_started_again_uses_a_larger_number(air, freed):
    for _ in range(3):
        air.holder.free()
        air.holder.hold()
        air.exchange()
    if freed:
        air.holder.free()
        air.exchange()
    air.holder = RadioHolder([HELD, SECOND])
    air.holder.hold()
    air.exchange()
    assert air.holds_all and air.held == {HELD, SECOND}


def test_board_that_has_started_again_is_held_again(air):
    air.holder.hold()
    air.exchange()
    air.boards[HELD] = air.board(started_s=air.now_s)
    air.exchange(1)
    assert air.holds_all and air.held == {HELD, SECOND}


@pytest.mark.parametrize("data", [b"hello", HoldText("hold", 1).data, HoldText("held", 1).data])
def test_texts_of_others_are_no_answers(air, data):
    air.holder.hold()
    air.exchange(0)
    air.holder.receive(radio.RadioText(OWN, data), air.now_s)
    assert set(air.holder.unanswered(air.now_s)) == {HELD, SECOND}


@pytest.mark.parametrize("addresses", [[], [HELD, HELD], list(range(1, 10)), [radio.BROADCAST]])
def test_wrong_addresses_are_refused(addresses):
    with pytest.raises(ConfigError, match="expected 1 to 8|cannot be held"):
        RadioHolder(addresses)
