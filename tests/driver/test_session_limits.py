"""The session fed by hand: its limits to the instant, what it counts, and what it sends in each state."""

import contextlib
import math

import pytest

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import Frame, Stamp, encode_reply
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME, SENSOR_BY_NAME
from mrl_driver.session.events import ImuReading, Ready, Reply, Stale, Status
from mrl_driver.session.handshake import Board, Plan
from mrl_driver.session.link_counters import Counters
from mrl_driver.session.polling import BUSY_S
from mrl_driver.session.sensor_polling import SENSOR_STREAM
from mrl_driver.session.sequence import Stream
from mrl_driver.session.session import Counts, Session

from .talk import Talk

LATE_S, PAUSE_S, STALE_S, REFUSED_S = 0.1, 0.25, 0.28, 0.15
OURS = frozenset({"check", "watchdog", "period", "config", "sonars"})
MOVE, STATUS, INFO = b"@11,", b"@30", b"@5"
STOP_BYTES = b"@13e"
MOVE_MOTORS = BY_NAME["move_motors"].code
OMNI, SENSING = BY_NAME["start_omni_stream"].code, BY_NAME[SENSOR_STREAM].code
IMU = BY_NAME["read_imu"].code
START_IMU = b"@47,"
LEVEL = (0, 0, 0, 0, 0, 16384)


class Fed:
    """A session that has joined a board, and frames of this board."""

    def __init__(self, capabilities=OURS, code=8, checked=True, now=0.0, protocol=2, **options):
        admit = options.pop("admit", lambda board: None)
        self.code, self.sequence, self.start_s = code, 0, now
        self.session = Session(admit, now, **options)
        board = Board(1, protocol, 1.72, 12.0, 25.0, protocol, frozenset(capabilities))
        self.events = self.session.join(board, code, checked, now)

    @property
    def motion(self):
        return self.session.motion

    def at(self, now, data=b""):
        """Bytes arrive and what is due is done; returns what is sent."""
        self.events += self.session.receive(data, now)
        self.events += self.session.tick(now)
        return self.session.take()

    def frame(self, now, args=(0, 0, 120, 45, 645), code=None, number=None):
        """A frame of the stream, with the next number or this one."""
        self.sequence = self.sequence + 1 if number is None else number
        stamp = Stamp(self.sequence, int((now - self.start_s) / 64e-6) % 32768)
        return encode_reply(code or self.code, *args, stamp=stamp, checked=self.session.checked)

    def say(self, code, *args):
        return encode_reply(code, *args, checked=self.session.checked)

    def status(self, reason="none", uptime_s=100):
        return self.say(30, 0, uptime_s, 1, STOP_REASONS.index(reason), 0, 0)

    def still(self, until_s, args=(0, 0, 120, 45, 645)):
        """The wheels stand, each 20 ms."""
        steps = round(until_s / 0.02)
        return b"".join(self.at(i * 0.02, self.frame(i * 0.02, args)) for i in range(1, steps + 1))

    def drive(self, now, speeds=(200, 0), **options):
        assert self.session.drive(speeds, now, **options)
        return self.session.take()

    def seen(self, kind):
        return [event for event in self.events if isinstance(event, kind)]


@pytest.mark.parametrize("now, sends", [(LATE_S - 0.001, True), (LATE_S, False)])
def test_a_command_is_not_sent_from_the_instant_at_which_telemetry_is_late(now, sends):
    fed = Fed()
    assert fed.session.drive((200, 0), now) is sends
    assert (MOVE in fed.session.take()) is sends and fed.motion.target == (200, 0)


@pytest.mark.parametrize("moves, taken", [(None, True), (True, False)])
@pytest.mark.parametrize("now, late", [(LATE_S - 0.001, False), (LATE_S, True)])
def test_a_command_of_zero_brakes_and_is_dropped_from_the_instant_at_which_telemetry_is_late(
    now, late, moves, taken
):
    """So is a command to move that zones have lowered to zero, but it is not carried out."""
    fed = Fed()
    fed.drive(0.05)
    assert fed.session.drive((0, 0), now, moves) is (taken or not late)
    assert fed.session.take() == STOP_BYTES
    assert (fed.motion.target is None) == late


def test_a_command_that_was_sent_before_may_be_given_again_while_telemetry_is_late():
    fed = Fed()
    fed.drive(0.05)
    assert fed.drive(STALE_S - 0.001) == b"" and fed.motion.target == (200, 0)


def test_a_stale_board_gets_a_stop_by_a_thread_that_drives():
    """The reading thread hangs, and has not noticed it."""
    fed = Fed()
    fed.drive(0.05)
    assert not fed.session.drive((200, 0), STALE_S)
    assert (fed.session.take(), fed.motion.stop_reason) == (STOP_BYTES, "no_telemetry")


NEWER = {
    "a slower command": lambda fed, now: fed.session.drive((20, 0), now),
    "a lower limit": lambda fed, now: fed.session.adjust((20, 0), now),
    "none, and stale": lambda fed, now: None,
}


@pytest.mark.parametrize("newer", NEWER)
def test_what_feeds_the_watchdog_while_a_newer_command_is_held_back_comes_after_a_stop(newer):
    now = STALE_S if "stale" in newer else LATE_S
    fed = Fed()
    fed.drive(0.05)
    NEWER[newer](fed, now)
    held_back = fed.session.take()
    fed.session.expire(now + 0.001)
    assert (held_back, fed.session.take(), fed.motion.target) == (b"", STOP_BYTES, None)


def test_what_feeds_the_watchdog_comes_after_the_command_in_force():
    """Which may have been lost."""
    fed = Fed()
    sent = fed.drive(0.05)
    fed.session.expire(0.06)
    assert fed.session.take() == sent


def test_what_feeds_the_watchdog_comes_after_a_stop_that_is_not_confirmed():
    fed = Fed()
    fed.drive(0.05)
    fed.session.stop(0.06)
    fed.session.take()
    fed.session.expire(0.07)
    assert fed.session.take() == STOP_BYTES


def test_while_telemetry_is_late_a_command_that_was_sent_does_not_prove_that_it_arrived():
    fed = Fed()
    fed.drive(0.05)
    fed.session.expire(LATE_S)
    assert (fed.session.take(), fed.motion.stop_reason) == (STOP_BYTES, "no_telemetry")


@pytest.mark.parametrize("options", [{"capabilities": ()}, {"plan": Plan(watchdog_ms=0)}])
@pytest.mark.parametrize("newer", ["a slower command", "a lower limit"])
def test_without_a_watchdog_a_command_that_is_held_back_is_a_stop(newer, options):
    fed = Fed(**options)
    fed.drive(0.05)
    NEWER[newer](fed, LATE_S)
    assert (fed.session.take(), fed.motion.target) == (STOP_BYTES, None)


@pytest.mark.parametrize("now, stops", [(STALE_S - 0.001, False), (STALE_S, True)])
def test_what_a_request_turns_is_stopped_by_whoever_sends_once_the_board_is_stale(now, stops):
    fed = Fed()
    fed.still(0.4)
    fed.session.request(MOVE_MOTORS, 20, 20)
    fed.session.take()
    fed.session.expire(0.4 + now)
    assert (STOP_BYTES in fed.session.take()) is stops


@pytest.mark.parametrize("now, refused", [(STALE_S - 0.001, False), (STALE_S, True)])
def test_a_stale_board_is_silent_for_a_request_that_turns_motors(now, refused):
    with pytest.raises(BoardTimeout, match="nothing was sent") if refused else contextlib.nullcontext():
        Fed().session.require_answers(now)


@pytest.mark.parametrize("capabilities, stops", [(OURS, True), (OURS - {"watchdog"}, False)])
def test_what_a_request_turns_is_stopped_three_seconds_after_the_last_one(capabilities, stops):
    fed = Fed(capabilities)
    fed.still(0.4)
    for now in (0.42, 0.44):
        fed.at(now, fed.frame(now))
        fed.session.request(MOVE_MOTORS, 20, 20)
    end_s = 0.44 + BUSY_S
    for step in range(23, round(end_s / 0.02)):
        assert STOP_BYTES not in fed.at(0.02 * step, fed.frame(0.02 * step))
    sent = fed.at(end_s, fed.frame(end_s))
    assert (STOP_BYTES in sent, fed.motion.stop_reason == "command_timeout") == (stops, stops)


def test_a_command_whose_time_is_over_is_stopped_by_whoever_sends():
    fed = Fed(command_timeout_s=0.09)
    fed.drive(0.0)
    fed.session.expire(0.089)
    assert STOP_BYTES not in fed.session.take()
    fed.session.expire(0.09)
    assert fed.session.take() == STOP_BYTES and fed.motion.stop_reason == "command_timeout"


def test_speeds_are_adjusted_at_once_unless_telemetry_is_late():
    fed = Fed()
    fed.drive(0.05)
    fed.session.adjust((100, 0), 0.06)
    assert fed.session.take().startswith(b"@11,100,0,")
    fed.session.adjust((50, 0), LATE_S)
    assert fed.session.take() == b""


def test_requests_that_are_due_wait_while_telemetry_is_late():
    asked = {}
    for now in (LATE_S - 0.001, LATE_S):
        fed = Fed()
        fed.session.request(1)
        fed.session.take()
        asked[now] = STATUS in fed.at(now)
    assert list(asked.values()) == [True, False]


def test_telemetry_is_stale_at_its_limit_and_its_age_is_told():
    fed = Fed()
    fed.drive(0.05)
    fed.at(0.15)
    fed.session.tick(STALE_S - 0.001)
    assert fed.session.ready
    assert fed.session.tick(STALE_S) == [Stale(STALE_S, False)]
    assert fed.motion.stop_reason == "no_telemetry"


@pytest.fixture
def settled():
    """A board of 2013 that stands, with no stop to confirm; its next request is due in a second."""
    fed = Fed((), checked=False, protocol=1)
    fed.still(0.4)
    assert not fed.motion.stopping
    return fed


def test_the_next_tick_is_due_when_telemetry_is_stale_or_a_command_is_to_be_repeated(settled):
    assert settled.session.deadline(0.4) == pytest.approx(0.4 + STALE_S)
    settled.drive(0.4)
    assert settled.session.deadline(0.4) == pytest.approx(0.5)


def test_late_telemetry_lets_nothing_be_due_at_once():
    fed = Fed()
    fed.drive(0.0)
    fed.at(LATE_S)
    assert fed.session.deadline(LATE_S) == pytest.approx(2 * LATE_S)


def test_while_the_board_is_greeted_a_stop_is_due_too():
    session = Session(lambda board: None, 0.0)
    session.tick(0.0)
    assert session.deadline(0.0) == 0.25
    session.stop(0.0)
    assert session.deadline(0.0) == 0.05


def test_a_new_session_may_have_work():
    assert Session(lambda board: None, 0.0).hurried


def test_a_session_has_earlier_work_after_the_answer_of_a_sensor_and_not_after_others():
    fed = Fed()
    fed.at(0.02, fed.frame(0.02))
    fed.session.deadline(0.02)
    fed.session.receive(fed.frame(0.04), 0.04)
    fed.session.receive(fed.say(5, 2500, 172, 1200, 2, 1), 0.05)
    assert not fed.session.hurried
    fed.session.receive(fed.say(SENSOR_BY_NAME["light"].code, 500), 0.05)
    assert fed.session.hurried


def test_a_request_that_turns_motors_is_earlier_work():
    fed = Fed()
    fed.at(0.02, fed.frame(0.02))
    fed.session.deadline(0.02)
    assert not fed.session.hurried
    fed.session.request(MOVE_MOTORS, 20, 20)
    assert fed.session.hurried


@pytest.mark.parametrize("call", ["receive", "tick"])
@pytest.mark.parametrize("now, paused", [(PAUSE_S, False), (PAUSE_S + 0.001, True)])
def test_a_command_ends_after_a_pause_longer_than_a_quarter_of_a_second(call, now, paused):
    fed = Fed()
    fed.drive(0.0)
    if call == "receive":
        fed.session.receive(b"", now)
    else:
        fed.session.tick(now)
    assert (fed.motion.target is None, fed.motion.stop_reason == "host_paused") == (paused, paused)


@pytest.mark.parametrize("now, reason", [(1.249, "host_paused"), (1.25, "link_watchdog")])
def test_a_late_program_is_blamed_for_a_second(now, reason):
    """It was late at 0.25 s, and is not again."""
    fed = Fed()
    fed.drive(0.0)
    for moment in (eighth / 8 for eighth in range(2, 10)):
        fed.at(moment, fed.frame(moment))
        fed.drive(moment)
    fed.at(now, fed.status("link_watchdog"))
    assert fed.motion.stop_reason == reason


def test_each_call_attends_to_the_board():
    """None of them is 0.25 s after the one before."""
    fed = Fed()
    fed.drive(0.0)
    fed.session.receive(fed.frame(0.2), 0.2)
    fed.drive(0.4)
    fed.session.receive(fed.frame(0.6), 0.6)
    fed.session.tick(0.8)
    assert fed.motion.stop_reason == "none"


@pytest.mark.parametrize("period_ms, pause_s", [(20, 0.25), (200, 0.4)])
def test_commands_are_refused_after_a_gap_longer_than_a_pause_and_than_two_periods(period_ms, pause_s):
    taken = []
    for now in (pause_s, pause_s + 0.001):
        fed = Fed(plan=Plan(period_ms=period_ms, stream=False))
        fed.session.queued_s = 1.0
        taken.append(fed.session.drive((200, 0), now))
    assert taken == [True, False]


def test_a_command_before_the_greeting_is_refused():
    assert Session(lambda board: None, 0.0).drive((200, 0), 0.0) is False


@pytest.mark.parametrize("moved", [(), (0,), (1,)], ids=["two wheels", "third stands", "third turns"])
def test_the_wheels_stand_still_if_the_third_does_too_though_sonars_change(moved):
    fed = Fed(OURS | {"omni"}, OMNI) if moved else Fed()
    for i in range(1, 11):
        wheels = (7, 7, *(share * i for share in moved))
        fed.at(i * 0.02, fed.frame(i * 0.02, (*wheels, 100 + i, 200 - i, 300 + i)))
    assert fed.motion.stopping == any(moved)


def test_a_stop_that_the_board_was_asked_for_is_not_one_of_its_own():
    fed = Fed()
    fed.at(0.02, fed.status())
    fed.session.stop(0.03)
    fed.at(0.04, fed.status("host"))
    assert fed.motion.stop_reason == "user"


def refused_at(now, answers_after_s=None):
    """Whether a command of time 0 counts as refused by a stop that the board tells of at `now`."""
    fed = Fed()
    fed.at(0.0, fed.status("stall"))
    if answers_after_s is not None:
        fed.session.identify()
        assert INFO in fed.at(0.0)
        fed.at(answers_after_s, fed.frame(answers_after_s) + fed.say(5, 2500, 172, 1200, 2, 1))
    begin_s = answers_after_s or 0.0
    fed.drive(begin_s)
    for i in range(int(now / 0.05)):
        fed.at(begin_s + 0.05 * i, fed.frame(begin_s + 0.05 * i))
    fed.session.receive(fed.status("stall"), begin_s + now)
    return fed.motion.target is None


@pytest.mark.parametrize(
    "answer_s, now, refused",
    [(0.2, 0.39, False), (0.2, 0.41, True), (0.24, 0.47, False), (0.24, 0.49, True)],
)
def test_long_enough_is_two_round_trips_on_a_slow_line(answer_s, now, refused):
    assert refused_at(now, answers_after_s=answer_s) is refused


@pytest.mark.parametrize("now, stops", [(REFUSED_S - 0.001, 0), (REFUSED_S, 1)])
def test_a_request_to_turn_motors_is_refused_after_that_time_too(now, stops):
    fed = Fed()
    fed.at(0.0, fed.status("stall"))
    fed.session.request(MOVE_MOTORS, 20, 20)
    fed.session.take()
    fed.session.receive(fed.status("stall"), now)
    assert fed.session.take().count(STOP_BYTES) == stops


@pytest.mark.parametrize(
    "watchdog_ms, capabilities, coast_s",
    [(250, OURS, 1.25), (1, OURS, 1.001), (0, OURS, math.inf), (250, OURS - {"watchdog"}, math.inf)],
)
def test_ready_tells_how_long_the_robot_may_coast(watchdog_ms, capabilities, coast_s):
    fed = Fed(capabilities, plan=Plan(watchdog_ms=watchdog_ms))
    assert fed.seen(Ready)[0].coast_s == pytest.approx(coast_s)


def test_a_lost_link_drops_the_command_and_what_was_not_sent():
    fed = Fed()
    assert fed.session.drive((200, 0), 0.05) and fed.session.out
    fed.session.lose(0.06)
    assert fed.session.take() == b"" and fed.motion.stop_reason == "link_lost"


def test_the_first_telemetry_has_the_time_of_the_greeting():
    fed = Fed(greeting_s=2.0)
    fed.session.tick(0.3)
    fed.session.tick(1.99)
    with pytest.raises(BoardTimeout):
        fed.session.tick(2.0)


def test_without_a_stream_no_telemetry_is_expected():
    fed = Fed(plan=Plan(stream=False))
    fed.session.tick(0.2)
    fed.session.tick(60.0)
    assert fed.session.ready


@pytest.mark.parametrize(
    ("board", "ended"),
    [
        ({"code": SENSING}, {b"@19", b"@26", b"@32"}),
        ({}, {b"@19", b"@32"}),
        ({"checked": False}, {b"@19", b"@32"}),
        ({"capabilities": OURS | {"imu"}}, {b"@19", b"@32", b"@48"}),
        ({"capabilities": (), "checked": False, "protocol": 1}, {b"@65555e"}),
    ],
)
def test_the_end_stops_the_streams_that_run_and_asks_for_nothing_that_the_board_does_not_know(board, ended):
    fed = Fed(**board)
    fed.session.take()
    fed.session.end()
    sent = fed.session.take()
    assert {part for part in (b"@19", b"@26", b"@32", b"@48", b"@65555e") if part in sent} == ended


def test_the_end_drops_the_command():
    fed = Fed()
    fed.drive(0.05)
    fed.session.end()
    assert (fed.motion.target, fed.motion.stop_reason) == (None, "closed")


@pytest.mark.parametrize("protocol, info, asks", [(2, INFO, True), (1, b"@65541e", False)])
def test_a_board_is_asked_again_who_it_is_and_its_protocol_if_it_knows_that(protocol, info, asks):
    fed = Fed(OURS if asks else (), checked=asks, protocol=protocol)
    fed.at(0.02, fed.frame(0.02))
    fed.session.deadline(0.02)
    fed.session.identify()
    assert fed.session.hurried
    sent = fed.at(0.03)
    assert (info in sent, b"@29" in sent) == (True, asks)


def test_a_board_that_is_greeted_is_not_asked_beside_it():
    fed = Fed()
    fed.session.lose(0.1)
    fed.session.identify()
    assert fed.session.take() == b""


def test_the_frame_before_a_session_that_joins_is_telemetry():
    session = Session(lambda board: None, 0.0)
    last = Frame(8, (5, 6, 120, 45, 645), Stamp(3, 0))
    events = session.join(Board(1, 2, 1.72, 12.0, 25.0, 2, OURS), 8, True, 0.0, last)
    assert [type(event) for event in events] == [Ready, Counts]
    assert (events[1].right, events[1].left, events[1].sonars) == (5, 6, (120, 45, 645))
    assert events[0].restarted


def test_three_wheels_have_three_counters_and_sonars():
    fed = Fed(OURS | {"omni"}, OMNI)
    fed.at(0.02, fed.frame(0.02, (1, 2, 3, 4, 5, 6)))
    counts = fed.seen(Counts)[0]
    assert (counts.right, counts.left, counts.others, counts.sonars) == (1, 2, (3,), (4, 5, 6))


@pytest.mark.parametrize("stream, polled", [(SENSOR_STREAM, False), (None, True)])
def test_sonars_are_asked_for_unless_the_robot_has_other_sensors(stream, polled):
    fed = Fed((), 6, checked=False, protocol=1, admit=lambda board: stream)
    assert (b"@65543e" in fed.at(0.02, fed.say(6, 1, 2))) is polled


def test_a_frame_that_was_overtaken_is_not_used():
    fed = Fed(now=100.0)
    for now, number in ((100.001, 1), (100.002, 2), (100.003, 4), (100.004, 3)):
        fed.at(now, fed.frame(now, number=number))
    assert [event.sequence for event in fed.seen(Counts)] == [1, 2, 4]
    assert fed.session.counters.overtaken == 1


COMPASS = BY_NAME["start_compass_stream"].code


@pytest.mark.parametrize(
    "kind, args, code", [(Counts, (0, 0, 120, 45, 645), 8), (ImuReading, LEVEL, IMU), (Reply, (90,), COMPASS)]
)
@pytest.mark.parametrize("now, used", [(STALE_S - 0.001, 0), (STALE_S, 1)])
def test_after_a_silence_no_frame_counts_as_overtaken(now, used, kind, args, code):
    fed = with_imu()
    fed.at(0.0, fed.frame(0.0, number=600))
    fed.events = fed.session.receive(fed.frame(now, args, code, number=100), now)
    assert len(fed.seen(kind)) == used


@pytest.mark.parametrize("code, args", [(8, (0, 0, 120, 45, 645)), (IMU, LEVEL), (COMPASS, (90,))])
def test_a_frame_that_arrives_late_has_the_boards_time(code, args):
    """It waited for 6 s, in which the 16 bits of board time wrap; its number says that none is missing."""
    fed = with_imu()
    first, late, last = fed.frame(0.02), fed.frame(0.04, args, code), fed.frame(0.06)
    fed.at(0.02, first)
    fed.events += fed.session.receive(late + last, 6.0)
    times = [event.time_s for event in fed.events if isinstance(event, (Counts, ImuReading))]
    assert times[-1] - times[0] == pytest.approx(0.04, abs=1e-3)
    assert max(b - a for a, b in zip(times, times[1:])) < 0.05


def test_a_reply_with_an_old_number_is_told_once():
    fed = Fed()
    data = fed.frame(0.02, (90,), COMPASS)
    fed.at(0.02, data + data)
    assert (len(fed.seen(Reply)), fed.session.counters.duplicates) == (1, 1)


def test_plain_frames_count_only_in_a_row():
    fed, plain = Fed(), encode_reply(8, 1, 2, 120, 45, 645)
    fed.at(0.01, plain + plain)
    fed.at(0.02, fed.frame(0.02))
    fed.at(0.03, plain + plain)
    assert fed.session.checked and fed.session.ready
    assert fed.session.counters.garbage == {"bad_check": 4}


def test_one_frame_with_a_checksum_is_believed():
    fed = Fed(checked=False)
    fed.at(0.01, encode_reply(8, 1, 2, 120, 45, 645, stamp=Stamp(1, 0), checked=True))
    assert fed.session.checked


@pytest.mark.parametrize(
    ("lost_s", "data", "counted"),
    [
        (None, encode_reply(5, 2500, 172, 1200, 2, 1), ({"bad_check": 1}, 0)),
        (0.01, encode_reply(8, 1, 2, 120, 45, 645), ({"bad_check": 1}, 0)),
        (0.01, encode_reply(5, 2500, 172, 1200, 2, 1), ({}, 1)),
    ],
    ids=["who it is, ready", "telemetry, greeted again", "who it is, greeted again"],
)
def test_a_plain_frame_of_a_board_with_checksums_is_garbage_unless_it_answers_a_greeting(
    lost_s, data, counted
):
    fed = Fed()
    if lost_s is not None:
        fed.session.lose(lost_s)
    fed.at(0.02, data)
    assert (fed.session.counters.garbage, fed.session.counters.frames) == counted


@pytest.mark.parametrize("watchdog_ms, repeat_s", [(250, 0.1), (100, 0.04), (0, 0.1)])
def test_a_command_is_repeated_in_two_fifths_of_the_watchdogs_time(watchdog_ms, repeat_s):
    assert Fed(plan=Plan(watchdog_ms=watchdog_ms)).motion.pace.repeat_s == pytest.approx(repeat_s)


def with_imu(**options):
    return Fed(OURS | {"imu"}, **options)


def test_the_imus_stream_is_not_started_again_while_it_runs():
    fed = with_imu()
    sent = fed.at(0.02, fed.frame(0.02))
    for i in range(1, 31):
        sent += fed.at(i * 0.1, fed.frame(i * 0.1) + fed.frame(i * 0.1, LEVEL, IMU))
    assert sent.count(START_IMU) == 1


def test_the_imus_stream_is_started_again_after_a_second_of_silence():
    fed = with_imu()
    sent = b"".join(fed.at(i * 0.1, fed.frame(i * 0.1)) for i in range(1, 14))
    assert sent.count(START_IMU) == 2


def test_a_frame_of_the_imu_that_nobody_asked_for_is_a_reply():
    fed = with_imu(plan=Plan(imu_period_ms=0))
    fed.at(0.01, fed.frame(0.01, LEVEL, IMU))
    assert (fed.seen(ImuReading), len(fed.seen(Reply))) == ([], 1)


def test_frames_of_the_imu_share_the_numbers_of_the_stream():
    fed = with_imu()
    for i, (number, code) in enumerate(((1, 8), (2, IMU), (4, IMU), (4, IMU), (5, 8), (7, 8))):
        fed.at(i * 1e-3, fed.frame(i * 1e-3, LEVEL if code == IMU else (0, 0, 120, 45, 645), code, number))
    counters = fed.session.counters
    assert (len(fed.seen(ImuReading)), len(fed.seen(Counts))) == (2, 3)
    assert (counters.lost, counters.duplicates) == (2, 1)


@pytest.mark.parametrize("uptime_s, restarted", [(2, True), (3, False)])
def test_a_status_that_another_one_overtook_is_no_restart(uptime_s, restarted):
    """A second after an uptime of 9 s, a restarted board has an uptime of 2 s at most."""
    fed = Fed()
    fed.drive(0.0)
    fed.session.receive(fed.status(uptime_s=9), 0.0)
    for i in range(1, 10):
        fed.at(i * 0.1, fed.frame(i * 0.1))
    fed.events += fed.session.receive(fed.status(uptime_s=uptime_s), 1.0)
    assert (not fed.session.ready, bool(fed.seen(Status))) == (restarted, restarted)
    assert (fed.motion.stop_reason == "restarted") is restarted


@pytest.mark.parametrize("uptime_s, restarted", [(2, True), (3, False)])
def test_a_plain_board_up_for_three_seconds_has_not_restarted_if_its_start_is_the_same(uptime_s, restarted):
    """It fell silent for a moment, and is greeted again."""
    talk = Talk(plan=Plan(check=False))
    talk.board.started_s = -float(uptime_s) + 0.9
    talk.until(lambda: talk.seen(Status) and talk.seen(Status)[-1].uptime_s == uptime_s)
    talk.board.mute = True
    talk.until(lambda: talk.seen(Stale))
    talk.board.mute = False
    talk.events.clear()
    assert talk.until_ready().seen(Ready)[0].restarted is restarted


def test_times_of_a_board_that_restarted_begin_anew():
    talk = Talk().until_ready().run(1.0)
    talk.board.reset(talk.now)
    talk.events = []
    talk.until_ready().run(0.1)
    assert max(abs(each.stamp_s - each.arrival_s) for each in talk.counts) < 0.01
    assert talk.counts[0].time_s == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("silent", [False, True])
@pytest.mark.parametrize("back, overtaken", [(1023, True), (1024, False)])
def test_a_number_up_to_1023_back_was_overtaken_unless_there_was_a_silence(back, overtaken, silent):
    counters = Counters()
    stream = Stream(counters)
    stream.missing(0, silent)
    lost = stream.missing(-back, silent)
    assert (lost == -1) == (overtaken and not silent)
    assert counters.overtaken == (overtaken and not silent)


def test_the_same_number_is_a_duplicate_even_after_a_silence():
    counters = Counters()
    stream = Stream(counters)
    assert [stream.missing(7, True), stream.missing(7, True)] == [0, -1]
    assert counters.duplicates == 1
