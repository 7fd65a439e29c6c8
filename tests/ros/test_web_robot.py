"""The robot of the page behind topics: what it sends, refuses and shows.  No ROS."""

import contextlib
import math
import queue
import threading
import time
from http.client import IncompleteRead
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range

from mrl_driver.apps.web.helm import Goal, why_of
from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.safety.protective_zones import STALE_S as RANGE_STALE_S
from mrl_driver.view.shown_state import SILENT_S
from ros1_bridge.topics import topic_robot
from ros1_bridge.topics.topic_robot import STILL_M_S, TopicRobot
from ros1_bridge.web import emergency_stop, topic_page_robot
from ros1_bridge.web.emergency_stop import EmergencyStop
from ros1_bridge.web.topic_page_robot import FOLLOWED_S, STANDS_S, TopicPageRobot
from tests.waiting import wait_until

NODE = "/robot1/robot_node"
FORWARD = (0.2, 0.1, 0.0, 0.03)
STOP = "stop"
STEP_S = 0.05


class Sent(list):
    """What the page sends; `reason` is why the robot is stopped instead."""

    reason = ""

    def drive(self, *speeds):
        self.append(STOP if self.reason else speeds)
        return self.reason

    def stop(self):
        self.append(STOP)


class Services(list):
    """Calls of the node's services; each answers as `answers` says, or raises `error`."""

    answers, error = (True, ""), None

    def __call__(self, service):
        self.append(service)
        if self.error:
            raise self.error
        return self.answers


class Bench:
    """A page's robot, with time by hand."""

    def __init__(self, monkeypatch, model="traxbot"):
        self.now_s = 100.0
        for module in (topic_robot, topic_page_robot, emergency_stop):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        self.sent, self.services, self.readings, self.warning = Sent(), Services(), [], ""
        self.topics = TopicRobot(None, lambda: False, model, node=NODE)
        self.emergency = EmergencyStop(self.services)
        self.bags = SimpleNamespace(name="", loss="", stop=lambda: "")
        self.robot = TopicPageRobot(
            self.topics, self.sent, self.emergency, self.bags, self.readings.append, lambda: self.warning
        )
        self.odometry()
        self.status()

    def odometry(self, x_m=0.0, speed_m_s=0.0, after_s=STEP_S):
        self.now_s += after_s
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.orientation.w = x_m, 1.0
        message.twist.twist.linear.x = speed_m_s
        self.topics.on_odometry(message)

    def status(self, cause="none", ready=True, mode="drive"):
        level, line = (0, "ready") if cause == "none" else (1, f"stopped by {StopReason(cause).words}")
        values = {"mode": mode, "ready": str(ready).lower(), "stopped by": cause}
        self.topics.on_status(
            DiagnosticStatus(level, "", line, "", [KeyValue(*pair) for pair in values.items()])
        )

    def drive(self, times=1):
        """Commands of a control that is held, each after an odometry message; returns the last answer."""
        for _ in range(times):
            self.odometry()
            answer = self.robot.drive(*FORWARD)
        return answer.words if answer else ""

    def notice(self):
        return self.robot.shown(self.now_s).notice


@pytest.fixture
def bench(monkeypatch, close_later):
    def make(**options):
        made = Bench(monkeypatch, **options)
        close_later(made.robot)
        return made

    return make


def test_one_stop_ends_the_driving_and_a_page_that_does_not_drive_sends_nothing(bench):
    """Other nodes may drive meanwhile."""
    page = bench()
    page.robot.stop()
    page.robot.shown(page.now_s), page.robot.sample()
    assert page.sent == []
    page.drive(3)
    page.robot.stop()
    page.robot.stop()
    assert page.sent == [FORWARD] * 3 + [STOP]


def test_sideways_speed_is_for_robots_that_can(bench):
    tracked, omni = bench(), bench(model="omni")
    for page in (tracked, omni):
        page.odometry()
        page.robot.drive(0.0, 0.0, 0.1, 0.0)
    assert (tracked.sent, omni.sent) == ([(0.0, 0.0, 0.0, 0.0)], [(0.0, 0.0, 0.1, 0.0)])


OWN_STOPS = (
    "command_timeout protective_zone command_too_late battery wheel_mismatch motors_disabled no_telemetry"
)


@pytest.mark.parametrize("cause", [*OWN_STOPS.split(), "link_watchdog"])
def test_after_a_stop_by_the_robots_node_the_press_is_over(bench, cause):
    page = bench()
    page.drive(3)
    page.status(cause)
    assert page.robot.stopped_by
    page.status()
    assert page.drive() and page.drive(), "the robot may drive, but this press may not"
    assert page.sent == [FORWARD] * 3 + [STOP]
    page.robot.stop()
    assert page.drive() == "" and page.sent[-1] == FORWARD


def test_a_stop_that_another_status_follows_at_once_counts(bench):
    """The next command may end it before the server looks."""
    page = bench()
    page.drive(2)
    page.status("command_timeout")
    page.status()
    assert page.robot.stopped_by


def test_a_reason_from_before_the_press_has_time_to_end(bench):
    page = bench()
    page.status("protective_zone")
    assert page.drive() == ""
    page.status()
    assert page.drive(int(FOLLOWED_S / STEP_S) + 2) == ""
    page.robot.stop()
    page.status("protective_zone")  # the robot stands before a wall: it must not set off when that goes away
    assert "obstacle" in page.drive(int(FOLLOWED_S / STEP_S) + 2) and page.sent[-1] == STOP


def test_a_robot_that_may_not_move_is_sent_nothing_but_a_stop(bench):
    """The stop clears a wheel mismatch."""
    page = bench()
    page.status("wheel_mismatch", ready=False, mode="wheel_mismatch")
    assert "wheel" in page.drive() and page.sent == []
    page.robot.stop()
    assert page.sent == [STOP]


def test_silent_odometry_ends_the_press(bench):
    page = bench()
    page.drive(2)
    page.now_s += SILENT_S + STEP_S
    assert "no odometry" in page.robot.drive(*FORWARD).words
    assert page.sent == [FORWARD] * 2 + [STOP]
    assert page.drive(), "odometry is back, the control is still held"


@pytest.mark.parametrize("part", ["x_m", "speed_m_s"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_odometry_that_is_not_finite_counts_as_none(bench, part, value):
    page = bench()
    page.drive()
    page.odometry(**{part: value}, after_s=SILENT_S + STEP_S)
    assert "no odometry" in page.robot.drive(*FORWARD).words
    assert page.topics.pose == ORIGIN


def test_a_delay_above_the_limit_ends_the_press(bench):
    page = bench()
    page.drive()
    page.sent.reason = "the delay is 0.4 s"
    assert page.drive() == "the delay is 0.4 s"
    page.sent.reason = ""
    assert page.drive() == "the delay is 0.4 s"
    page.robot.stop()
    assert page.drive() == "", "another press"


def test_a_robot_stands_after_the_stop_when_its_odometry_says_so(bench):
    page = bench()
    page.odometry(speed_m_s=0.2)
    page.drive()
    page.robot.stop()
    page.odometry(speed_m_s=2 * STILL_M_S)
    assert not page.robot.stands
    page.odometry()
    page.odometry(after_s=STANDS_S)
    assert page.robot.stands


def test_the_stop_of_the_page_is_latched_at_the_robots_node(bench):
    page = bench()
    page.drive()
    page.robot.latch()
    assert page.robot.latched and page.sent[-1] == STOP
    wait_until(lambda: page.services == ["stop"])
    assert page.drive() and page.sent == [FORWARD, STOP]


class HangingServices(list):
    """Calls of the node's services; those of one service hang, as when the robot's computer has lost power."""

    def __init__(self, hanging):
        self.hanging, self.end = hanging, threading.Event()

    def __call__(self, service):
        self.append(service)
        if service == self.hanging:
            self.end.wait()
        return True, ""


@contextlib.contextmanager
def emergency_of(services):
    emergency = EmergencyStop(services)
    yield emergency
    emergency.close()
    services.end.set()


def test_a_stop_whose_call_hangs_is_asked_for_again():
    services = HangingServices("stop")
    with emergency_of(services) as emergency:
        emergency.latch()
        wait_until(lambda: len(services) >= 2)
        assert emergency.latched
        emergency.release()
        wait_until(lambda: "release_stop" in services)


@pytest.mark.parametrize("again_s, calls", [(0.001, 3), (1000.0, 1)])
def test_the_number_of_calls_that_hang_is_limited_and_a_press_adds_none(monkeypatch, again_s, calls):
    """A page that only watches may send 200 of them a second."""
    monkeypatch.setattr(emergency_stop, "AGAIN_S", again_s)
    monkeypatch.setattr(emergency_stop, "MOST_CALLS", 3)
    services = HangingServices("stop")
    with emergency_of(services) as emergency:
        for _ in range(10):
            emergency.latch()
            wait_until(lambda: len(services) >= calls)
            time.sleep(0.01)  # time for many more
        assert services == ["stop"] * calls


def test_a_stop_is_asked_for_again_when_a_release_that_it_overtook_returns():
    """The node may have done the release after the stop."""
    services = HangingServices("release_stop")
    with emergency_of(services) as emergency:
        emergency.release()
        wait_until(lambda: services)
        emergency.latch()
        wait_until(lambda: services[1:] == ["stop"])
        services.end.set()
        wait_until(lambda: services[1:] == ["stop", "stop"])


class OpenCalls(list):
    """Calls of the node's services: each has a queue for its answer."""

    def __call__(self, service):
        answer = queue.Queue()
        self.append(answer)
        return answer.get()

    def end(self):
        for answer in self:
            answer.put((True, ""))


@pytest.fixture
def open_calls():
    calls = OpenCalls()
    emergency = EmergencyStop(calls)
    yield emergency, calls
    emergency.close()
    calls.end()


def test_a_late_answer_to_a_stop_does_not_confirm_a_newer_one(open_calls):
    emergency, calls = open_calls
    for count, ask in enumerate((emergency.latch, emergency.release, emergency.latch), 1):
        ask()
        wait_until(lambda count=count: len(calls) == count)
    calls[0].put((True, ""))
    wait_until(lambda: len(calls) >= 4)


def test_a_late_refusal_of_a_stop_that_is_confirmed_is_no_trouble(open_calls):
    emergency, calls = open_calls
    emergency.latch()
    wait_until(lambda: len(calls) >= 2)
    wait_until(lambda: [answer.put((True, "")) for answer in calls[1:]] and names().count("stop") == 1)
    calls[0].put((False, "service [/stop] unavailable"))
    wait_until(lambda: "stop" not in names())
    assert not emergency.trouble


def names():
    return [thread.name for thread in threading.enumerate()]


@pytest.mark.parametrize(
    "answers, error, words",
    [
        ((False, "service [/stop] unavailable"), None, "emergency stop: service"),
        (None, IncompleteRead(b""), "Incomplete"),
    ],
)
def test_a_call_that_raises_ends_no_later_one(bench, answers, error, words):
    """As if the master ends in the middle of its answer.  A stop that is not confirmed is asked for again."""
    page = bench()
    page.services.answers, page.services.error = answers, error
    page.robot.latch()
    wait_until(lambda: len(page.services) > 1)
    assert page.robot.latched and words in page.notice()
    page.services.answers, page.services.error = (True, ""), None
    wait_until(lambda: not page.emergency.trouble)


def test_an_emergency_stop_of_somebody_else_is_shown_and_obeyed(bench):
    page = bench()
    page.status("emergency_stop", ready=False, mode="emergency_stop")
    assert page.robot.latched and "emergency stop" in page.drive() and page.sent == []
    page.status()
    assert not page.robot.latched


def test_a_release_waits_for_the_status(bench):
    page = bench()
    page.status("emergency_stop", ready=False, mode="emergency_stop")
    page.robot.release()
    wait_until(lambda: page.services == ["release_stop"])
    assert page.robot.latched
    page.status()
    assert not page.robot.latched


def test_a_goal_is_driven_to_with_the_sonars(bench):
    page = bench()
    page.topics.on_range(Range(range=2.0), "front")
    assert page.robot.go(Goal(1.0, 0.0, 0.0), 0.02) is None
    linear_m_s, *_, age_s = page.sent[-1]
    assert linear_m_s > 0 and age_s == 0.02
    page.odometry(x_m=1.0)
    page.robot.go(Goal(1.0, 0.0), 0.0)
    assert page.sent[-1] == STOP and page.notice() == why_of(StopReason.GOAL_REACHED).words


def test_a_range_at_its_maximum_is_nothing_in_the_way_of_a_goal(bench):
    """As with `clear_range`."""
    page = bench()
    page.topics.on_range(Range(range=0.5, max_range=0.5), "front")
    assert page.topics.ranges == {"front": math.inf}


def test_an_old_range_is_no_reading(bench):
    page = bench()
    page.topics.on_range(Range(range=0.5), "front")
    assert page.topics.ranges == {"front": 0.5}
    page.now_s += 2 * RANGE_STALE_S
    assert math.isnan(page.topics.ranges["front"])


def diagnostics(node, part, **values):
    pairs = [KeyValue(key.replace("_", " "), value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name=f"{node}: {part}", values=pairs)])


def test_limits_are_those_of_the_robots_own_node(bench):
    page = bench()
    for node, linear in (("robot1/robot_node", "0.1 m/s"), ("robot2/robot_node", "0.9 m/s")):
        page.topics.on_diagnostics(
            diagnostics(node, "Motion", Linear_Speed_Limit=linear, Angular_Speed_Limit="0.5 rad/s")
        )
    assert page.topics.limits[:2] == (0.1, 0.5)


def test_a_warning_is_shown_unless_there_is_something_more_important(bench):
    page = bench()
    page.warning = "robot_node/cmd_vel_timeout is 0.5 s"
    assert page.notice() == page.warning
    page.status("wheel_mismatch")
    assert "wheel mismatch" in page.notice()
