"""A stop that stays ends the goals of planners; what a planner goes on sending moves nothing.  In stepped time."""

import math

import pytest

from mrl_driver.clocks import slept_s
from mrl_driver.errors import FrameError, LinkLost
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.inputs import Inputs
from ros1_bridge.control import commander
from ros1_bridge.control.commander import LOST_S, Commander
from ros1_bridge.control.velocity_sources import Source

from .test_commander import FRAME_S, Bench

PLANNER, HAND = Source("/move_base"), Source("/joystick")
ALL, EARLIER = True, False


class Planned(Bench):
    """A bench whose planner goes on sending; what happened, in order: stops of the driver, and cancelled goals."""

    def __init__(self):
        super().__init__()
        self.order, self.driver.link.age_s = [], 0.0
        stop = self.driver.stop
        self.driver.stop = lambda: self.order.append("stop") or stop()
        self.commander.cancel_goals = self.order.append

    def plan(self, seconds, source=PLANNER, speed_m_s=0.3):
        """The planner sends a command for each frame; which answers it got."""
        answers = set()
        for _ in range(round(seconds / FRAME_S)):
            self.now_s += FRAME_S
            answers.add(self.commander.drive(speed_m_s, 0.0, source=source))
        return answers

    def be_away(self, seconds):
        """No telemetry arrives for a while."""
        self.driver.ready, self.driver.command, begun_s = False, None, self.now_s
        while self.now_s < begun_s + seconds:
            self.plan(0.2)
            self.driver.link.age_s = self.now_s - begun_s
            self.commander.watch_link()
        self.driver.ready, self.driver.link.age_s = True, 0.0
        self.commander.watch_link()


@pytest.fixture
def bench():
    return Planned()


def latched(bench):
    bench.commander.latch()
    bench.plan(1.0)
    bench.commander.release()


def disabled(bench):
    bench.commander.enable(False)
    bench.plan(1.0)
    bench.commander.enable(True)


def cut_off(bench):
    bench.be_away(2.0)


def restarted(bench):
    bench.commander.end_goals()  # of a command that came just after the restart, too
    assert bench.driver.command is None


@pytest.mark.parametrize("stop", [latched, disabled, cut_off, restarted])
def test_planner_that_goes_on_publishing_moves_nothing_until_it_has_paused(bench, stop):
    assert bench.plan(1.0) == {True}
    stop(bench)
    assert bench.plan(60.0) == {False} and bench.driver.command is None
    assert "silent or zero for 0.5 s" in bench.commander.refusal()
    assert bench.plan(1.0, HAND) == {True} and bench.order.count(ALL) == 1
    bench.plan(0.5, speed_m_s=0.0)
    assert bench.plan(1.0) == {True}


def test_the_stop_leaves_before_the_cancel(bench):
    bench.plan(1.0)
    bench.commander.latch()
    bench.commander.release()
    bench.commander.enable(False)
    bench.commander.enable(True)
    assert bench.order == ["stop", ALL, EARLIER] * 2


def test_releasing_the_boards_emergency_stop_cancels_the_goals_of_before_alone(bench):
    bench.driver.inputs, bench.driver.release_emergency = Inputs((), True), lambda: True
    assert bench.commander.release_input() and bench.order == [EARLIER]


@pytest.mark.parametrize("stop", [Commander.latch, lambda commander: commander.enable(False)])
def test_goals_are_cancelled_though_the_stop_cannot_leave(bench, stop):
    bench.driver.lost = True
    with pytest.raises(LinkLost):
        stop(bench.commander)
    assert bench.order == ["stop", ALL]


@pytest.mark.parametrize(
    "ready, age_s, ended",
    [(False, 1.0, []), (True, 5.0, []), (False, 1.01, ["stop", ALL])],
    ids=["short", "this program stood still", "away"],
)
def test_goals_outlive_a_gap_that_is_short_or_not_of_the_link(bench, ready, age_s, ended):
    """A longer one ends them while the link is still away."""
    bench.plan(1.0)
    bench.driver.ready, bench.driver.link.age_s = ready, age_s
    bench.commander.watch_link()
    bench.driver.ready = True
    assert bench.order == ended and bench.plan(1.0) == {not ended}


@pytest.mark.parametrize("notices", [Planned.plan, lambda bench, _: bench.commander.watch_link()])
def test_goals_end_if_the_computer_was_suspended(bench, monkeypatch, notices):
    """Its monotonic clock stood still meanwhile."""
    bench.plan(1.0)
    monkeypatch.setattr(commander, "slept_s", lambda: slept_s() + LOST_S + 0.1)
    notices(bench, 0.1)
    assert bench.order == ["stop", ALL]
    assert bench.plan(60.0) == {False} and bench.driver.command is None


def test_goals_outlive_a_command_timeout_and_a_limit_of_zero(bench):
    bench.plan(1.0)
    bench.driver.command, bench.driver.stop_reason = None, StopReason.COMMAND_TIMEOUT
    bench.plan(1.0, speed_m_s=0.0)
    bench.commander.watch_link()
    assert bench.order == [] and bench.plan(1.0) == {True}


@pytest.mark.parametrize("manual", [True, False])
def test_change_of_the_mode_cancels_goals_and_a_hand_drives_on(bench, manual):
    bench.commander.set_manual(not manual)
    bench.plan(1.0, HAND)
    bench.order.clear()
    assert bench.commander.set_manual(manual) and bench.order == [ALL]
    assert bench.plan(1.0, HAND) == {True}
    assert not bench.commander.set_manual(manual) and bench.order == [ALL]


def test_command_that_is_not_finite_stops_the_robot_whoever_sends_it(bench):
    bench.plan(1.0)
    bench.commander.sources.distrust()
    bench.driver.drive = pytest.fail  # a command to move must not reach it
    bench.plan(1.0)

    def refuse(*speeds):
        raise FrameError("not finite")

    bench.driver.drive = refuse
    with pytest.raises(FrameError):
        bench.commander.drive(math.nan, 0.0, source=PLANNER)


def test_node_drives_to_a_new_pose_at_once_after_a_stop_whatever_a_planner_goes_on_sending(bench):
    bench.plan(1.0)
    latched(bench)
    bench.commander.seeking = True
    assert bench.commander.drive(0.1, 0.0)
    bench.plan(1.0)
    assert bench.commander.seeking and bench.driver.command == (0.1, 0.0)


@pytest.mark.parametrize(
    "call", [Commander.release, lambda commander: commander.enable(True)], ids=["release", "enable"]
)
def test_release_of_what_does_not_hold_ends_nothing(bench, call):
    bench.plan(1.0)
    call(bench.commander)
    assert bench.plan(1.0) == {True} and bench.order == []


def test_source_without_a_pause_is_named_as_the_cause_until_somebody_drives(bench):
    bench.driver.stop_reason = StopReason.BOOT
    bench.commander.sources.expect([PLANNER.node])
    bench.plan(1.0)
    assert bench.commander.stopped_by == StopReason.COMMANDS_UNPAUSED and bench.commander.ready
    bench.plan(1.0, HAND)
    assert bench.commander.stopped_by == StopReason.NONE
