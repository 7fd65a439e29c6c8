"""The operator's delay: the echo, the limit, lateness by a clock that differs, and the round trip of a link."""

import math

import pytest

from mrl_driver.safety.operator_delay import DRIFT, DelayGuard, EchoDelay, Lateness, delay_text
from mrl_driver.session.polling import RoundTrip

from .talk import Talk

LIMIT_S = 0.5


# -- the operator's end


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
    """The robot follows the newest command alone.  The delay is unknown before the first command."""
    delay = EchoDelay()
    assert delay_text(delay.delay_s(5.0)) == "unknown"
    for stamp_s in sent:
        delay.sent(stamp_s)
    delay.echoed(*echoed)
    assert delay.delay_s(now_s) == pytest.approx(delay_s)


def test_above_the_limit_nothing_drives_until_the_key_is_released():
    guard = DelayGuard(LIMIT_S, "--max-delay")
    assert guard.may_drive(True, 0.1)
    assert not guard.may_drive(True, 0.62)
    assert not guard.may_drive(True, 0.1), "the key is still held"
    assert guard.reason == (
        "stopped: the delay is 620 ms, above the limit of 500 ms (--max-delay); release and press again"
    )
    assert not guard.may_drive(False, 0.9) and not guard.may_drive(True, 0.9), "pressed while it is too long"
    assert not guard.may_drive(False, 0.1) and not guard.reason
    assert guard.may_drive(True, 0.1)


@pytest.mark.parametrize("most_s, delay_s", [(0.0, 9.0), (LIMIT_S, math.nan)])
def test_no_limit_and_an_unknown_delay_do_not_block(most_s, delay_s):
    assert DelayGuard(most_s, "--max-delay").may_drive(True, delay_s)


def test_an_echo_that_ceases_ends_the_driving_until_the_key_is_released():
    guard = DelayGuard(LIMIT_S, "~max_delay")
    guard.may_drive(True, 0.1)
    guard.lose()
    assert not guard.may_drive(True, math.nan) and "no longer reports" in guard.reason
    guard.may_drive(False, math.nan)
    assert guard.may_drive(True, math.nan)


# -- the robot's end


def test_lateness_needs_no_common_clock():
    """A faster message is the new measure."""
    lateness = Lateness()
    assert lateness.of(5000.0, 3.2) == 0.0
    assert lateness.of(5001.0, 4.9) == pytest.approx(0.7, abs=2 * DRIFT)
    assert lateness.of(5002.0, 5.0) == 0.0
    assert lateness.of(5003.0, 6.2) == pytest.approx(0.2, abs=3 * DRIFT)


def test_a_silence_of_a_minute_hides_at_most_60_ms():
    """And clocks that drift apart by 500 ppm make nobody late in an hour."""
    lateness = Lateness()
    lateness.of(0.0, 0.0)
    assert lateness.of(59.0, 60.0) == pytest.approx(1.0 - 60 * DRIFT)
    lateness = Lateness()
    assert max(lateness.of(n * 1.0, n * 1.0005) for n in range(3600)) < 1e-3


# -- the link of `mrl drive`


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
