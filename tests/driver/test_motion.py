import math

import pytest

from mrl_driver.session.motion_command import (
    MOVE,
    QUICK,
    SLOW,
    SLOWEST,
    STILL_FRAMES,
    STILL_S,
    STOP,
    STOPS,
    Motion,
)


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


def test_a_new_motion_has_stopped_nothing():
    motion = Motion()
    assert (motion.stops, motion.unconfirmed, motion.stopping, motion.settling) == (0, False, False, False)


def settle(motion, start_s=0.0):
    """Reads that the wheels stand still until nothing is left to confirm."""
    motion.take(start_s)
    for frame in range(STILL_FRAMES + 2):
        motion.observe(False, start_s + frame * STILL_S)


def test_figures_of_the_paces():
    """Feeding a watchdog of 250 ms; 26 commands a second; one byte for each of 163 frames a second."""
    assert (QUICK, SLOW, SLOWEST) == ((0.005, 0.1, 0.05), (0.1, 0.5, 0.15), (0.15, 0.5, 0.15))
    assert (STILL_S, STILL_FRAMES) == (0.08, 3)


def test_reasons_have_the_names_that_users_see():
    sources = {"user", "not_a_number", "command_timeout", "radio_hold", "closed", "none"}
    causes = {"battery", "wheel_mismatch", "stale", "restarted", "link_lost", "host_paused"}
    assert set(STOPS) == sources | causes


def test_a_stop_without_a_reason_is_the_users():
    motion = Motion()
    motion.stop()
    assert motion.stop_reason == "user"


def test_a_command_that_moves_and_expires_is_a_command_timeout():
    motion = Motion(timeout_s=0.2)
    motion.drive((200, 0), 0.0)
    assert (motion.take(0.2), motion.stop_reason) == ((STOP,), "command_timeout")


@pytest.mark.parametrize("moves, reason", [(True, "command_timeout"), (False, "user")])
def test_who_commands_says_whether_speeds_that_were_limited_to_zero_move(moves, reason):
    motion = Motion(timeout_s=0.2)
    motion.drive((0, 0), 0.0, moves)
    motion.take(0.2)
    assert motion.stop_reason == reason


def test_only_commands_that_were_in_force_count_as_stopped():
    motion = Motion()
    for stops in (1, 2):
        motion.drive((200, 0), 0.0)
        motion.stop()
        motion.stop()
        assert motion.stops == stops


def test_a_command_of_zero_settles_after_motion():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    assert not motion.settling
    motion.drive((0, 0), 0.1)
    assert motion.settling
    settle(motion, 0.1)
    assert not motion.settling


def test_a_command_of_zero_after_standstill_has_nothing_to_settle():
    motion = Motion()
    motion.drive((0, 0), 0.0)
    assert not motion.settling


def test_a_command_of_zero_goes_on_with_what_a_stop_has_to_confirm():
    motion = Motion()
    motion.stop()
    motion.drive((0, 0), 0.1)
    assert motion.settling


def test_a_robot_that_stands_under_a_command_of_zero_keeps_its_command():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.drive((0, 0), 0.1)
    settle(motion, 0.1)
    assert motion.take(1.0) == (MOVE, 0, 0)


def test_a_confirmed_stop_has_nothing_due():
    motion = Motion()
    motion.stop()
    settle(motion)
    assert motion.due_s == math.inf


def test_a_command_ends_what_a_stop_has_confirmed_so_far():
    motion = Motion()
    motion.stop()
    motion.take(0.0)
    for at_s in (0.0, 0.04, 0.08):
        motion.observe(False, at_s)
    motion.drive((200, 0), 0.1)
    motion.stop()
    motion.take(0.1)
    for at_s in (0.11, 0.12, 0.13):
        motion.observe(False, at_s)
    assert motion.stopping


def test_time_of_standstill_is_a_difference():
    motion = Motion()
    motion.stop()
    motion.take(1000.0)
    for frame in range(STILL_FRAMES + 1):
        motion.observe(False, 1000.0 + frame * 0.001)
    assert motion.stopping


def test_changed_speeds_are_sent_after_the_gap():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    motion.adjust((100, 0))
    assert drain(motion, 0.001, 0.05) == [(QUICK.gap_s, (MOVE, 100, 0))]


def test_the_same_speeds_are_not_sent_again():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    motion.adjust((200, 0))
    assert drain(motion, 0.001, 0.05) == []


def test_changed_speeds_do_not_prolong_the_command():
    motion = Motion(timeout_s=0.2)
    motion.drive((200, 0), 0.0)
    motion.adjust((100, 0))
    assert motion.take(0.2) == (STOP,)


def test_a_changed_command_is_due_at_its_expiry_at_the_latest():
    motion = Motion(SLOW, timeout_s=0.05)
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    motion.adjust((100, 0))
    assert motion.due_s == pytest.approx(0.05)


def test_speeds_changed_to_zero_settle():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.adjust((0, 0))
    assert motion.settling


def test_a_gentle_stop_that_was_not_lowered_is_not_sent_at_once():
    motion = Motion(SLOW)
    motion.drive((300, 0), 0.0)
    motion.take(0.0)
    motion.fade(0.0, 1.0)
    motion.take(0.1)
    motion.adjust((400, 0))
    assert motion.due_s == pytest.approx(0.2)


def test_a_gentle_stop_begins_after_the_gap():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.take(0.0)
    motion.fade(0.0, 1.0)
    assert motion.due_s == pytest.approx(QUICK.gap_s)


def test_a_gentle_stop_is_measured_from_its_start():
    motion = Motion()
    motion.drive((300, -100), 10.0)
    motion.fade(10.0, 2.0)
    assert motion.take(10.5) == (MOVE, 225, -75)


def test_a_gentle_stop_without_time_is_a_stop():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 0.0)
    assert motion.take(0.01) == (STOP,)


def test_a_gentle_stop_goes_on_while_its_source_is_alive():
    motion = Motion(timeout_s=0.2)
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    motion.prolong(0.15)
    assert motion.take(0.25) == (MOVE, 225, 0)
    assert (motion.take(0.35), motion.stop_reason) == ((STOP,), "command_timeout")


def test_only_a_gentle_stop_is_prolonged():
    motion = Motion(timeout_s=0.2)
    motion.drive((300, 0), 0.0)
    motion.prolong(0.15)
    assert motion.take(0.2) == (STOP,)


def test_a_gentle_stop_without_a_timeout_is_not_prolonged():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    motion.prolong(0.5)
    assert motion.take(0.5) == (MOVE, 150, 0)


def test_a_link_that_is_lost_drops_the_command_without_a_stop():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.forget("link_lost")
    assert (motion.target, motion.stop_reason, motion.stops, motion.due_s) == (None, "link_lost", 1, math.inf)
    assert drain(motion, 0.0, 0.2) == []


def test_a_link_that_is_lost_while_stopped_keeps_the_reason():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.stop("battery")
    motion.forget("link_lost")
    assert (motion.stop_reason, motion.stops, motion.stopping, motion.settling) == (
        "battery",
        1,
        False,
        False,
    )


def test_a_robot_that_stood_has_no_stop_to_make_up_for():
    motion = Motion()
    motion.forget("link_lost")
    assert not motion.unconfirmed


def cut_off_in_motion(motion):
    motion.drive((200, 0), 0.0)


def cut_off_while_stopping(motion):
    motion.stop()


@pytest.mark.parametrize("cut_off", [cut_off_in_motion, cut_off_while_stopping])
def test_a_stop_that_the_link_has_cut_off_is_made_up_for(cut_off):
    motion = Motion()
    cut_off(motion)
    motion.forget("link_lost")
    assert motion.unconfirmed
    reason = motion.stop_reason
    motion.make_sure()
    assert (motion.take(0.0), motion.unconfirmed, motion.stop_reason) == ((STOP,), False, reason)


def test_a_stop_stays_unconfirmed_over_two_losses():
    motion = Motion()
    motion.stop()
    motion.forget("link_lost")
    motion.forget("link_lost")
    assert motion.unconfirmed


def test_a_command_in_force_is_not_stopped_to_make_sure():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.make_sure()
    assert motion.take(0.0) == (MOVE, 200, 0)


def test_a_repeat_uses_a_call_a_little_before_it_is_due():
    motion = Motion()
    motion.lead_s = 0.01
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    assert motion.take(0.089) is None
    assert motion.take(0.0901) == (MOVE, 200, 0)


def test_a_new_command_does_not_come_before_the_gap():
    motion = Motion(SLOW)
    motion.lead_s = 0.01
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    motion.drive((100, 0), 0.01)
    assert motion.take(0.095) is None
    assert motion.take(0.1) == (MOVE, 100, 0)


def test_what_is_due_now_is_sent_now():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    assert motion.take(motion.due_s) == (MOVE, 200, 0)


def test_other_bases_have_a_request_of_their_own():
    motion = Motion()
    motion.request_of = lambda speeds: (43, *speeds)
    motion.drive((100, 200, 300), 0.0)
    assert motion.take(0.0) == (43, 100, 200, 300)


def test_both_speeds_of_minus_one_are_spelt_zero():
    motion = Motion(skip_minus_one=True)
    motion.drive((-1, -1), 0.0)
    assert motion.take(0.0) == (MOVE, 0, 0)


def test_plus_one_is_sent_to_boards_that_drop_minus_one():
    motion = Motion(skip_minus_one=True)
    motion.drive((1, 1), 0.0)
    assert motion.take(0.0) == (MOVE, 1, 1)


def test_minus_one_is_sent_as_it_is_to_all_other_boards():
    motion = Motion()
    motion.drive((-1, -1), 0.0)
    assert motion.take(0.0) == (MOVE, -1, -1)


@pytest.mark.parametrize(
    "set_speeds", [lambda motion, *to: motion.drive(*to), lambda motion, to, _: motion.adjust(to)]
)
def test_standstill_before_a_motion_confirms_nothing_after_it(set_speeds):
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.drive((0, 0), 0.0)
    motion.take(0.01)
    for at_s in (0.01, 0.05, 0.1):
        motion.observe(False, at_s)
    set_speeds(motion, (200, 0), 0.12)
    assert not motion.settling
    set_speeds(motion, (0, 0), 0.13)
    motion.take(0.14)
    motion.observe(False, 0.14)
    motion.observe(False, 0.15)
    assert motion.settling


def test_speeds_that_are_raised_from_zero_have_to_settle_later():
    motion = Motion()
    motion.drive((0, 0), 0.0, True)
    motion.adjust((200, 0))
    motion.adjust((0, 0))
    assert motion.settling


def test_a_gentle_stop_that_is_lowered_to_zero_settles():
    motion = Motion()
    motion.drive((300, 0), 0.0)
    motion.fade(0.0, 1.0)
    motion.adjust((0, 0))
    assert motion.settling


def test_changed_speeds_do_not_come_before_the_gap():
    motion = Motion(SLOW)
    motion.lead_s = 0.01
    motion.drive((200, 0), 0.0)
    motion.take(0.0)
    motion.adjust((100, 0))
    assert motion.take(0.095) is None


def test_time_of_motion_goes_on_over_commands_until_one_stands():
    motion = Motion()
    assert motion.moves_for_s(1.0) == 0.0
    motion.drive((200, 0), 1.0)
    motion.drive((100, 0), 1.5)
    assert motion.moves_for_s(2.0) == 1.0
    motion.drive((0, 0), 2.0)
    assert motion.moves_for_s(3.0) == 0.0
    motion.drive((100, 0), 4.0)
    motion.stop()
    assert motion.moves_for_s(5.0) == 0.0


def test_time_of_motion_begins_again_after_a_stop():
    motion = Motion()
    motion.drive((200, 0), 1.0)
    motion.stop()
    motion.drive((200, 0), 3.0)
    assert motion.moves_for_s(4.0) == 1.0


def test_motion_is_wanted_from_a_command_to_move_to_one_that_stands():
    motion = Motion()
    assert not motion.wanted
    motion.drive((200, 0), 0.0)
    assert motion.wanted
    motion.drive((0, 0), 1.0)
    assert not motion.wanted


@pytest.mark.parametrize(("reason", "wanted"), [("user", False), ("command_timeout", True), ("stale", True)])
def test_motion_is_wanted_after_a_stop_that_is_not_the_users(reason, wanted):
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.stop(reason)
    assert motion.wanted == wanted
    motion.drive((200, 0), 1.0)
    assert motion.wanted
