import math

import pytest

from mrl_driver.session.motion_command import MOVE, QUICK, SLOW, SLOWEST, STILL_FRAMES, STILL_S, STOP, Motion


def drain(motion, start_s, end_s):
    """(time, request) of all that is due between two times."""
    times = [start_s + i * 0.001 for i in range(round((end_s - start_s) / 0.001))]
    return [(now, request) for now in times for request in [motion.take(now)] if request is not None]


def driven(*pace, speeds=(200, 0), sent=True, **options):
    """Under a command of time 0."""
    motion = Motion(*pace, **options)
    motion.drive(speeds, 0.0)
    if sent:
        motion.take(0.0)
    return motion


def fading(seconds=1.0, **options):
    motion = driven(speeds=(300, 0), sent=False, **options)
    motion.fade(0.0, seconds)
    return motion


def stopping(at_s=0.0):
    motion = Motion()
    motion.stop()
    motion.take(at_s)
    return motion


def stand(motion, *times_s):
    for at_s in times_s:
        motion.observe(False, at_s)
    return motion


def settle(motion, start_s=0.0):
    """Reads that the wheels stand still until nothing is left to confirm."""
    motion.take(start_s)
    return stand(motion, *(start_s + frame * STILL_S for frame in range(STILL_FRAMES + 2)))


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
    motion = driven()
    motion.stop()
    assert (motion.take(0.0), motion.stop_reason) == ((STOP,), "user")


def test_a_stop_is_repeated_until_the_wheels_stand_still():
    motion = Motion()
    motion.stop()
    assert len(drain(motion, 0.0, 0.5)) == 10
    stand(motion, *(0.5 + i * 0.02 for i in range(10)))
    assert drain(motion, 0.7, 1.5) == [] and motion.due_s == math.inf


def test_wheels_that_turn_and_readings_before_the_stop_was_sent_confirm_no_stop():
    motion = Motion()
    motion.stop()
    assert stand(motion, *(0.02 * i for i in range(20))).stopping
    motion.take(0.4)
    for i in range(20):
        motion.observe(i % 3 == 0, 0.4 + 0.02 * i)
    assert motion.stopping


def test_a_robot_that_stood_has_nothing_to_confirm():
    motion = Motion()
    assert (motion.stops, motion.unconfirmed, motion.stopping, motion.settling) == (0, False, False, False)
    motion.forget("link_lost")
    assert not motion.unconfirmed
    assert not driven(speeds=(0, 0)).settling


def test_late_telemetry_holds_motion_back_but_no_stop():
    motion = driven(sent=False)
    assert motion.take(0.0, allowed=False) is None
    motion.stop()
    assert motion.take(0.0, allowed=False) == (STOP,)


@pytest.mark.parametrize("timeout_s", [0.2, 0.5, 1.0])
def test_a_command_without_successor_expires(timeout_s):
    motion = driven(timeout_s=timeout_s, sent=False)
    stopped_s = next(now for now, request in drain(motion, 0.0, 2.0) if request == (STOP,))
    assert timeout_s <= stopped_s < timeout_s + 0.002


@pytest.mark.parametrize(
    "speeds, moves, reason",
    [
        ((200, 0), None, "command_timeout"),
        ((0, 0), None, "user"),
        ((0, 0), True, "command_timeout"),
        ((0, 0), False, "user"),
    ],
)
def test_the_expiry_of_a_command_to_stand_was_the_users_stop(speeds, moves, reason):
    """Who commands says whether speeds that were limited to zero move."""
    motion = Motion(timeout_s=0.2)
    motion.drive(speeds, 0.0, *(() if moves is None else (moves,)))
    assert (motion.take(0.2), motion.target, motion.stop_reason) == ((STOP,), None, reason)


def test_an_expiry_is_a_deadline():
    assert driven(QUICK, timeout_s=0.03).due_s == pytest.approx(0.03)


def test_a_gentle_stop_slows_down_evenly_and_ends_in_a_stop_on_time():
    motion = driven(speeds=(300, 0))
    motion.fade(0.0, 1.0)
    assert motion.due_s == pytest.approx(QUICK.gap_s)
    speeds = [request[1] for _, request in drain(motion, 0.001, 1.0) if request[0] == MOVE]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[len(speeds) // 2] == pytest.approx(150, abs=10)
    assert (motion.take(1.0), motion.stop_reason) == ((STOP,), "battery")


def test_a_robot_that_stands_has_nothing_to_fade():
    motion = Motion()
    motion.fade(0.0, 1.0)
    assert motion.take(0.5) is None and motion.stop_reason == "none"


@pytest.mark.parametrize("start_s", [0.0, 1000.0])
@pytest.mark.parametrize("step_s", [STILL_S, STILL_S / STILL_FRAMES], ids=["by frames", "by time"])
def test_a_stop_is_confirmed_by_so_many_frames_over_so_long(start_s, step_s):
    """The frame that ends the last movement, and the least number of others over the least time."""
    motion = stopping(start_s)
    for frame in range(STILL_FRAMES):
        assert stand(motion, start_s + frame * step_s).stopping
    assert not stand(motion, start_s + 1e-9 + max(STILL_S, STILL_FRAMES * step_s)).stopping


@pytest.mark.parametrize("speeds, faded", [((0, 0), 0), ((100, 0), 50), ((400, 0), 150)])
def test_a_gentle_stop_obeys_a_limit_but_is_never_raised(speeds, faded):
    """As of a protective zone, or of a ramp that was speeding up."""
    motion = fading()
    motion.take(0.1)
    motion.adjust(speeds)
    assert motion.take(0.5) == ((MOVE, faded, 0) if faded else (STOP,))


def test_a_command_of_zero_brakes_until_the_wheels_stand_and_then_holds():
    motion = driven()
    motion.drive((0, 0), 0.1)
    assert motion.take(0.1) == (STOP,)
    settle(motion, 0.2)
    assert motion.take(1.0) == (MOVE, 0, 0)


def test_a_command_of_zero_goes_on_with_what_a_stop_has_to_confirm():
    motion = stopping()
    motion.drive((0, 0), 0.1)
    assert motion.settling


def test_a_command_ends_what_a_stop_has_confirmed_so_far():
    motion = stand(stopping(), 0.0, 0.04, 0.08)
    motion.drive((200, 0), 0.1)
    motion.stop()
    motion.take(0.1)
    assert stand(motion, 0.11, 0.12, 0.13).stopping


def test_changed_speeds_do_not_prolong_the_command():
    motion = driven(SLOW, timeout_s=0.05)
    motion.adjust((100, 0))
    assert motion.due_s == pytest.approx(0.05) and motion.take(0.05) == (STOP,)


def test_a_gentle_stop_is_measured_from_its_start():
    motion = Motion()
    motion.drive((300, -100), 10.0)
    motion.fade(10.0, 2.0)
    assert motion.take(10.5) == (MOVE, 225, -75)
    assert fading(0.0).take(0.01) == (STOP,)


def test_a_gentle_stop_alone_goes_on_while_its_source_is_alive():
    gentle, usual, endless = fading(timeout_s=0.2), driven(timeout_s=0.2), fading()
    for motion in (gentle, usual, endless):
        motion.prolong(0.15)
    assert usual.take(0.2) == (STOP,)
    assert gentle.take(0.25) == (MOVE, 225, 0)
    assert (gentle.take(0.35), gentle.stop_reason) == ((STOP,), "command_timeout")
    assert endless.take(0.5) == (MOVE, 150, 0)


def test_a_link_that_is_lost_drops_the_command_without_a_stop():
    """If the robot was stopped already, it keeps the reason."""
    motion = driven(sent=False)
    motion.forget("link_lost")
    assert (motion.target, motion.stop_reason, motion.stops, motion.due_s) == (None, "link_lost", 1, math.inf)
    assert drain(motion, 0.0, 0.2) == []
    motion = driven()
    motion.stop("battery")
    motion.forget("link_lost")
    assert (motion.stop_reason, motion.stops) == ("battery", 1)
    assert not motion.stopping and not motion.settling
    motion.drive((200, 0), 0.0)
    motion.forget("link_lost")
    assert motion.stops == 2


@pytest.mark.parametrize("losses", [1, 2])
@pytest.mark.parametrize("cut_off", [driven, stopping])
def test_a_stop_that_the_link_has_cut_off_is_made_up_for(cut_off, losses):
    motion = cut_off()
    for _ in range(losses):
        motion.forget("link_lost")
    assert motion.unconfirmed
    reason = motion.stop_reason
    motion.make_sure()
    assert (motion.take(0.0), motion.unconfirmed, motion.stop_reason) == ((STOP,), False, reason)


def test_a_command_in_force_is_not_stopped_to_make_sure():
    motion = driven(sent=False)
    motion.make_sure()
    assert motion.take(0.0) == (MOVE, 200, 0)


def test_a_repeat_uses_a_call_a_little_before_it_is_due():
    motion = driven()
    motion.lead_s = 0.01
    assert motion.take(0.089) is None
    assert motion.take(0.0901) == (MOVE, 200, 0)


@pytest.mark.parametrize("pace, waits_s", [(QUICK, 0.0), (SLOW, SLOW.gap_s)], ids=["quick", "slow"])
def test_only_boards_that_lose_commands_wait_for_one_that_follows_a_repeat(pace, waits_s):
    motion = driven(pace)
    motion.take(pace.repeat_s)
    motion.drive((100, 0), pace.repeat_s)
    assert drain(motion, pace.repeat_s, pace.repeat_s + 0.2)[0] == (
        pytest.approx(pace.repeat_s + waits_s), (MOVE, 100, 0)
    )  # fmt: skip


@pytest.mark.parametrize("pace, stop_s", [(QUICK, 0.05), (SLOW, 0.15), (SLOWEST, 0.15)])
def test_boards_that_lose_commands_get_an_unconfirmed_stop_less_often(pace, stop_s):
    motion = Motion(pace)
    motion.stop()
    motion.take(0.0)
    assert drain(motion, 0.0, 0.2)[0] == (pytest.approx(stop_s), (STOP,))


SET_SPEEDS = [lambda motion, *to: motion.drive(*to), lambda motion, to, _: motion.adjust(to)]


@pytest.mark.parametrize("set_speeds", SET_SPEEDS, ids=["drive", "adjust"])
def test_new_speeds_do_not_come_before_the_gap(set_speeds):
    motion = driven(SLOW)
    motion.lead_s = 0.01
    set_speeds(motion, (100, 0), 0.01)
    assert motion.take(0.095) is None
    assert motion.take(0.1) == (MOVE, 100, 0)


def test_other_bases_have_a_request_of_their_own():
    motion = driven(speeds=(100, 200, 300), sent=False)
    motion.request_of = lambda speeds: (43, *speeds)
    assert motion.take(0.0) == (43, 100, 200, 300)


@pytest.mark.parametrize(
    "skips, speeds, sent",
    [
        (True, (-1, -2), (0, -2)),
        (True, (-1, -1), (0, 0)),
        (True, (1, 1), (1, 1)),
        (False, (-1, -1), (-1, -1)),
    ],
)
def test_minus_one_is_spelt_zero_for_boards_that_drop_it(skips, speeds, sent):
    assert driven(speeds=speeds, sent=False, skip_minus_one=skips).take(0.0) == (MOVE, *sent)


def test_time_of_standstill_is_a_difference():
    motion = Motion()
    motion.stop()
    motion.take(1000.0)
    for frame in range(STILL_FRAMES + 1):
        motion.observe(False, 1000.0 + frame * 0.001)
    assert motion.stopping


@pytest.mark.parametrize("set_speeds", SET_SPEEDS, ids=["drive", "adjust"])
def test_standstill_before_a_motion_confirms_nothing_after_it(set_speeds):
    motion = driven(sent=False)
    motion.drive((0, 0), 0.0)
    motion.take(0.01)
    stand(motion, 0.01, 0.05, 0.1)
    set_speeds(motion, (200, 0), 0.12)
    assert not motion.settling
    set_speeds(motion, (0, 0), 0.13)
    motion.take(0.14)
    assert stand(motion, 0.14, 0.15).settling


def test_speeds_that_are_raised_from_zero_have_to_settle_later():
    motion = Motion()
    motion.drive((0, 0), 0.0, True)
    motion.adjust((200, 0))
    motion.adjust((0, 0))
    assert motion.settling


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
    motion.drive((100, 0), 6.0)
    assert motion.moves_for_s(7.0) == 1.0


def test_motion_is_wanted_from_a_command_to_move_to_one_that_stands():
    motion = Motion()
    assert not motion.wanted
    motion.drive((200, 0), 0.0)
    assert motion.wanted
    motion.drive((0, 0), 1.0)
    assert not motion.wanted


@pytest.mark.parametrize(
    ("reason", "wanted"), [("user", False), ("command_timeout", True), ("no_telemetry", True)]
)
def test_motion_is_wanted_after_a_stop_that_is_not_the_users(reason, wanted):
    motion = driven()
    motion.stop(reason)
    assert motion.wanted == wanted
    motion.drive((200, 0), 1.0)
    assert motion.wanted
