"""The multiplexer of velocity commands and the planner's limit: rules on times of the test's own, nodes on messages."""

import math
import signal

import pytest
import rospy
import yaml
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Twist
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Bool, String

from mrl_driver.errors import ConfigError
from ros1_bridge.control.planner_limit import RAISE_S, STEP_M_S, PlannerLimit
from ros1_bridge.teleop.velocity_mux import Input, VelocityMux, read_inputs
from tests.waiting import wait_until

from .rig import ROOT, START_S
from .tables import Offered

SHIPPED = yaml.safe_load((ROOT / "ros1_bridge" / "teleop" / "twist_mux.yaml").read_text())
HAND, PLAN = Input("hand", "joy_vel", 0.5, 100), Input("plan", "nav_vel", 0.5, 10)
PAUSE, ALIVE = Input("pause", "pause", 0.0, 50), Input("alive", "alive", 1.0, 255)
FORWARD, TURN, STOP = (0.2, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.9), (0.0,) * 6
ROW = {"name": "hand", "topic": "joy_vel", "timeout": 0.5, "priority": 100}


@pytest.fixture
def mux():
    """Two sources and a lock."""
    return VelocityMux([PLAN, HAND], [PAUSE])


def test_a_higher_priority_takes_over_at_once(mux):
    assert mux.command("plan", FORWARD, 1.0) == FORWARD
    assert mux.command("hand", TURN, 1.01) == TURN
    assert mux.command("plan", FORWARD, 1.02) is None
    assert not mux.stops(1.02)


def test_a_lower_priority_drives_again_after_the_timeout_of_the_higher_until_that_returns(mux):
    mux.command("hand", TURN, 1.0)
    assert mux.command("plan", FORWARD, 1.5) is None
    assert mux.command("plan", FORWARD, 1.51) == FORWARD
    assert mux.command("hand", TURN, 2.0) == TURN
    assert not mux.stops(2.4), "the silence of a source that does not drive stops nothing"


def test_the_robot_is_stopped_once_when_its_source_falls_silent(mux):
    mux.command("plan", FORWARD, 1.0)
    assert [mux.stops(at) for at in (1.5, 1.51, 1.52)] == [False, True, False]


def test_the_robot_is_stopped_when_the_higher_source_falls_silent_though_the_lower_one_lives(mux):
    mux.command("hand", TURN, 1.0)
    mux.command("plan", FORWARD, 1.4)
    assert mux.stops(1.51)


def test_a_lock_stops_the_sources_below_it(mux):
    mux.command("plan", FORWARD, 1.0)
    mux.lock("pause", True, 1.1)
    assert mux.stops(1.1)
    assert mux.command("plan", FORWARD, 1.2) is None
    assert mux.command("hand", TURN, 1.2) == TURN
    mux.lock("pause", False, 3.0)
    assert mux.command("plan", FORWARD, 3.1) == FORWARD


def test_a_lock_with_a_timeout_is_locked_before_its_first_message_and_when_it_is_silent():
    mux = VelocityMux([HAND], [ALIVE])
    assert mux.command("hand", TURN, 1.0) is None
    mux.lock("alive", False, 1.0)
    assert mux.command("hand", TURN, 1.2) == TURN
    mux.command("hand", TURN, 1.9)
    assert [mux.stops(at) for at in (2.0, 2.01)] == [False, True]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("index", range(6))
def test_a_command_that_is_not_finite_is_a_stop(mux, index, value):
    wrong = [*FORWARD[:index], value, *FORWARD[index + 1 :]]
    assert mux.command("plan", wrong, 1.0) == STOP


def test_a_command_that_is_not_finite_keeps_lower_sources_out(mux):
    mux.command("hand", [math.nan] * 6, 1.0)
    assert mux.command("plan", FORWARD, 1.1) is None


def passed(mux, name, seconds, begin_s, numbers=FORWARD):
    """Whether commands of a source that comes each 0.1 s pass, from a time on."""
    return {
        mux.command(name, numbers, begin_s + 0.1 * step) is not None for step in range(round(10 * seconds))
    }


def test_a_source_that_was_held_back_since_a_stop_drives_only_after_a_pause(mux):
    """The robot has only seen the hand meanwhile."""
    assert passed(mux, "plan", 1.0, 0.0) == {True}
    mux.distrust()
    assert passed(mux, "plan", 1.0, 1.0) == {True}, "the robot judges the source that drives"
    mux.command("hand", TURN, 2.0)
    assert passed(mux, "plan", 3.0, 2.0) == {False} and mux.unpaused == {"plan"}
    mux.command("plan", STOP, 5.0)
    assert passed(mux, "plan", 3.0, 5.1) == {False}, "for 0.2 s it was zero"
    assert mux.active(8.0) == ""
    assert passed(mux, "plan", 1.0, 8.6) == {True} and not mux.unpaused


def test_a_hand_that_drives_goes_on_while_the_goals_of_others_are_cancelled(mux):
    """As at a change of the mode."""
    assert passed(mux, "hand", 1.0, 0.0) == {True}
    mux.distrust()
    assert passed(mux, "hand", 1.0, 1.0) == {True}
    mux.command("hand", STOP, 2.0)
    assert passed(mux, "hand", 1.0, 2.1) == {True}, "a zero between two moves"


def test_the_end_of_manual_mode_lets_no_stream_of_before_drive(mux):
    """The robot cancels all goals at each change."""
    passed(mux, "plan", 1.0, 0.0)
    mux.distrust()
    mux.lock("pause", True, 1.0)
    assert mux.stops(1.0) and passed(mux, "plan", 1.0, 1.0) == {False}
    mux.distrust()
    mux.lock("pause", False, 2.0)
    assert passed(mux, "plan", 3.0, 2.0) == {False}


def test_manual_mode_holds_navigation_alone():
    sources, locks, _ = read_inputs(SHIPPED, "/mux")
    assert max(lock.priority for lock in locks) > max(source.priority for source in sources)
    mux = VelocityMux(sources, locks)
    mux.lock("manual", True, 1.0)
    passed = [mux.command(name, FORWARD, 1.0) for name in ("navigation", "keyboard", "joystick")]
    assert passed == [None, FORWARD, FORWARD]


def test_shipped_configuration_has_the_types_that_twist_mux_reads():
    """It takes a whole number for a priority, and only a number with a point for a timeout."""
    rows = [row for rows in SHIPPED.values() for row in rows]
    assert rows and all(
        isinstance(row["timeout"], float) and isinstance(row["priority"], int) for row in rows
    )


@pytest.mark.parametrize(
    "given, said",
    [
        ({}, "topics is None, expected a list"),
        ({"topics": []}, "at least one source"),
        ({"topics": [ROW], "sources": []}, "mux/sources is unknown, expected topics, locks, cmd_vel_pause"),
        ({"topics": [{"name": "hand"}]}, "expected the keys name, topic, timeout, priority"),
        ({"topics": [{**ROW, "timeout": 0.0}]}, "timeout is 0.0, expected a number from more than 0"),
        ({"topics": [{**ROW, "timeout": math.nan}]}, "timeout is nan"),
        ({"topics": [{**ROW, "priority": 0}]}, "priority is 0, expected a whole number from 1 to 255"),
        ({"topics": [{**ROW, "priority": True}]}, "priority is True"),
        ({"topics": [{**ROW, "topic": ""}]}, "topic is '', expected a name"),
        ({"topics": [ROW, {**ROW, "name": "other", "topic": "other"}]}, "the priority 100 twice"),
        ({"topics": [ROW], "cmd_vel_pause": 6.0}, "cmd_vel_pause is 6.0, expected a number from 0 to 5 s"),
        ({"topics": [ROW], "locks": [{**ROW, "timeout": -1.0}]}, "timeout is -1.0, expected a number from 0"),
    ],
)
def test_wrong_configuration_is_refused_in_one_line(given, said):
    with pytest.raises(ConfigError) as caught:
        read_inputs(given, "/mux")
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_node_refuses_a_source_on_its_own_topic(rig):
    """It would hear itself."""
    rospy.set_param(f"{rig.ns}/cmd_vel_mux", {"topics": [{**ROW, "topic": "cmd_vel"}]})
    child = rig.program("cmd_vel_mux")
    assert child.wait(START_S) and child.exit_code == ConfigError.exit_code
    assert "source hand has the topic cmd_vel" in child.last_words()
    rospy.delete_param(f"{rig.ns}/cmd_vel_mux")


def test_node_passes_on_by_priority_and_stops_when_it_ends(rig):
    """With the shipped configuration."""
    rospy.set_param(f"{rig.ns}/cmd_vel_mux", SHIPPED)
    node = rig.program("cmd_vel_mux")
    twists, active = rig.topic("cmd_vel", Twist), rig.topic("active_source", String)
    plan, lock = rig.publisher("nav_vel", Twist), rig.publisher("lock_cmd_vel", Bool)
    twists.wait_for_publisher()
    forward = Twist()
    forward.linear.x = 0.2
    plan.publish(forward)
    assert twists.wait(1)[-1] == forward
    assert twists.wait(2)[-1] == Twist()  # silent

    def is_active(name):
        plan.publish(forward)
        return active.messages[-1].data == name

    for locked, name in ((False, "navigation"), (True, ""), (False, "navigation")):
        lock.publish(locked)
        wait_until(lambda: is_active(name), step_s=0.05)  # noqa: B023
    lock.publish(True)
    wait_until(lambda: is_active(""), step_s=0.05)
    cancel = rig.publisher("move_base/cancel", GoalID)
    cancel.publish(GoalID())
    wait_until(lambda: is_active(""), step_s=0.05)
    assert "since before the robot's last stop" not in node.last_words(), "a client has cancelled its goals"
    cancel.publish(GoalID(stamp=rospy.Time.now()))
    wait_until(
        lambda: is_active("") and "since before the robot's last stop" in node.last_words(), step_s=0.05
    )
    Offered(rig, "cmd_vel_mux").require_topics()
    node.signal(signal.SIGINT)
    wait_until(lambda: node.exit_code is not None)
    assert twists.messages[-1] == Twist()
    rospy.delete_param(f"{rig.ns}/cmd_vel_mux")


OWN, SLOWEST = 0.3, 0.05
FREE = math.inf


class Planner:
    """A planner's parameters, and what is stored about it."""

    def __init__(self, own=OWN):
        self.values = {"max_vel_x": own, "min_vel_x": SLOWEST}
        self.stored, self.calls, self.now = None, [], 0.0
        self.limit = self.new_node()

    def new_node(self):
        self.limit = PlannerLimit(self.configure, self.store, self.stored)
        return self.limit

    def configure(self, values):
        self.calls.append(dict(values))
        self.values.update(values)
        return self.values

    def store(self, pair):
        self.stored = pair

    def step(self, allowed, seconds=0.2):
        """The line of the log, and the planner's speed after some seconds with this allowed speed."""
        lines = []
        for _ in range(max(1, round(seconds / 0.2))):
            self.now += 0.2
            lines.append(self.limit.step(allowed, self.now))
        return "".join(lines), self.values["max_vel_x"]


@pytest.mark.parametrize(
    "own, allowed, speed", [(OWN, FREE, OWN), (OWN, 0.17, 0.15), (0.12, 0.25, 0.12), (OWN, 0.0, SLOWEST)]
)
def test_zone_lowers_the_planners_speed_at_once_but_not_below_its_slowest(own, allowed, speed):
    """A highest speed below its lowest one makes no sense to the planner, which is not asked while the way is free."""
    planner = Planner(own)
    line, now_m_s = planner.step(allowed)
    assert now_m_s == pytest.approx(speed) and bool(planner.calls) == (allowed < FREE)
    assert bool(line) == (speed < own)
    assert line in ("", f"a zone is entered: the planner drives at {speed:g} m/s at most")


def test_speed_is_given_back_when_the_zone_has_been_clear_for_a_while():
    planner = Planner()
    planner.step(0.17)
    assert planner.step(FREE, RAISE_S - 0.4)[1] == pytest.approx(0.15)
    assert planner.step(FREE, 1.0) == ("the planner has its own highest speed again, 0.3 m/s", OWN)


def test_range_that_flickers_raises_nothing():
    planner = Planner()
    planner.step(0.1)
    for _ in range(20):
        assert planner.step(FREE, 0.4)[1] == planner.step(0.1)[1] == pytest.approx(0.1)


def test_planner_is_told_seldom():
    planner = Planner()
    for allowed in range(290, 100, -1):
        planner.step(allowed / 1000)
    assert sum(bool(call) for call in planner.calls) == round((0.29 - 0.10) / STEP_M_S)


def test_speed_that_somebody_else_sets_meanwhile_stays():
    planner = Planner()
    planner.step(0.17)
    planner.values["max_vel_x"] = 0.22
    assert planner.step(FREE, 5.0)[1] == 0.22


@pytest.mark.parametrize("restarted, speed", [(False, OWN), (True, 0.25)])
def test_node_that_was_killed_in_a_zone_leaves_no_slow_planner(restarted, speed):
    planner = Planner()
    planner.step(0.17)
    if restarted:
        planner.values["max_vel_x"] = 0.25
    planner.new_node()
    assert planner.step(FREE, 5.0)[1] == speed and planner.stored is None


def test_planner_without_a_highest_speed_is_refused():
    planner = Planner()
    del planner.values["max_vel_x"]
    with pytest.raises(ConfigError, match="has no parameter max_vel_x, expected"):
        planner.step(0.1)


@given(st.lists(st.floats(0.0, 1.0) | st.just(FREE), max_size=40))
def test_planner_is_never_faster_than_allowed_or_its_own(speeds):
    planner = Planner()
    for allowed in speeds:
        _, speed = planner.step(allowed)
        assert speed <= max(SLOWEST, min(allowed, OWN)) + 1e-9 or speed == OWN and allowed >= OWN
    planner.limit.give_back()
    assert planner.values["max_vel_x"] == OWN and planner.stored is None
