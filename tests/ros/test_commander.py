"""Stops, limits and zones of the node's commands; why the robot stands; one caller at a time."""

import math
import threading

import pytest

from mrl_driver.driver.options import QUEUED_S
from mrl_driver.errors import LinkLost
from mrl_driver.geometry import Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot import models
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.inputs import Inputs
from mrl_driver.robot.models import Limits
from mrl_driver.safety.protective_zones import Scan, Zones, ZoneSettings
from mrl_driver.safety.speed_limiter import manual_speed_m_s
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.session import STALE_S
from ros1_bridge.control import commander as module
from ros1_bridge.control.commander import Commander, lowered

LIMITS = Limits(0.3, 1.0, 0.2, 1.0)
FRAME_S = 0.02


class Noted:
    """A driver's commands, and what it would say of itself."""

    def __init__(self):
        self.link = self.radio = self.board = self
        self.command, self.ready, self.battery_state, self.battery_v = None, True, "ok", 12.0
        self.stops, self.lost, self.may_be_moving = 0, False, False
        self.mismatch, self.stop_reason, self.hold, self.inputs = None, StopReason.NONE, None, None
        self.model, self.telemetry = models.load("pioneer"), None
        self.inhibited, self.limits = set(), LIMITS
        self.since_pause_s, self.restriction = math.inf, None

    def drive(self, *speeds):
        if not self.ready or self.inhibited:
            return False
        self.command = speeds
        return True

    def stop(self):
        if self.lost:
            raise LinkLost("gone")
        self.stops += 1
        self.command = None

    def inhibit(self, reason):
        self.inhibited.add(reason)
        self.stop()

    def allow(self, reason):
        self.inhibited.discard(reason)

    def restrict(self, restriction):
        self.restriction = restriction


class Bench:
    """A commander with a clock of its own, and a driver that only notes what it is told."""

    def __init__(self):
        self.now_s = 100.0
        self.driver = Noted()
        self.commander = Commander(self.driver, lambda: self.now_s)

    def run(self, seconds, linear=None, angular=0.0, *lateral):
        """Frames of the stream, with a command before each where there is one."""
        for _ in range(round(seconds / FRAME_S)):
            self.now_s += FRAME_S
            if linear is not None:
                self.commander.drive(linear, angular, *lateral)


@pytest.fixture
def bench():
    return Bench()


@pytest.mark.parametrize("before", ["boot", "command_timeout", "link_watchdog"])
def test_command_to_stand_ends_what_stopped_the_robot_before(bench, before):
    bench.driver.stop_reason = StopReason(before)
    bench.run(FRAME_S, 0.0)
    assert bench.commander.stopped_by == StopReason.NONE


def test_board_that_was_switched_on_is_no_stop_until_the_robot_has_driven(bench):
    """A board that restarts on the way is one."""
    bench.driver.stop_reason = StopReason.BOOT
    assert bench.commander.stopped_by == StopReason.NONE
    bench.run(FRAME_S, 0.2)
    bench.driver.command = None
    assert bench.commander.stopped_by == "boot"


@pytest.mark.parametrize("reason", ["link_lost", "restarted", "link_watchdog"])
def test_robot_that_the_driver_stopped_waits_for_a_new_command(bench, reason):
    """Though it was still speeding up, and its commands have not ended."""
    bench.run(0.2, 0.3)
    bench.driver.command, bench.driver.stop_reason = None, StopReason(reason)
    assert bench.commander.dropped
    bench.run(2 * FRAME_S)
    assert (bench.driver.command, bench.commander.dropped) == (None, True)
    bench.run(FRAME_S, 0.3)
    assert bench.driver.command and not bench.commander.dropped


@pytest.mark.parametrize("stops_before", [0, 1])
def test_emergency_stop_that_overtakes_a_command_is_why_the_robot_stands(bench, monkeypatch, stops_before):
    """The command was taken just before, and its call returns after the stop: no later release drops it again."""
    for _ in range(stops_before):
        bench.commander.stop()

    def drive(*speeds):
        bench.commander.latch()
        return True

    monkeypatch.setattr(bench.driver, "drive", drive)
    assert not bench.commander.drive(0.2, 0.0)
    assert (bench.commander.dropped, bench.commander.stopped_by) == (False, StopReason.EMERGENCY_STOP)


def test_command_that_is_held_back_while_telemetry_is_late_is_not_refused(bench, monkeypatch):
    drive = bench.driver.drive
    monkeypatch.setattr(bench.driver, "drive", lambda *speeds: not drive(*speeds))
    assert bench.commander.drive(0.2, 0.0)


@pytest.mark.parametrize("model, speed_m_s", [("traxbot", 0.15), ("stingbot", 0.25)])
def test_speed_of_manual_mode_is_half_the_robots_but_at_most_a_quarter_metre(model, speed_m_s):
    assert manual_speed_m_s(models.load(model).limits) == speed_m_s


def test_manual_mode_ends_the_drive_to_a_pose_which_is_no_safety_stop(bench):
    bench.run(0.2, 0.3)
    bench.commander.seeking = True
    bench.commander.set_manual(True)
    assert (bench.driver.stops, bench.commander.seeking) == (1, False)
    assert bench.commander.stopped_by == StopReason.MANUAL_MODE and bench.commander.ready


EACH_STOP = pytest.mark.parametrize(
    ("stop", "go_on"),
    [
        (Commander.latch, Commander.release),
        (lambda commander: commander.enable(False), lambda commander: commander.enable(True)),
        (Commander.stop, lambda commander: None),
    ],
    ids=["emergency", "motors", "stop"],
)
STOPS_THAT_STAY = pytest.mark.parametrize(
    "stop", [Commander.latch, lambda commander: commander.enable(False)]
)


@pytest.fixture
def driver(bench):
    return bench.driver


@pytest.fixture
def commander(bench):
    return bench.commander


@pytest.mark.parametrize("lost", [False, True])
@STOPS_THAT_STAY
def test_stop_that_stays_ends_the_drive_to_a_pose_even_when_the_link_is_gone(commander, driver, stop, lost):
    commander.seeking, driver.lost = True, lost
    try:
        stop(commander)
    except LinkLost:
        assert lost
    assert not commander.seeking and not commander.ready


def test_a_new_commander_lets_commands_pass_in_automatic_mode_without_zones(commander):
    assert (commander.stopped_by, commander.dropped, commander.ready) == ("none", False, True)
    assert commander.drive(0.1, 0.2, 0.3) and commander._driver.command == (0.1, 0.2, 0.3)
    assert not (commander.latched or commander.manual or commander.seeking) and commander.enabled
    assert (commander.zones, commander.late_commands, commander.manual_m_s) == (None, 0, 0.25)


def test_limits_are_the_drivers_until_they_are_set_and_are_back_after_manual_mode(commander, driver):
    assert commander.limits == commander.in_force == LIMITS
    commander.manual_m_s = 0.15
    commander.set_manual(True)
    assert (commander.limits, driver.limits) == (LIMITS, Limits(0.15, 0.5, 0.2, 1.0))
    commander.limits = LIMITS._replace(linear_m_s=0.2)
    assert commander.in_force == driver.limits == pytest.approx(Limits(0.15, 0.75, 0.2, 1.0))
    commander.set_manual(False)
    assert driver.limits == LIMITS._replace(linear_m_s=0.2)


@pytest.mark.parametrize(
    "go_on", [lambda commander: commander.set_manual(False), lambda commander: commander.enable(True)]
)
def test_neither_automatic_mode_nor_enabled_motors_stop_a_robot_or_end_its_drive(commander, driver, go_on):
    commander.drive(0.1, 0.0)
    commander.seeking = True
    go_on(commander)
    assert commander.seeking and driver.stops == 0 and driver.command is not None


@pytest.mark.parametrize(
    ("wanted", "linear_m_s"), [(0.2, 0.2), (0.3, 0.3), (0.4, 0.3), (0.0, 0.3), (-1.0, 0.3)]
)
def test_a_limit_is_lowered_to_what_is_wanted_if_that_is_positive(wanted, linear_m_s):
    assert lowered(LIMITS, wanted) == LIMITS._replace(linear_m_s=linear_m_s)


@EACH_STOP
def test_a_stop_takes_the_place_of_an_earlier_cause_and_drops_no_command(commander, driver, stop, go_on):
    commander.drive(0.1, 0.0)
    commander.stop(StopReason.COMMAND_TOO_LATE)
    assert commander.stopped_by == StopReason.COMMAND_TOO_LATE
    stop(commander)
    go_on(commander)
    driver.stop_reason = StopReason.USER
    assert (driver.command, commander.dropped, commander.stopped_by) == (None, False, StopReason.NONE)


@EACH_STOP
def test_a_command_was_not_dropped_even_if_the_link_is_lost_during_the_stop(commander, driver, stop, go_on):
    commander.drive(0.1, 0.0)
    driver.lost = True
    with pytest.raises(LinkLost):
        stop(commander)
    driver.command, driver.stop_reason = None, StopReason.LINK_LOST
    assert not commander.dropped


def test_emergency_stop_and_disabled_motors_end_apart(commander):
    commander.enable(False)
    commander.latch()
    assert commander.stopped_by == StopReason.EMERGENCY_STOP
    commander.release()
    assert (commander.latched, commander.stopped_by) == (False, StopReason.MOTORS_DISABLED)
    assert not commander.drive(0.1, 0.0)
    commander.latch()
    commander.enable(True)
    assert (commander.enabled, commander.stopped_by) == (True, StopReason.EMERGENCY_STOP)
    assert not commander.drive(0.1, 0.0)


@pytest.mark.parametrize(("silent_s", "dropped"), [(STALE_S - 0.001, False), (STALE_S, True)])
def test_a_command_that_has_timed_out_was_dropped_if_nobody_could_see_it(bench, silent_s, dropped):
    bench.now_s = 0.0
    bench.commander.drive(0.1, 0.0)
    bench.driver.command, bench.driver.stop_reason, bench.now_s = None, StopReason.COMMAND_TIMEOUT, silent_s
    assert bench.commander.dropped == dropped


# -- why the robot stands


MISMATCH = Mismatch("right", DEAD, 0.037, 0.0)
HELD = Hold("held", 1, 0, 0, 0x0013A20040A1B2C3)
CAUSES = [
    (StopReason.MAY_BE_MOVING, {"ready": False, "may_be_moving": True}),
    (StopReason.EMERGENCY_STOP, {}),
    (StopReason.MOTORS_DISABLED, {}),
    (StopReason.NO_TELEMETRY, {"ready": False}),
    (StopReason.BATTERY, {"battery_state": "empty"}),
    (StopReason.WHEEL_MISMATCH, {"mismatch": MISMATCH}),
    (StopReason.HELD, {"hold": HELD}),
    ("link_watchdog", {"stop_reason": StopReason.LINK_WATCHDOG}),
]
"""The causes in their order, and what the driver says then."""


def standing(commander, driver, places):
    """Let these of the causes be true at once."""
    commander.drive(0.1, 0.0)
    driver.command = None
    for place in sorted(places, reverse=True):
        cause, facts = CAUSES[place]
        vars(driver).update(facts)
        if cause == StopReason.EMERGENCY_STOP:
            commander.latch()
        elif cause == StopReason.MOTORS_DISABLED:
            commander.enable(False)


@pytest.mark.parametrize("place", range(len(CAUSES) - 1))
def test_of_several_causes_the_one_that_must_be_ended_first_is_named(commander, driver, place):
    standing(commander, driver, range(place, len(CAUSES)))
    assert commander.stopped_by == CAUSES[place][0]


@pytest.mark.parametrize("place", range(len(CAUSES)))
def test_the_next_command_moves_the_robot_unless_something_must_be_ended_before(commander, driver, place):
    standing(commander, driver, [place])
    assert commander.stopped_by == CAUSES[place][0]
    assert commander.ready == (CAUSES[place][0] == "link_watchdog")


@pytest.mark.parametrize(
    ("state", "holders", "held"), [("listening", 1, True), ("silent", 1, True), ("free", 0, False)]
)
def test_a_radio_holds_the_robot_in_each_of_its_states(commander, driver, state, holders, held):
    driver.radio.hold = HELD._replace(state=state, holders=holders)
    assert (commander.stopped_by == StopReason.HELD, commander.ready) == (held, not held)


def test_the_boards_emergency_stop_counts_until_it_is_released(commander, driver):
    driver.inputs, driver.release_emergency = Inputs(("emergency_stop",), True), lambda: False
    assert commander.stopped_by == StopReason.EMERGENCY_STOP and not commander.ready
    assert commander.refusal() == "emergency stop is pressed, or its wire is broken"
    assert not commander.release_input()


@pytest.mark.parametrize(("reason", "name"), [("bumper", "bumper_left"), ("cliff", "cliff_right")])
def test_a_side_that_was_hit_is_named_and_the_robot_stays_ready(commander, driver, reason, name):
    driver.inputs, driver.stop_reason = Inputs((name,)), StopReason(reason)
    commander.drive(0.1, 0.0)
    driver.command = None
    assert commander.stopped_by == reason and commander.ready
    assert "drive away from it" in commander.refusal()


@pytest.mark.parametrize(("command", "driving"), [(None, False), ((0.0, 0.0), False), ((0.0, 0.2), True)])
def test_a_command_in_force_has_no_reason_whatever_stopped_the_robot_before(
    commander, driver, command, driving
):
    driver.command, driver.stop_reason = command, StopReason.LINK_WATCHDOG
    assert commander.driving is driving
    assert commander.stopped_by == ("link_watchdog" if command is None else StopReason.NONE)


@pytest.mark.parametrize(
    "cause, told, stopped_by",
    [
        (StopReason.NONE, "user", StopReason.NONE),
        (StopReason.NONE, "not_a_number", "not_a_number"),
        (StopReason.NONE, "command_timeout", "command_timeout"),
        (StopReason.NOT_A_NUMBER, "user", StopReason.NOT_A_NUMBER),
        (StopReason.NOT_A_NUMBER, "link_watchdog", StopReason.NOT_A_NUMBER),
    ],
)
def test_own_cause_of_a_stop_comes_before_the_drivers(commander, driver, cause, told, stopped_by):
    commander.stop(cause)
    driver.stop_reason = StopReason(told)
    assert commander.stopped_by == stopped_by


@pytest.mark.parametrize(
    "facts, refusal",
    [
        ({"battery_state": "off", "battery_v": 9.04}, "the battery is off at 9.0 V, charge it"),
        (
            {"mismatch": MISMATCH},
            f"{MISMATCH}; once that is put right, a command of zero lets it drive again",
        ),
        ({"hold": HELD}, str(HELD)),
        ({"since_pause_s": 0.0}, module.PAUSED),
        ({"since_pause_s": QUEUED_S - 0.001}, module.PAUSED),
        (
            {"since_pause_s": QUEUED_S, "ready": False},
            "the board is silent or just restarting; send the command again when telemetry is back",
        ),
    ],
)
def test_a_refusal_says_why_and_what_to_do(commander, driver, facts, refusal):
    vars(driver).update(facts)
    assert commander.refusal() == refusal


@STOPS_THAT_STAY
def test_a_stop_that_stays_is_the_reason_named_whatever_else_is_wrong(commander, driver, stop):
    driver.link.since_pause_s, driver.mismatch = 0.0, MISMATCH
    stop(commander)
    assert commander.refusal() == module.REFUSALS[commander.stopped_by]


def test_a_board_that_has_stopped_for_a_wheel_is_named_and_the_wheel_is_a_fault(commander, driver):
    assert not commander.wheel_fault
    driver.mismatch = Mismatch("", "wheel_blocked")
    assert (commander.stopped_by, commander.wheel_fault, commander.ready) == ("wheel_blocked", True, False)


# -- zones


class Sharing:
    """Zones that allow a share of each speed."""

    def __init__(self, share):
        self.share, self.asked_s = share, None

    def limit(self, linear_m_s, now):
        self.asked_s = now
        return linear_m_s * self.share

    def limited(self, velocity_m_s, now):
        self.asked_s = now
        return velocity_m_s[0] * self.share, velocity_m_s[1] * self.share


@pytest.mark.parametrize(
    "share, speeds, allowed, cause",
    [
        (0.5, (0.2, 0.7), (0.1, 0.7), StopReason.NONE),
        (0.5, (0.2, 0.7, -0.4), (0.1, 0.7, -0.2), StopReason.NONE),
        (0.5, (0.2, 0.0, 0.0), (0.1, 0.0, 0.0), StopReason.NONE),
        (0.5, (0.0, 0.0, 0.2), (0.0, 0.0, 0.1), StopReason.NONE),
        (0.0, (-0.2, 0.7), (0.0, 0.7), StopReason.PROTECTIVE_ZONE),
        (0.0, (0.2, 0.0, 0.1), (0.0, 0.0, 0.0), StopReason.PROTECTIVE_ZONE),
        (0.0, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0), StopReason.PROTECTIVE_ZONE),
        (0.0, (0.0, 0.7), (0.0, 0.7), StopReason.NONE),
        (0.0, (0.0, 0.7, 0.0), (0.0, 0.7, 0.0), StopReason.NONE),
    ],
)
def test_zones_lower_the_speed_leave_the_turn_and_are_the_reason_if_nothing_is_left(
    commander, driver, share, speeds, allowed, cause
):
    zones = Sharing(share)
    commander.watch(zones)
    commander.drive(*speeds)
    assert driver.restriction(speeds, 7.0) == pytest.approx(allowed)
    assert (zones.asked_s, commander.stopped_by, commander.ready) == (7.0, cause, True)
    driver.command, driver.stop_reason = None, StopReason.COMMAND_TIMEOUT
    assert commander.stopped_by == StopReason.COMMAND_TIMEOUT


# -- one caller at a time


ENTERED_S = 0.1  # A call that need not wait is over long before


class Intruder:
    """Runs a call on another thread while the first one is inside, and notes whether it had to wait."""

    def __init__(self, call):
        self._call, self._thread = call, None
        self.waited = None

    def enter(self):
        if self._thread is None:
            self._thread = threading.Thread(target=self._call, daemon=True)
            self._thread.start()
            self._thread.join(ENTERED_S)
            self.waited = self._thread.is_alive()

    def end(self):
        self._thread.join()


class Slow(ZoneSettings):
    """Lets the intruder in while the zones are busy with a speed."""

    intruder = None

    def growth_m(self, speed_m_s):
        if Slow.intruder is not None:
            Slow.intruder.enter()
        return super().growth_m(speed_m_s)


@pytest.mark.parametrize(
    "call",
    [
        lambda zones: zones.on_scan(Scan((1.0,), 0.0, 0.1, 0.05, Pose(0.1, 0.0, 0.0)), 1.0),
        lambda zones: zones.on_range("front", 1.0, 1.0),
        lambda zones: zones.moved(0.1, 1.0),
        lambda zones: zones.limit(0.1, 1.0),
    ],
    ids=["on_scan", "on_range", "moved", "limit"],
)
def test_zones_serve_one_caller_at_a_time(monkeypatch, call):
    model = models.load("traxbot")
    zones = Zones(Slow(), model.body, model.sonars, laser=True)
    intruder = Intruder(lambda: call(zones))
    monkeypatch.setattr(Slow, "intruder", intruder)
    zones.limit(0.2, 1.0)
    intruder.end()
    assert intruder.waited


class Inhibited(Noted):
    """Lets the intruder in before it takes or drops a reason to refuse commands."""

    def inhibit(self, reason):
        self.intruder.enter()
        super().inhibit(reason)

    def allow(self, reason):
        self.intruder.enter()
        super().allow(reason)


@pytest.mark.parametrize(
    "first, second, refused",
    [
        (Commander.release, Commander.latch, StopReason.EMERGENCY_STOP),
        (Commander.latch, Commander.release, None),
        (lambda it: it.enable(True), lambda it: it.enable(False), StopReason.MOTORS_DISABLED),
        (lambda it: it.enable(False), lambda it: it.enable(True), None),
    ],
    ids=[
        "stop during release_stop",
        "release_stop during stop",
        "disable during enable",
        "enable during disable",
    ],
)
def test_what_the_commander_tells_is_what_the_driver_refuses_although_two_threads_change_it(
    first, second, refused
):
    """Otherwise the emergency stop shows as latched, and the robot drives."""
    driver = Inhibited()
    commander = Commander(driver)
    driver.intruder = Intruder(lambda: second(commander))
    first(commander)
    driver.intruder.end()
    assert driver.inhibited == ({refused} if refused else set())
    assert commander.stopped_by == (refused or StopReason.NONE)
