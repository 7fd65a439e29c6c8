"""The greeting on a line that damages what passes: each single fault of each reply, one after the other."""

import functools
import math

import pytest

from mrl_driver.errors import BatteryDead, WrongRobot
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.handshake import RETRY_S, Plan
from mrl_driver.session.session import Info, Ready, Session, Stale
from tests.fake_board import FakeBoard

from .talk import Talk

READY_WITHIN_S = 3.0  # A greeting of which one reply is lost or damaged
MOST_REPLIES = 40


class Line:
    """Passes replies on, and puts `instead` in the place of the one with this number."""

    def __init__(self, number=-1, instead=b""):
        self.number, self.instead = number, instead
        self.passed = []

    def __call__(self, data):
        out = b""
        for reply in data.splitlines(keepends=True):
            out += self.instead if len(self.passed) == self.number else reply
            self.passed.append(reply)
        return out


class Greeting:
    """A session that greets a board on a line which damages one reply."""

    def __init__(self, make, line, plan):
        self.line, self.admitted = line, []
        self.board, self.now = make(), 0.0
        self.session = Session(self.admitted.append, self.now, plan)
        self.ready = []

    def until_ready(self):
        """Goes from one moment at which something is due to the next, which takes a millisecond."""
        while not self.ready:
            self.board.receive(self.session.take(), self.now)
            data = self.line(self.board.advance(self.now))
            if not data:
                streamed_s = self.board.due_s if self.board.period_s else READY_WITHIN_S
                self.now = max(self.now, min(self.session.deadline(self.now), streamed_s))
            assert self.now < READY_WITHIN_S, "it is not greeted in time"
            events = self.session.receive(data, self.now) + self.session.tick(self.now)
            self.ready = [event for event in events if isinstance(event, Ready)]
        return self

    @property
    def outcome(self):
        """What a wrong greeting gets wrong: who is admitted, and what is in force on the board."""
        board = self.ready[0].board
        who = {(each.robot_id, each.version, round(each.battery_v)) for each in (*self.admitted, board)}
        modes = self.session.checked, self.board.decoder.checked
        return who, board.protocol, board.capabilities, modes, self.board.watchdog_s


def left_checked():
    """The driver before was killed: the board streams with check values."""
    board = FakeBoard()
    board.decoder.checked, board.period_s = True, 0.02
    return board


def decoded(data):
    """What a session gets: the frames without and with check values, and whether a frame has begun."""
    decoders = [FrameDecoder(REPLIES, checked) for checked in (False, True)]
    frames = [event for each in decoders for event in each.feed(data) if isinstance(event, Frame)]
    return (*frames, *(each.pending.startswith(b"@") for each in decoders))


@functools.lru_cache(maxsize=None)
def single_faults(reply):
    """Each byte lost, and changed to each other one; of those of a place that are the same to a session, one."""
    found = []
    for i in range(len(reply)):
        others = [bytes([byte]) for byte in range(256) if byte != reply[i]]
        damaged = [reply[:i] + other + reply[i + 1 :] for other in (b"", *others)]
        found += {decoded(each): each for each in damaged}.values()
    return found


def replies_of(make, plan):
    """The replies of a greeting on a good line, and its outcome."""
    good = Greeting(make, Line(), plan).until_ready()
    assert 0 < len(good.line.passed) < MOST_REPLIES
    return good.line.passed, good.outcome


BOARDS = {
    "ours": (FakeBoard, Plan()),
    "ours, left checked": (left_checked, Plan()),
    "ours, plain": (FakeBoard, Plan(check=False)),
    "2013": (lambda: FakeBoard(version=1), Plan()),
}


@pytest.mark.parametrize("name", BOARDS)
def test_no_single_fault_of_a_reply_makes_a_wrong_session(name):
    make, plan = BOARDS[name]
    replies, outcome = replies_of(make, plan)
    for number, reply in enumerate(replies):
        for damaged in single_faults(reply):
            line = Line(number, damaged)
            assert Greeting(make, line, plan).until_ready().outcome == outcome, (number, damaged)


@pytest.mark.parametrize("instead", [b"@5,2500,172,1200,2,5e\r\n", b"@5,2500,172,120,2,1e\r\n"])
def test_no_fault_of_a_reply_while_greeting_again_ends_the_session(instead):
    """Each reply in turn is replaced by what a damaged one may look like: another id, an empty battery."""
    for number in range(MOST_REPLIES):
        talk = Talk(FakeBoard(), RobotState(None).admit).until_ready()
        talk.board.mute = True
        talk.until(lambda talk=talk: talk.seen(Stale))
        talk.board.mute, talk.to_host = False, Line(number, instead)
        talk.until(lambda talk=talk: talk.session.ready, READY_WITHIN_S)
        assert talk.session.board.robot_id == 1


def without_measurements(*, checks=True):
    """An H-bridge board without a divider: it sends 0 for battery and temperature."""
    board = FakeBoard(robot_id=23)
    board.battery = board.temperature = 0
    board.capabilities |= {"bridge", "no_battery", "no_temperature"}
    if not checks:
        board.capabilities.remove("check")
    return board


@pytest.mark.parametrize("checks", [True, False])
def test_what_a_board_does_not_measure_is_nan_and_refuses_no_start(checks):
    state = RobotState(None)
    talk = Talk(without_measurements(checks=checks), state.admit).until_ready().run(5.0)
    assert talk.seen(Info)
    for event in talk.events:
        state.digest(event, talk.now)
    assert math.isnan(state.info.battery_v) and math.isnan(state.info.temperature_c)
    assert (state.battery_state, state.powerless) == ("ok", False)


@pytest.mark.parametrize("checks", [True, False])
def test_a_board_that_measures_0_volts_is_refused(checks):
    board = without_measurements(checks=checks)
    board.capabilities.remove("no_battery")
    with pytest.raises(BatteryDead, match="reads 0.00 V"):
        Talk(board, RobotState(None).admit).run(3.0)


def test_plain_sonars_before_the_first_answer_are_no_error():
    """The model is not known yet."""
    state, session = RobotState(None), Session(lambda board: None, 0.0)
    events = session.receive(b"@7,100,100,100e\r\n", 0.1)
    assert [found for event in events for found in state.digest(event, 0.1)] == []


# -- what a session tells of it


def test_a_check_value_taken_for_an_id_is_not_taken_for_a_restart():
    talk = Talk(FakeBoard(), RobotState(None).admit).until_ready()
    talk.session.lose(talk.now)
    talk.events.clear()
    talk.session.receive(b"@5,2500,172,1200,21,12345e\r\n", talk.now)
    talk.until_ready()
    assert not talk.seen(Ready)[0].restarted


def test_plain_answers_to_the_greeting_are_not_told_as_facts():
    """One of them may be damaged, and its battery empty."""
    talk = Talk(FakeBoard(version=1)).until_ready()
    assert not talk.seen(Info)


def test_a_wrong_robot_is_refused_without_waiting_between_its_answers():
    def refuse(board):
        raise WrongRobot("another")

    talk = Talk(FakeBoard(), refuse)
    with pytest.raises(WrongRobot):
        talk.run(RETRY_S)
