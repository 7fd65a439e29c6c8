"""Who drives, what counts, and when the robot stops."""

import math

import pytest

from mrl_driver.apps.web import helm
from mrl_driver.protocol.stop_reason import StopReason

from .pages import Page, kinds

START_S = 5000.0
EMERGENCY, WHY = StopReason.EMERGENCY_STOP, helm.why_of(StopReason.WHEEL_MISMATCH)
ROUND_S = 0.05
ERROR_S = 1e-6  # Rounding of sums of times


class Bench:
    """A helm and its pages; a message arrives when it is sent unless a test says otherwise."""

    def __init__(self):
        self.helm, self.now_s = helm.Helm(), START_S
        self.pages = []

    def page(self, may_drive=True, takes=False):
        page = Page(len(self.pages) + 1, ahead_s=-17.0 * len(self.pages))
        self.pages.append(page)
        self.helm.join(page.number, may_drive, self.now_s)
        self.rest(page)
        if takes:
            self.helm.take(page.number, self.now_s)
            self.rest(page)
        return page

    def later(self, seconds=ROUND_S):
        self.now_s += seconds
        for page in self.pages:
            page.hear(self.now_s)

    def arrives(self, page, message):
        return self.helm.control(page.number, message, self.now_s)

    def rest(self, page):
        """The page tells that no control is held, after it has heard the newest state."""
        page.hear(self.now_s)
        return self.arrives(page, page.lift(self.now_s))

    def push(self, page, goal=None):
        return self.arrives(page, page.push(self.now_s, goal))

    def repeat(self, page, **changed):
        return self.arrives(page, page.message(self.now_s, **changed))

    def drives(self, page):
        """Whether what the page commands now drives the robot."""
        return any(isinstance(act, (helm.Drive, helm.Go)) for act in self.repeat(page))

    def presses_again(self, page):
        """Whether the next press drives."""
        self.later()
        self.rest(page)
        return "Drive" in kinds(self.push(page))


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture
def driving(bench):
    """A bench on which page 1 drives and page 2 may."""
    one, two = bench.page(takes=True), bench.page()
    assert "Drive" in kinds(bench.push(one))
    return bench, one, two


# -- a press


def test_the_next_press_may_follow_a_release_at_once(driving):
    """Before the page has heard that the robot was stopped."""
    bench, one, _ = driving
    bench.now_s += 0.02
    bench.arrives(one, one.lift(bench.now_s))
    assert kinds(bench.push(one)) == ["Drive"]


def test_a_held_control_drives_at_its_speeds(bench):
    page = bench.page(takes=True)
    acts = bench.arrives(page, page.push(bench.now_s)._replace(angular_rad_s=-0.5, lateral_m_s=0.1))
    assert acts == [helm.Drive(0.2, -0.5, 0.1, 0.0), helm.Tell()]
    assert bench.helm.state().driving and bench.helm.state().why == helm.why_of(StopReason.NONE)


def test_each_fresh_command_is_passed_on_once(driving):
    bench, one, _ = driving
    for speed in (0.1, 0.2, 0.3):
        bench.later()
        assert bench.repeat(one, linear_m_s=speed) == [helm.Drive(speed, 0.0, 0.0, 0.0)]
    bench.later()
    assert bench.helm.tick(bench.now_s) == []


def test_a_goal_may_not_become_another_one_while_it_is_held(bench):
    page = bench.page(takes=True)
    bench.push(page, helm.Goal(1.0, 2.0))
    page.goal = helm.Goal(-1.0, 2.0)
    assert bench.repeat(page) == [helm.Halt(StopReason.GOAL_CHANGED), helm.Tell()]
    assert not bench.drives(page) and bench.presses_again(page)


# -- time


def test_the_robot_stops_150_ms_after_the_last_command(driving):
    bench, _, _ = driving
    due_s = bench.helm.due_s
    assert due_s == pytest.approx(bench.now_s + 0.15, abs=ERROR_S)
    assert bench.helm.tick(due_s - 1e-4) == []
    assert bench.helm.tick(due_s) == [helm.Halt(StopReason.COMMAND_TIMEOUT), helm.Tell()]
    assert bench.helm.due_s == math.inf and bench.helm.state().why.reason is StopReason.COMMAND_TIMEOUT


def test_the_robot_stops_250_ms_after_the_page_has_sent_the_last_command(driving):
    bench, one, _ = driving
    sent = one.message(bench.now_s)
    bench.now_s += 0.14
    age_s = bench.arrives(one, sent)[0].age_s
    assert 0.14 <= age_s < 0.141
    assert bench.helm.due_s == pytest.approx(bench.now_s - age_s + 0.25, abs=ERROR_S)


def test_a_page_with_slow_commands_is_told_once_in_a_press(bench):
    page = bench.page(takes=True)
    told = []
    for _ in range(3):
        sent = page.message(bench.now_s) if page.held else page.push(bench.now_s)
        bench.now_s += 0.2
        told += bench.arrives(page, sent)
    assert told == [helm.Refuse(1, "the delay of this page's commands is 200 ms, expected at most 150 ms")]
    assert bench.helm.state().late == 3


def test_a_burst_after_a_stall_does_not_drive(driving):
    """Messages of 2 s arrive at once; the newest are fresh, but the robot was stopped meanwhile."""
    bench, one, _ = driving
    waiting = [one.message(bench.now_s + ROUND_S * step) for step in range(40)]
    bench.now_s += 2.0
    acts = [act for message in waiting for act in bench.arrives(one, message)]
    assert "Drive" not in kinds(acts) and kinds(acts)[0] == "Halt"
    assert bench.presses_again(one)


# -- order


@pytest.mark.parametrize("made, does", [("message", "Drive"), ("lift", "Halt")])
def test_a_message_that_comes_twice_counts_once(driving, made, does):
    bench, one, _ = driving
    sent = getattr(one, made)(bench.now_s)
    assert kinds(bench.arrives(one, sent)) == [does]
    assert [bench.arrives(one, sent) for _ in range(2)] == [[], []] and bench.helm.state().repeated == 2


def test_a_release_that_was_overtaken_still_ends_its_press(driving):
    """A page that contradicts itself stops."""
    bench, one, _ = driving
    release = one.lift(bench.now_s)
    one.held = True
    bench.repeat(one)
    assert kinds(bench.arrives(one, release)) == ["Halt"]


def test_an_old_release_does_not_end_a_newer_press(driving):
    bench, one, _ = driving
    release, press = one.lift(bench.now_s), one.push(bench.now_s)
    assert kinds(bench.arrives(one, press)) == ["Drive"]
    assert kinds(bench.arrives(one, release)) == [] and bench.drives(one)


def test_a_late_release_stops_too(driving):
    bench, one, _ = driving
    sent = one.lift(bench.now_s - 0.2)
    assert kinds(bench.arrives(one, sent)) == ["Halt"]


# -- who drives


def test_press_numbers_only_grow(driving):
    bench, one, _ = driving
    first = one.press
    one.press += 2
    assert bench.drives(one) and bench.helm.state().spent[1] == first
    one.press -= 1
    assert not bench.drives(one)


def test_a_press_that_never_drove_is_over_with_its_release(bench):
    page = bench.page(takes=True)
    bench.arrives(page, page.push(bench.now_s - 0.2))
    bench.rest(page)
    page.held = True
    assert not bench.drives(page)


def test_a_watching_page_neither_takes_nor_drives(bench):
    page = bench.page(may_drive=False)
    assert bench.helm.take(1, bench.now_s) == [helm.Refuse(1, helm.WATCHES)]
    assert bench.push(page)[0] == helm.Refuse(1, helm.WATCHES)


def test_a_control_that_was_held_when_the_page_connected_does_not_drive(bench):
    bench.helm.join(1, True, bench.now_s)
    bench.helm.take(1, bench.now_s)
    page = Page(1)
    page.hear(bench.now_s)
    assert "Drive" not in kinds(bench.push(page))
    bench.rest(page)
    assert "Drive" in kinds(bench.push(page))


def test_a_driver_that_leaves_stops_the_robot_and_frees_the_helm(driving):
    bench, _, _ = driving
    assert bench.helm.leave(1, bench.now_s) == [helm.Halt(StopReason.PAGE_LEFT), helm.Tell()]
    assert bench.helm.state().driver is None


def test_the_helm_changes_hands_after_a_second_at_the_latest(bench):
    bench.page(takes=True)
    bench.page()
    bench.helm.take(2, bench.now_s)
    assert bench.helm.due_s == bench.now_s + helm.HAND_OVER_S
    bench.helm.tick(bench.helm.due_s - 0.01)
    assert bench.helm.state().driver is None
    bench.helm.tick(bench.helm.due_s)
    assert bench.helm.state().driver == 2


def test_one_that_holds_a_control_keeps_the_helm_until_it_is_released(driving):
    bench, one, _ = driving
    assert bench.helm.take(2, bench.now_s) == [helm.Tell()] and bench.drives(one)
    assert kinds(bench.rest(one)) == ["Halt"]
    bench.helm.stands(bench.now_s)
    assert bench.helm.state().driver == 2


@pytest.mark.parametrize("stop", ["tick", "robot_stopped", "stop"])
def test_the_wish_for_the_helm_comes_true_with_every_stop(driving, stop):
    bench, one, _ = driving
    bench.helm.take(2, bench.now_s)
    bench.now_s += 0.2
    getattr(bench.helm, stop)(*{"tick": (), "robot_stopped": (WHY,), "stop": (1,)}[stop], bench.now_s)
    bench.helm.stands(bench.now_s)
    assert bench.helm.state().driver == 2 and not bench.drives(one)


def test_only_one_can_wait_for_the_helm(driving):
    bench, _, _ = driving
    bench.page()
    bench.helm.take(2, bench.now_s)
    assert bench.helm.take(3, bench.now_s) == [helm.Refuse(3, "somebody else has asked for the helm already")]
    assert bench.helm.state().wants == 2


@pytest.mark.parametrize("withdraw", ["leave", "yield_"])
def test_a_wish_for_the_helm_can_be_withdrawn(driving, withdraw):
    bench, one, _ = driving
    bench.helm.take(2, bench.now_s)
    getattr(bench.helm, withdraw)(2, bench.now_s)
    assert bench.helm.state().wants is None and bench.drives(one)


# -- stops


@pytest.mark.parametrize("may_drive", [True, False])
def test_anybody_can_stop(driving, may_drive):
    bench, one, _ = driving
    watcher = bench.page(may_drive)
    assert list(map(type, bench.helm.stop(watcher.number, bench.now_s))) == [helm.Latch, helm.Tell]
    state = bench.helm.state()
    assert (state.latched, state.latched_by, state.driving, state.why.reason) == (True, 3, False, EMERGENCY)
    assert not bench.drives(one)


@pytest.mark.parametrize(
    "who, done",
    [
        (1, [helm.Unlatch(), helm.Tell()]),
        (2, [helm.Refuse(2, helm.RELEASES)]),
        (3, [helm.Refuse(3, helm.RELEASES)]),
    ],
)
def test_only_the_one_who_drives_releases_the_stop(driving, who, done):
    bench, one, _ = driving
    bench.page(may_drive=False)
    bench.helm.stop(2, bench.now_s)
    bench.later()
    bench.rest(one)
    assert bench.helm.release(who, bench.now_s, bench.now_s) == done
    state = bench.helm.state()
    assert (state.latched, state.why.reason) == ((False, "none") if who == 1 else (True, EMERGENCY))


def test_the_stop_is_not_released_while_a_control_is_held(driving):
    bench, one, _ = driving
    bench.helm.stop(2, bench.now_s)
    assert bench.helm.release(1, bench.now_s, bench.now_s) == [helm.Refuse(1, helm.LET_GO)]
    assert not bench.drives(one)


def test_a_stop_that_is_newer_than_the_click_is_not_released(driving):
    """The click waited in a stalled connection, and the stop was pressed again meanwhile."""
    bench, one, _ = driving
    bench.helm.stop(2, bench.now_s)
    bench.later()
    bench.rest(one)
    bench.later(5.0)
    clicked_s = bench.now_s
    bench.later()
    bench.helm.stop(2, bench.now_s)
    assert kinds(bench.helm.release(1, clicked_s, bench.now_s)) == ["Refuse"]
    bench.later()
    bench.rest(one)  # overtakes the click
    assert kinds(bench.helm.release(1, clicked_s, bench.now_s)) == ["Refuse"]
    assert kinds(bench.helm.release(1, bench.now_s, bench.now_s)) == ["Unlatch"]


@pytest.mark.parametrize("heard_s", [None, 1e9])
def test_a_click_of_a_page_that_has_shown_nothing_releases_nothing(driving, heard_s):
    bench, one, _ = driving
    bench.helm.stop(2, bench.now_s)
    bench.later()
    bench.rest(one)
    assert kinds(bench.helm.release(1, heard_s, bench.now_s)) == ["Refuse"]


def test_a_press_from_before_a_stop_that_arrives_after_it_does_not_drive(driving):
    """The person has let go and pressed again, and the page did not know of the stop yet."""
    bench, one, _ = driving
    under_way = [one.lift(bench.now_s), one.push(bench.now_s)]
    bench.now_s += 0.01
    bench.helm.robot_stopped(WHY, bench.now_s)
    bench.now_s += 0.01
    assert "Drive" not in kinds([act for each in under_way for act in bench.arrives(one, each)])
    bench.later()
    assert not bench.drives(one) and bench.presses_again(one)


def test_a_stop_that_another_program_latches_counts(driving):
    bench, one, _ = driving
    assert bench.helm.robot_latched(True, bench.now_s) == [helm.Halt(EMERGENCY), helm.Tell()]
    assert bench.helm.robot_latched(True, bench.now_s) == []
    state = bench.helm.state()
    assert (state.latched, state.latched_by, state.latched_by_other) == (True, None, "another program")
    assert not bench.presses_again(one)


def test_a_stop_that_another_program_latches_while_nobody_drives_is_shown(bench):
    bench.page(takes=True)
    assert bench.helm.robot_latched(True, bench.now_s) == [helm.Tell()]
    assert bench.helm.state().why.reason is EMERGENCY
    bench.helm.robot_latched(False, bench.now_s)
    assert bench.helm.state().latched_by_other == ""


def test_a_stop_of_another_program_is_released_after_the_page_has_shown_it(bench):
    """And one that was latched already is not newer for it."""
    page = bench.page(takes=True)
    bench.later()
    bench.helm.robot_latched(True, bench.now_s)
    assert bench.helm.release(1, bench.now_s, bench.now_s) == [helm.Refuse(1, helm.LET_GO)]
    bench.helm.stop(1, bench.now_s)
    bench.later()
    bench.rest(page)
    bench.helm.robot_latched(False, bench.now_s)
    bench.later()
    bench.helm.robot_latched(True, bench.now_s)
    assert bench.helm.release(1, bench.now_s, bench.now_s) == [helm.Unlatch(), helm.Tell()]


def test_a_stop_that_another_program_releases_needs_a_new_press(driving):
    bench, one, _ = driving
    bench.helm.robot_latched(True, bench.now_s)
    bench.later()
    bench.rest(one)
    under_way = one.push(bench.now_s)
    bench.now_s += 0.01
    bench.helm.robot_latched(False, bench.now_s)
    assert "Drive" not in kinds(bench.arrives(one, under_way))
    bench.later()
    assert not bench.drives(one) and bench.presses_again(one)


def test_a_stop_of_ours_is_not_ended_by_the_robot(driving):
    """The robot may not have heard of it yet, or another program has released it."""
    bench, one, _ = driving
    bench.helm.robot_latched(True, bench.now_s)
    bench.helm.stop(2, bench.now_s)
    assert bench.helm.state().latched_by_other == ""
    bench.helm.robot_latched(False, bench.now_s)
    assert bench.helm.state().latched and not bench.presses_again(one)


def test_a_stop_of_ours_that_another_program_releases_is_shown(driving):
    bench, *_ = driving
    bench.helm.stop(2, bench.now_s)
    shown = [bench.helm.state().released_by_other]
    for latched in (True, False, True, False):
        bench.helm.robot_latched(latched, bench.now_s)
        shown.append(bench.helm.state().released_by_other)
    assert shown == [False, False, True, False, True]
    bench.helm.stop(2, bench.now_s)
    assert not bench.helm.state().released_by_other


def test_a_release_of_ours_is_not_that_of_another_program(driving):
    bench, one, _ = driving
    bench.helm.stop(1, bench.now_s)
    bench.helm.robot_latched(True, bench.now_s)
    bench.later()
    bench.rest(one)
    bench.helm.release(1, bench.now_s, bench.now_s)
    bench.helm.robot_latched(False, bench.now_s)
    assert not bench.helm.state().released_by_other


def test_what_echoes_the_future_is_no_release(driving):
    """A page that is wrong, or lies, gains nothing for later stops."""
    bench, one, _ = driving
    bench.later()
    bench.arrives(one, one.lift(bench.now_s)._replace(heard_s=1e9))
    bench.helm.stop(2, bench.now_s)
    bench.later()
    one.held = False
    bench.arrives(one, one.message(bench.now_s)._replace(heard_s=None, heard_t_s=None))
    bench.helm.release(1, bench.now_s, bench.now_s)
    assert "Drive" not in kinds(bench.push(one))
