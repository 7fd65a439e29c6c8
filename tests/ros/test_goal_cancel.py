"""What is published to cancel the goals of planners."""

from types import SimpleNamespace

import pytest
from actionlib_msgs.msg import GoalID
from genpy import Time

from ros1_bridge.robot.goal_cancel import GoalCancel

from .fake_topics import Topics

NOW = Time(100, 0)


def made(now=NOW, closed=False):
    """A cancel whose node starts now, and what it publishes."""
    topics = Topics()
    ros = SimpleNamespace(Publisher=topics, Time=SimpleNamespace(now=lambda: now), ROSException=ValueError)
    cancel = GoalCancel(ros)
    out = topics["move_base/cancel"]
    if closed:
        out.publish = refuse
    return cancel, out


def refuse(message):
    raise ValueError("publish() to a closed topic")


def test_goals_of_before_the_start_are_cancelled_whenever_their_planner_connects():
    _, out = made()
    assert out.options["latch"] and out.sent == [GoalID(stamp=NOW)]


def test_all_goals_are_cancelled_whatever_their_clients_clock_shows():
    cancel, out = made()
    cancel.cancel(everything=True)
    assert out.sent[1:] == [GoalID(), GoalID(stamp=NOW)]


def test_goal_of_after_a_release_is_not_cancelled_though_the_cancel_arrives_late():
    cancel, out = made()
    cancel.cancel(everything=False)
    assert out.sent[1:] == [GoalID(stamp=NOW)]


def test_nothing_is_cancelled_at_a_start_before_simulated_time():
    """A cancel with the time 0 means all goals, of whatever time."""
    _, out = made(now=Time())
    assert out.sent == []


@pytest.mark.parametrize("everything", [True, False])
def test_stop_does_not_fail_because_the_shutdown_has_closed_the_topic(everything):
    cancel, _ = made(closed=True)
    cancel.cancel(everything)
