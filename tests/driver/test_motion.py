import math

import pytest

from mrl_driver.session.motion_command import MOVE, QUICK, STILL_FRAMES, STILL_S, STOP, Motion


def drain(motion, start_s, end_s, step_s=0.001, allowed=True):
    """(time, request) of all that is due between two times."""
    out, steps = [], round((end_s - start_s) / step_s)
    for i in range(steps):
        now = start_s + i * step_s
        request = motion.take(now, allowed)
        out += [(now, request)] if request is not None else []
    return out


def test_a_command_is_due_at_once():
    motion = Motion()
    motion.drive((200, -300), 1.0)
    assert motion.take(1.0) == (MOVE, 200, -300)


def test_a_command_is_repeated():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    assert len(drain(motion, 0.0, 1.0)) == 10


def test_the_latest_command_wins():
    """A thousand commands a second go out at the board's pace, none late."""
    motion, sent = Motion(), []
    for i in range(1000):
        motion.drive((i, 0), i / 1000)
        sent += filter(None, [motion.take(i / 1000)])
    assert 150 <= len(sent) <= 200
    motion.take(1.0)
    assert motion.target == (999, 0)


def test_a_stop_waits_for_nothing():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    motion.stop()
    assert motion.take(0.0) == (STOP,)


def test_a_stop_is_repeated_until_the_wheels_stand_still():
    motion = Motion()
    motion.stop()
    assert len(drain(motion, 0.0, 0.5)) == 10
    for i in range(10):
        motion.observe(False, 0.5 + i * 0.02)
    assert drain(motion, 0.7, 1.5) == []


def test_wheels_that_turn_confirm_no_stop():
    motion = Motion()
    motion.stop()
    motion.take(0.0)
    for i in range(20):
        motion.observe(i % 3 == 0, 0.02 * i)
    assert motion.stopping


def test_readings_before_the_stop_was_sent_confirm_nothing():
    motion = Motion()
    motion.stop()
    for i in range(20):
        motion.observe(False, 0.02 * i)
    assert motion.stopping


def test_late_telemetry_holds_motion_back_but_no_stop():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    assert motion.take(0.0, allowed=False) is None
    motion.stop()
    assert motion.take(0.0, allowed=False) == (STOP,)


@pytest.mark.parametrize("timeout_s", [0.2, 0.5, 1.0])
def test_a_command_without_successor_expires(timeout_s):
    motion = Motion(timeout_s=timeout_s)
    motion.drive((200, 0), 0.0)
    sent = drain(motion, 0.0, 2.0)
    stopped_s = next(now for now, request in sent if request == (STOP,))
    assert timeout_s <= stopped_s < timeout_s + 0.002


def test_a_command_to_stand_that_expires_was_the_users_stop():
    motion = Motion(timeout_s=0.2)
    motion.drive((0, 0), 0.0)
    drain(motion, 0.0, 1.0)
    assert (motion.target, motion.stop_reason) == (None, "user")


def test_an_expiry_is_a_deadline():
    motion = Motion(QUICK, timeout_s=0.03)
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    assert motion.due_s == pytest.approx(0.03)


def test_a_gentle_stop_slows_down_evenly():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.take(0.0)
    motion.fade(0.0, 1.0)
    sent = drain(motion, 0.001, 1.1)
    speeds = [request[1] for _, request in sent if request[0] == MOVE]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[len(speeds) // 2] == pytest.approx(150, abs=10)
    assert sent[-1][1] == (STOP,)


def test_a_new_command_ends_a_gentle_stop():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    motion.drive((100, 0), 0.5)
    assert motion.take(0.5) == (MOVE, 100, 0)


def test_minus_one_is_spelt_zero_for_boards_that_drop_it():
    motion = Motion(skip_minus_one=True)
    motion.drive((-1, -2), 0.0)
    assert motion.take(0.0) == (MOVE, 0, -2)


def test_nothing_is_due_while_stopped():
    assert Motion().due_s == math.inf


def test_a_second_fade_does_not_begin_again():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    assert motion.take(0.5) == (MOVE, 150, 0)
    motion.fade(0.5, 1.0)
    assert motion.take(0.75) == (MOVE, 75, 0)


def test_a_fade_ends_in_a_stop_on_time():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    assert motion.take(1.0) == (STOP,) and motion.stop_reason == "battery"


def test_a_robot_that_stands_has_nothing_to_fade():
    motion = Motion()
    motion.fade(0.0, 1.0)
    assert motion.take(0.5) is None and motion.stop_reason == "none"


@pytest.mark.parametrize("step_s", [STILL_S, STILL_S / STILL_FRAMES], ids=["by frames", "by time"])
def test_a_stop_is_confirmed_by_so_many_frames_over_so_long(step_s):
    """The frame that ends the last movement, and the least number of others over the least time."""
    motion = Motion()
    motion.stop()
    motion.take(0.0)
    for frame in range(STILL_FRAMES):
        motion.observe(False, frame * step_s)
        assert motion.stopping
    motion.observe(False, max(STILL_S, STILL_FRAMES * step_s))
    assert not motion.stopping


@pytest.mark.parametrize("speeds, faded", [((0, 0), 0), ((100, 0), 50), ((400, 0), 150)])
def test_a_gentle_stop_obeys_a_limit_but_is_never_raised(speeds, faded):
    """As of a protective zone, or of a ramp that was speeding up."""
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    motion.take(0.1)
    motion.adjust(speeds)
    assert motion.take(0.5) == (MOVE, faded, 0)
