"""Board time to host time under jitter, drift, wraps and gaps, and the operator's delay; all time is simulated."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.protocol.table import TICK_S
from mrl_driver.safety.operator_delay import DRIFT, MAX_DELAY_S, DelayGuard, EchoDelay, Lateness, delay_text
from mrl_driver.session.board_clock import MAX_DRIFT, BoardClock
from mrl_driver.session.polling import RoundTrip

from .talk import Talk

USB_JITTER_S = 0.016
STAMP_ERROR_S = 1e-3


def int16(ticks: int) -> int:
    return (ticks + 0x8000) % 0x10000 - 0x8000


def run(seed, drift, seconds, jitter_s=USB_JITTER_S, period_s=0.02):
    """Yields (true host time, stamp, clock) for each frame of a board whose clock is off by `drift`."""
    rng, clock = random.Random(seed), BoardClock()
    start_s, arrival_s = rng.uniform(0, 1e5), 0.0
    for n in range(int(seconds / period_s)):
        true_s = start_s + n * period_s
        arrival_s = max(arrival_s, true_s + rng.uniform(0, jitter_s))
        yield (
            true_s,
            clock.update(int16(int(n * period_s * (1 + drift) / TICK_S) + 777 * seed), arrival_s),
            clock,
        )


@pytest.mark.parametrize("seed", range(6))
def test_stamp_is_exact_to_a_millisecond_after_ten_seconds(seed):
    drift = random.Random(seed).uniform(-0.005, 0.005)
    errors = sorted(abs(stamp_s - true_s) for true_s, stamp_s, _ in list(run(seed, drift, 40))[500:])
    assert errors[int(0.99 * len(errors))] < STAMP_ERROR_S


@given(st.integers(0, 99), st.floats(-0.005, 0.005))
def test_stamps_strictly_increase(seed, drift):
    stamps = [stamp_s for _, stamp_s, _ in run(seed, drift, 5)]
    assert all(a < b for a, b in zip(stamps, stamps[1:]))


@given(st.integers(0, 99), st.floats(-0.005, 0.005))
def test_a_stamp_is_not_after_its_arrival(seed, drift):
    assert all(clock.latency_s >= 0.0 for _, _, clock in run(seed, drift, 5))


@pytest.mark.parametrize("drift", [0.005, -0.005])
def test_a_quarter_of_an_hour_out_of_reach_is_told_by_the_drift_of_before(drift):
    """870 s are 4.35 s of drift, more than the board's time takes to wrap."""
    clock = BoardClock()
    times = [0.02 * n for n in range(1500)] + [900.0, 901.0, 910.0]
    *_, last = (clock.update(int16(int(time / (1 + drift) / TICK_S)), time) for time in times)
    assert last == pytest.approx(910.0, abs=STAMP_ERROR_S)


@given(st.integers(0, 60), st.floats(0.0, 4.0))
def test_a_gap_of_many_wraps_is_bridged_by_the_host_clock(wraps, rest_s):
    clock, gap_s = BoardClock(), wraps * 65536 * TICK_S + rest_s
    clock.update(0, 100.0)
    clock.update(int16(int(gap_s / TICK_S)), 100.0 + gap_s)
    assert clock.board_s == pytest.approx(gap_s, abs=2 * TICK_S)


def test_drift_beyond_belief_is_cut():
    *_, (_, _, clock) = run(1, 0.05, 10)
    assert clock.drift == -MAX_DRIFT


def test_a_late_burst_is_no_wrap():
    """Frames that waited three seconds follow each other in board time."""
    clock = BoardClock()
    clock.update(0, 100.0, next_one=True)
    clock.update(312, 103.0, next_one=True)
    assert clock.board_s == pytest.approx(312 * TICK_S)


def waiting(before_s, resumed_s):
    """Yields (true host time, stamp, board time) from the first frame after a stall.

    The stall begins at `before_s`.  The link keeps the frames of its first two seconds, which arrive at `resumed_s`,
    and loses the others.  30 s follow.
    """
    clock = BoardClock()
    kept = int((before_s + 2.0) / 0.02)
    for n in (*range(kept), *range(int(resumed_s / 0.02), int((resumed_s + 30) / 0.02))):
        board_s = 0.02 * n
        arrival_s = resumed_s if before_s <= board_s < resumed_s else board_s
        stamp_s = clock.update(
            int16(round(board_s / TICK_S)), arrival_s, next_one=n < kept or board_s > resumed_s
        )
        if board_s >= resumed_s:
            yield board_s, stamp_s, clock.board_s


@pytest.mark.parametrize("before_s", [1.5, 20.0])
@pytest.mark.parametrize("resumed_s", [30.0, 300.0])
def test_a_gap_behind_frames_that_waited_is_counted_from_their_stamps(before_s, resumed_s):
    """They arrive just before the frame that ends the gap."""
    true_s, _, board_s = next(waiting(before_s, resumed_s))
    assert board_s == pytest.approx(true_s, abs=STAMP_ERROR_S)


@pytest.mark.parametrize("resumed_s", [30.0, 300.0])
def test_frames_that_waited_do_not_count_as_drift(resumed_s):
    """When they are the oldest of the window, too."""
    late_s = [true_s - stamp_s for true_s, stamp_s, _ in waiting(20.0, resumed_s)]
    assert max(late_s) < STAMP_ERROR_S


def test_a_suspended_computer_does_not_count_as_drift():
    """Its clock stands still for a second, whose frames arrive at once.  2 s later the stamps are exact."""
    clock = BoardClock()
    for n in range(3000):
        board_s = 0.02 * n
        arrival_s = board_s if board_s < 20.0 else max(20.0, board_s - 1.0)
        stamp_s = clock.update(int16(round(board_s / TICK_S)), arrival_s, next_one=True)
        assert board_s < 23.0 or arrival_s - stamp_s < STAMP_ERROR_S


def test_stamps_of_frames_that_came_at_once_are_a_microsecond_apart():
    clock = BoardClock()
    first, second = (clock.update(ticks, 1.0) for ticks in (0, 1))
    assert second - first == pytest.approx(1e-6, abs=1e-7)


@pytest.mark.parametrize("late_s", [-1.9, 1.9])
def test_a_gap_is_told_to_within_two_seconds(late_s):
    clock, gap = BoardClock(), 0x10000 + 1000 + 0x8000
    clock.update(0, 0.0)
    clock.update(int16(gap), gap * TICK_S + late_s)
    assert clock.board_s == pytest.approx(gap * TICK_S)


def test_the_least_delay_is_that_of_the_last_25_s():
    """After 40 s the way becomes 5 ms longer."""
    clock, ticks = BoardClock(), round(0.02 / TICK_S)
    for frame in range(3350):
        board_s = frame * ticks * TICK_S
        clock.update(int16(frame * ticks), board_s + (0.005 if board_s > 40 else 0.0))
    assert clock.latency_s < 1e-4


def test_no_drift_is_read_from_less_than_a_second():
    clock = BoardClock()
    for ticks, arrival_s in ((0, 0.0), (round(0.3 / TICK_S), 0.301), (round(0.6 / TICK_S), 0.602)):
        clock.update(ticks, arrival_s)
    assert clock.drift == 0.0


def test_a_drift_of_more_than_26_s_ago_is_forgotten():
    """The board's clock is slow for 40 s, then fast for 27 s."""
    clock, ticks = BoardClock(), 0.0
    for n in range(3350):
        ticks += 0.02 * (1 + (-0.004 if n < 2000 else 0.004)) / TICK_S
        clock.update(int16(int(ticks)), 0.02 * n)
    assert clock.drift == pytest.approx(-0.004, abs=2e-4)


LIMIT_S = 0.5


@pytest.mark.parametrize(
    "sent, echoed, now_s, delay_s",
    [
        ([10.0], (10.0, 10.03), 10.04, 0.03),
        ([10.0, 10.05, 10.1], (10.0, 10.02), 10.8, 0.75),
        ([10.0, 10.05], (10.05, 10.06), 20.0, 0.01),
    ],
    ids=["newest echo", "a command without an echo grows older", "an echo answers the commands before it"],
)
def test_the_delay_is_that_of_the_newest_command(sent, echoed, now_s, delay_s):
    """The robot follows the newest command alone.  The delay is unknown before the first and when nobody echoes."""
    delay = EchoDelay()
    assert delay_text(delay.delay_s(5.0)) == "unknown"
    for stamp_s in sent:
        delay.sent(stamp_s)
    delay.echoed(*echoed)
    assert delay.delay_s(now_s) == pytest.approx(delay_s)
    delay.forget()
    assert delay_text(delay.delay_s(now_s)) == "unknown"


@pytest.mark.parametrize("delay_s, words", [(0.25, "250 ms"), (1.5, "1.5 s")])
def test_a_delay_is_in_milliseconds_below_a_second(delay_s, words):
    assert delay_text(delay_s) == words


def test_no_more_than_a_thousand_commands_wait_for_their_echo():
    delay = EchoDelay()
    for stamp_s in range(1001):
        delay.sent(stamp_s)
    delay.echoed(999, 999.5)
    assert delay.delay_s(2000.0) == 0.5


def test_above_the_limit_nothing_drives_until_the_key_is_released():
    guard = DelayGuard(LIMIT_S)
    assert guard.may_drive(True, 0.1)
    assert not guard.may_drive(True, 0.62)
    assert not guard.may_drive(True, 0.1), "the key is still held"
    assert guard.reason.startswith(
        "stopped: the delay is 620 ms, above the limit of 500 ms: computer or network is too"
    )
    assert not guard.may_drive(False, 0.9) and not guard.may_drive(True, 0.9), "pressed while it is too long"
    assert not guard.may_drive(False, 0.1) and not guard.reason
    assert guard.may_drive(True, 0.1)


@pytest.mark.parametrize("most_s, delay_s", [(0.0, 9.0), (LIMIT_S, math.nan)])
def test_no_limit_and_an_unknown_delay_do_not_block(most_s, delay_s):
    assert DelayGuard(most_s).may_drive(True, delay_s)


def test_an_echo_that_ceases_ends_the_driving_until_the_key_is_released():
    guard = DelayGuard(LIMIT_S)
    guard.may_drive(True, 0.1)
    guard.lose()
    assert not guard.may_drive(True, math.nan) and "no longer reports" in guard.reason
    guard.may_drive(False, math.nan)
    assert guard.may_drive(True, math.nan)


def test_lateness_needs_no_common_clock():
    """A faster message is the new measure."""
    lateness = Lateness()
    assert lateness.of(5000.0, 3.2) == 0.0
    assert lateness.of(5001.0, 4.9) == pytest.approx(0.7, abs=2 * DRIFT)
    assert lateness.of(5002.0, 5.0) == 0.0
    assert lateness.of(5003.0, 6.2) == pytest.approx(0.2, abs=3 * DRIFT)


def test_the_usual_limit_of_the_delay_is_the_timeout_of_commands():
    assert MAX_DELAY_S == DEFAULTS.command_timeout_s


def test_a_silence_of_a_minute_hides_at_most_60_ms():
    """And clocks that drift apart by 500 ppm make nobody late in an hour."""
    lateness = Lateness()
    lateness.of(0.0, 0.0)
    assert lateness.of(59.0, 60.0) == pytest.approx(1.0 - 0.06)
    lateness = Lateness()
    assert max(lateness.of(n * 1.0, n * 1.0005) for n in range(3600)) < 1e-3


@pytest.mark.parametrize(
    "requests, answer_s, now_s, delay_s",
    [
        ([(10.0, True)], 10.3, 11.0, 0.3),
        ([(10.0, True), (12.0, False)], 12.1, 12.2, math.nan),
        ([(10.0, True), (12.0, False), (14.0, False)], None, 14.5, 4.5),
    ],
    ids=["answered", "may be that of the lost request", "two lost answers"],
)
def test_a_round_trip_is_from_the_request_to_its_answer(requests, answer_s, now_s, delay_s):
    trip = RoundTrip()
    for request in requests:
        trip.begin(*request)
    if answer_s:
        trip.end(answer_s)
    assert trip.delay_s(now_s) == pytest.approx(delay_s, nan_ok=True)


@pytest.mark.parametrize("delay_s", [0.0, 0.3, 1.5])
def test_a_session_measures_the_round_trip_of_its_link(delay_s):
    """Longer than the period of the request, too: the next one waits for the answer."""
    talk = Talk().until_ready()
    held = []

    def late(data):
        held.append((talk.now + delay_s, data))
        due = b"".join(each for at, each in held if at <= talk.now)
        held[:] = [each for each in held if each[0] > talk.now]
        return due

    talk.session.heard_s = (
        talk.now + delay_s
    )  # what comes now is telemetry of before, as on a line that is always late
    talk.to_host = late
    talk.run(5.0)
    assert delay_s <= talk.session.round_trip_s(talk.now) < delay_s + 0.05
