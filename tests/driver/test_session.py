import re

import pytest

from mrl_driver.driver.options import QUEUED_S
from mrl_driver.errors import BoardTimeout, HostBusy, WrongRobot
from mrl_driver.protocol.table import BY_CODE, BY_NAME
from mrl_driver.session.handshake import Plan
from mrl_driver.session.motion_command import SLOW
from mrl_driver.session.session import Ready, Reply
from tests.fake_board import FakeBoard

from .talk import Talk

READ_PROTOCOL = BY_NAME["read_protocol"].code
MODERN = {code for code in BY_CODE if code >= READ_PROTOCOL}  # Requests that boards of 2013 do not know
BOARD_2013_MAX_HZ = 15
"""2013 boards lose commands above 26 a second while streaming; the driver stays well below."""


def codes(talk):
    return [frame.code for frame in talk.board.heard]


# -- greeting


def test_a_board_that_restarts_amid_a_greeting_is_greeted_anew():
    """It has told who it is under the check value, and is plain from then on."""
    talk = Talk().until_ready()
    talk.session.lose(talk.now)
    talk.board.heard.clear()
    talk.until(lambda: READ_PROTOCOL in codes(talk))  # it asks for this once it knows who answers
    talk.board.reset(talk.now)
    talk.until(lambda: talk.session.ready, seconds=5.0)


def test_a_stop_goes_first():
    """Boards of 2013 have no watchdog; of them alone a robot may still be driving."""
    assert Talk().run(0.01).sent[0][1].startswith(b"@65549e")


def test_our_board_gets_check_watchdog_and_period():
    talk = Talk(plan=Plan(watchdog_ms=300, period_ms=40)).until_ready()
    assert talk.board.decoder.checked and talk.session.checked
    assert talk.board.watchdog_s == 0.3
    assert talk.board.period_s == 0.04


def test_a_board_without_protocol_is_taken_as_one_of_2013():
    """It answers who it is again and again, and never what it speaks."""
    talk = Talk(FakeBoard(unknown=MODERN)).until_ready().run(3)
    assert talk.session.board.protocol == 1 and not talk.session.checked
    assert talk.session.counters.unanswered == 0 and talk.session.motion.pace == SLOW


@pytest.mark.parametrize("code", [8, 6])
def test_a_2013_board_is_asked_for_nothing_new(code):
    talk = Talk(FakeBoard(version=1, stream_code=code)).until_ready().run(3)
    assert {code for code in codes(talk) if code > 19} == {READ_PROTOCOL}  # to learn which board it is
    assert all(not frame.args for frame in talk.board.heard)


def test_half_a_frame_and_junk_before_the_answer_do_no_harm():
    talk = Talk()
    talk.board.out += b"@8,12" + bytes(range(128, 256)) * 4
    assert talk.until_ready().now < 0.6


def test_a_board_that_is_not_admitted_gets_nothing_set():
    def refuse(board):
        raise WrongRobot("another")

    talk = Talk(admit=refuse)
    with pytest.raises(WrongRobot):
        talk.run(1)
    assert 5 in codes(talk) and set(codes(talk)) <= {READ_PROTOCOL, 5, 13}


def test_a_board_that_streams_too_slowly_is_a_timeout():
    """Each first frame completes the greeting; the next one comes after the stream counts as stale."""
    with pytest.raises(BoardTimeout, match="no telemetry follows, expected a frame every 300 ms"):
        Talk(plan=Plan(period_ms=300), greeting_s=3.0).run(10)


@pytest.mark.parametrize(
    "late_s, error, words",
    [
        (0.6, HostBusy, "computer was too busy.* did not answer in time; close busy programs"),
        (0.4, BoardTimeout, "has answered, but no telemetry follows"),
    ],
)
def test_a_board_without_an_answer_while_this_program_was_late_is_not_blamed(late_s, error, words):
    talk = Talk()
    talk.until(lambda: talk.session.board is not None)
    talk.board.mute = True
    talk.now += late_s
    with pytest.raises(error, match=words):
        talk.run(10.0)


@pytest.mark.parametrize("again", [False, True], ids=["", "noticed by the next command"])
@pytest.mark.parametrize("late_s, reason", [(0.0, "no_telemetry"), (0.26, "host_paused")])
def test_a_silence_beside_a_late_program_is_blamed_on_the_program(late_s, reason, again):
    talk = Talk().until_ready()
    talk.session.drive((300, 0), talk.now)
    talk.board.mute = True
    talk.now += late_s
    if again:
        talk.session.drive((300, 0), talk.now)
    talk.run(0.5)
    assert talk.session.motion.stop_reason == reason


def test_a_board_that_ended_the_check_amid_the_greeting_is_greeted_once_more():
    """It heard nothing for 2 s, as when this program was suspended."""
    talk = Talk()
    talk.until(lambda: talk.session.checked)
    talk.board.decoder.checked = False
    assert talk.until_ready().now < 3.0


# -- telemetry


def test_board_time_runs_on_over_its_wrap():
    """16 bits of 64 us are 4.194 s."""
    counts = Talk().until_ready().run(10).counts
    gaps = [b.time_s - a.time_s for a, b in zip(counts, counts[1:])]
    assert min(gaps) > 0.015 and max(gaps) < 0.025


def test_damaged_frames_are_counted_by_reason_and_never_used():
    talk = Talk().until_ready()
    talk.to_host = lambda data: data.replace(b",120,", b",121,")
    before = len(talk.counts)
    talk.run(0.2)
    assert talk.session.counters.garbage["bad_check"] >= 5
    assert len(talk.counts) == before


def test_counters_that_were_requested_are_a_reply_and_no_telemetry():
    """Else their missing sonars would be polled for the rest of the session."""
    talk = Talk().until_ready().run(0.1)
    talk.session.request(6)
    talk.run(0.1)
    talk.until(lambda: any(event.frame.code == 6 for event in talk.seen(Reply)))
    talk.run(1)
    assert 7 not in codes(talk) and talk.counts and all(counts.sonars for counts in talk.counts)


def test_unanswered_requests_are_counted():
    talk = Talk().until_ready()
    talk.to_host = lambda data: re.sub(rb"@30,[^e]*e", b"", data)
    talk.run(3)
    assert talk.session.counters.unanswered == pytest.approx(5, abs=1)


# -- a new link


def relinked(same):
    """A board that ran on while its cable was out, greeted again."""
    talk = Talk().until_ready().run(0.3)
    talk.session.lose(talk.now)
    talk.run(0.1)
    talk.events.clear()
    talk.session.relink(talk.now, same)
    return talk.until_ready()


@pytest.mark.parametrize("same", [True, False])
def test_a_board_that_ran_on_keeps_its_baseline_unless_another_answered_meanwhile(same):
    assert [event.restarted for event in relinked(same).seen(Ready)] == [not same]


# -- motion


def test_the_check_mode_is_fed_while_idle():
    """It ends after 2 s without a valid frame."""
    talk = Talk().until_ready()
    start = talk.now
    talk.run(5)
    times = [sent_s for sent_s, data in talk.sent if sent_s > start]
    assert max(b - a for a, b in zip(times, times[1:])) < 0.6


@pytest.mark.parametrize("code", [8, 6])
def test_a_2013_board_is_not_flooded(code):
    talk = Talk(FakeBoard(version=1, stream_code=code)).until_ready().run(0.5)
    start, before = talk.now, len(talk.board.heard)
    for i in range(1000):
        talk.session.drive((100 + i % 7, 0), talk.now)
        talk.run(0.002)
    assert (len(talk.board.heard) - before) / (talk.now - start) <= BOARD_2013_MAX_HZ


def test_a_stop_is_plain_and_repeated_until_the_wheels_stand():
    talk = Talk().until_ready()
    talk.session.drive((200, 0), talk.now)
    talk.run(0.5)
    talk.to_board = lambda data: data.replace(b"@13e", b"@13,")
    stopped_s = talk.now
    talk.session.stop(talk.now)
    talk.run(0.2)
    assert talk.sent_since(stopped_s).count(b"@13e") >= 4
    talk.to_board = lambda data: data
    talk.until(lambda: not talk.session.motion.stopping, 0.3)
    assert talk.board.speeds == (0, 0)


# -- restarts


def test_a_board_reset_is_greeted_anew_and_stays_stopped():
    talk = Talk().until_ready()
    talk.session.drive((200, 0), talk.now)
    talk.run(0.5)
    talk.board.reset(talk.now)
    reset_s, talk.events = talk.now, []
    assert talk.until_ready().now - reset_s < 0.5
    talk.run(1.0)
    assert talk.seen(Ready)[0].restarted
    assert talk.board.speeds == (0, 0)
    assert b"@11" not in talk.sent_since(reset_s + 0.3)
    assert talk.session.counters.restarts == 1


def test_a_board_whose_check_has_ended_is_greeted_anew():
    talk = Talk().until_ready().run(0.5)
    talk.board.decoder.checked, talk.events = False, []
    talk.until_ready()
    assert talk.seen(Ready)[0].restarted and talk.board.decoder.checked


# -- who stops the robot, and what starts it again


def test_a_stop_is_confirmed_after_every_greeting():
    """The stop before the silence may have been lost with all that the greeting sent."""
    talk = Talk(plan=Plan(watchdog_ms=0)).until_ready()
    talk.session.drive((300, 0), talk.now)
    talk.run(0.3)
    talk.session.stop(talk.now)
    talk.to_board = talk.to_host = lambda data: b""
    talk.run(0.6)
    talk.to_host = lambda data: data
    talk.to_board = lambda data: data.replace(b"@13e", b"") if not talk.session.ready else data
    talk.run(2.0)
    assert talk.session.ready and talk.board.speeds == (0, 0)


def test_a_calibration_is_watched_within_the_boards_watchdog():
    talk = Talk().until_ready().run(0.2)
    begun_s = talk.now
    talk.session.request(1)
    talk.run(1.0)
    times = [sent_s for sent_s, _ in talk.sent if sent_s >= begun_s]
    assert max(b - a for a, b in zip(times, times[1:])) < 0.25


def test_a_board_that_started_two_seconds_later_than_before_has_restarted():
    talk = Talk().until_ready().run(5.0)
    talk.board.mute, talk.events = True, []
    talk.run(1.0)
    talk.board.started_s += 2.0
    talk.board.mute = False
    assert talk.until_ready().seen(Ready)[-1].restarted


# -- commands that waited in a queue


@pytest.fixture
def paused():
    """A session that drives, and is not attended to for 0.4 s; its commands come through a queue."""
    talk = Talk().until_ready()
    talk.session.queued_s = QUEUED_S
    assert talk.session.drive((100, 0), talk.now)
    talk.run(0.1)
    talk.now += 0.4
    return talk


def test_a_command_that_waited_is_refused_if_the_port_is_read_first(paused):
    paused.step()
    assert not paused.session.drive((100, 0), paused.now)
