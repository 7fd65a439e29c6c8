"""The operator's delay: the echo, the limit, lateness by a clock that differs, and the round trip of a link."""

import math

import pytest

from mrl_driver.protocol.table import BY_NAME
from mrl_driver.safety.operator_delay import DRIFT, DelayGuard, EchoDelay, Lateness, delay_text
from mrl_driver.session.polling import RoundTrip

from .talk import Talk

INFO = BY_NAME["robot_info"].code
LIMIT_S = 0.5


# -- the operator's end


def test_the_delay_is_that_of_the_newest_echo():
    delay = EchoDelay()
    delay.sent(10.0)
    delay.echoed(10.0, 10.03)
    assert delay.delay_s(10.04) == pytest.approx(0.03)


def test_a_command_without_an_echo_grows_older():
    delay = EchoDelay()
    for stamp_s in (10.0, 10.05, 10.1):
        delay.sent(stamp_s)
    delay.echoed(10.0, 10.02)
    assert delay.delay_s(10.8) == pytest.approx(0.75)


def test_an_echo_answers_the_commands_before_it():
    """The robot follows the newest command alone."""
    delay = EchoDelay()
    delay.sent(10.0)
    delay.sent(10.05)
    delay.echoed(10.05, 10.06)
    assert delay.delay_s(20.0) == pytest.approx(0.01)


def test_the_delay_is_unknown_before_the_first_command():
    assert delay_text(EchoDelay().delay_s(5.0)) == "unknown"


def test_above_the_limit_nothing_drives_until_the_key_is_released():
    guard = DelayGuard(LIMIT_S, "--max-delay")
    assert guard.may_drive(True, 0.1)
    assert not guard.may_drive(True, 0.62)
    assert not guard.may_drive(True, 0.1), "the key is still held"
    assert (
        guard.reason
        == "stopped: the delay is 620 ms, above the limit of 500 ms (--max-delay); release and press again"
    )
    assert not guard.may_drive(False, 0.1) and not guard.reason
    assert guard.may_drive(True, 0.1)


def test_a_key_pressed_while_the_delay_is_too_long_does_not_drive():
    guard = DelayGuard(LIMIT_S, "--max-delay")
    guard.may_drive(False, 0.9)
    assert not guard.may_drive(True, 0.9)


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
    lateness = Lateness()
    assert lateness.of(5000.0, 3.0) == 0.0
    assert lateness.of(5001.0, 4.7) == pytest.approx(0.7, abs=2 * DRIFT)


def test_a_faster_message_is_the_new_measure():
    lateness = Lateness()
    lateness.of(100.0, 3.2)
    lateness.of(101.0, 4.0)
    assert lateness.of(102.0, 5.2) == pytest.approx(0.2, abs=2 * DRIFT)


def test_clocks_that_drift_apart_make_nobody_late():
    """By 500 ppm, over an hour."""
    lateness = Lateness()
    assert max(lateness.of(n * 1.0, n * 1.0005) for n in range(3600)) < 1e-3


def test_a_silence_of_a_minute_hides_at_most_60_ms():
    lateness = Lateness()
    lateness.of(0.0, 0.0)
    assert lateness.of(59.0, 60.0) == pytest.approx(1.0 - 60 * DRIFT)


# -- the link of `mrl drive`


def test_a_round_trip_is_from_the_request_to_its_answer():
    trip = RoundTrip()
    trip.begin(10.0, certain=True)
    trip.end(10.3)
    assert trip.delay_s(11.0) == pytest.approx(0.3)


def test_an_answer_after_a_lost_one_is_not_measured():
    """It may be that of the lost request, and then it is older than it seems."""
    trip = RoundTrip()
    trip.begin(10.0, certain=True)
    trip.begin(12.0, certain=False)
    trip.end(12.1)
    assert math.isnan(trip.delay_s(12.2))


def test_two_lost_answers_count_as_a_delay():
    trip = RoundTrip()
    for now, certain in ((10.0, True), (12.0, False), (14.0, False)):
        trip.begin(now, certain)
    assert trip.delay_s(14.5) == pytest.approx(4.5)


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
