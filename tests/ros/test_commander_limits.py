"""The commander in each state of the driver: why the robot stands, what it may do next, and what zones hold."""

import math

import pytest

from mrl_driver.driver.options import QUEUED_S
from mrl_driver.errors import LinkLost
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.models import Limits
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.session import STALE_S
from ros1_bridge.control import commander as module
from ros1_bridge.control.commander import Commander, lowered

from .test_commander import LIMITS, Noted

NOW_S = 100.0
HELD = Hold("held", 1, 0, 0, 0x0013A20040A1B2C3)
MISMATCH = Mismatch("right", DEAD, 0.037, 0.0)


class Driver(Noted):
    """As `Noted`, with limits that are asked for between two commands."""

    restriction = None

    def restrict(self, restriction):
        self.restriction = restriction


@pytest.fixture
def driver():
    return Driver()


@pytest.fixture
def commander(driver):
    return Commander(driver, lambda: NOW_S)


# -- at the start


def test_a_new_commander_lets_commands_pass_in_automatic_mode_without_zones(commander):
    assert commander.drive(0.1, 0.0)
    assert (commander.latched, commander.enabled, commander.manual, commander.seeking) == (
        False, True, False, False
    )  # fmt: skip
    assert (commander.zones, commander.late_commands, commander.manual_m_s) == (None, 0, 0.25)


def test_a_robot_that_nobody_has_driven_stands_for_no_reason(commander):
    assert (commander.stopped_by, commander.dropped, commander.ready) == ("none", False, True)


def test_a_command_to_the_side_is_passed_on(commander, driver):
    commander.drive(0.1, 0.2, 0.3)
    assert driver.command == (0.1, 0.2, 0.3)


@pytest.mark.parametrize("ready", [True, False])
def test_the_link_is_the_drivers(commander, driver, ready):
    driver.ready = ready
    assert commander.linked is ready


def test_wheels_of_a_robot_whose_board_was_lost_while_it_drove_are_unknown(commander, driver):
    driver.ready, driver.may_be_moving = False, True
    assert commander.wheels_turn is None
    driver.may_be_moving = False
    assert commander.wheels_turn is False


# -- limits and modes


def test_limits_are_the_drivers_until_they_are_set(commander, driver):
    assert commander.limits == commander.in_force == LIMITS
    commander.limits = LIMITS._replace(linear_m_s=0.2)
    assert commander.limits == commander.in_force == driver.limits == LIMITS._replace(linear_m_s=0.2)


def test_limits_that_were_never_set_are_back_after_manual_mode(commander, driver):
    commander.manual_m_s = 0.15
    commander.set_manual(True)
    assert (commander.limits, driver.limits) == (LIMITS, Limits(0.15, 0.5, 0.2, 1.0))
    assert commander.in_force == driver.limits
    commander.set_manual(False)
    assert driver.limits == LIMITS


@pytest.mark.parametrize("before", [True, False])
@pytest.mark.parametrize("after", [True, False])
def test_a_mode_says_whether_it_is_another_one(commander, before, after):
    commander.set_manual(before)
    assert commander.set_manual(after) == (before != after)
    assert commander.manual == after


def test_automatic_mode_does_not_end_the_drive_to_a_pose(commander, driver):
    commander.drive(0.1, 0.0)
    commander.seeking = True
    commander.set_manual(False)
    assert commander.seeking and driver.stops == 0


@pytest.mark.parametrize(
    ("wanted", "linear_m_s"), [(0.2, 0.2), (0.3, 0.3), (0.4, 0.3), (0.0, 0.3), (-1.0, 0.3)]
)
def test_a_limit_is_lowered_to_what_is_wanted_if_that_is_positive(wanted, linear_m_s):
    assert lowered(LIMITS, wanted) == LIMITS._replace(linear_m_s=linear_m_s)


# -- stops


def test_a_stop_has_its_cause_until_the_next_command(commander):
    commander.drive(0.1, 0.0)
    commander.stop(module.LATE)
    assert commander.stopped_by == module.LATE
    commander.drive(0.1, 0.0)
    commander.stop()
    assert commander.stopped_by == module.NONE


EACH_STOP = pytest.mark.parametrize(
    ("stop", "go_on"),
    [
        (Commander.latch, Commander.release),
        (lambda commander: commander.enable(False), lambda commander: commander.enable(True)),
        (Commander.stop, lambda commander: None),
    ],
    ids=["emergency", "motors", "stop"],
)
"""Stops of the commander itself, and what ends them."""


@EACH_STOP
def test_a_command_that_the_commander_has_stopped_was_not_dropped(commander, driver, stop, go_on):
    commander.drive(0.1, 0.0)
    stop(commander)
    go_on(commander)
    driver.stop_reason = "user"
    assert (driver.command, commander.dropped) == (None, False)


@EACH_STOP
def test_a_stop_takes_the_place_of_an_earlier_cause(commander, stop, go_on):
    commander.stop(module.LATE)
    stop(commander)
    go_on(commander)
    assert commander.stopped_by == module.NONE


@EACH_STOP
def test_a_command_was_not_dropped_even_if_the_link_is_lost_during_the_stop(commander, driver, stop, go_on):
    commander.drive(0.1, 0.0)
    driver.lost = True
    with pytest.raises(LinkLost):
        stop(commander)
    driver.command, driver.stop_reason = None, "link_lost"
    assert not commander.dropped


def test_the_end_of_an_emergency_stop_leaves_disabled_motors_disabled(commander, driver):
    commander.enable(False)
    commander.latch()
    commander.release()
    assert (commander.latched, commander.stopped_by) == (False, module.DISABLED)
    assert not commander.drive(0.1, 0.0)


def test_enabled_motors_leave_an_emergency_stop_latched(commander, driver):
    commander.latch()
    commander.enable(False)
    commander.enable(True)
    assert (commander.enabled, commander.stopped_by) == (True, module.EMERGENCY)
    assert not commander.drive(0.1, 0.0)


def test_enabled_motors_do_not_stop_the_robot_or_end_its_drive_to_a_pose(commander, driver):
    commander.drive(0.1, 0.0)
    commander.seeking = True
    commander.enable(True)
    assert commander.seeking and driver.stops == 0 and driver.command is not None


@pytest.mark.parametrize(("silent_s", "dropped"), [(STALE_S - 0.001, False), (STALE_S, True)])
def test_a_command_that_has_timed_out_was_dropped_if_nobody_could_see_it(driver, silent_s, dropped):
    now_s = [0.0]
    commander = Commander(driver, lambda: now_s[0])
    commander.drive(0.1, 0.0)
    driver.command, driver.stop_reason, now_s[0] = None, "command_timeout", silent_s
    assert commander.dropped == dropped


def test_a_command_in_force_or_a_refused_one_was_not_dropped(commander, driver):
    driver.stop_reason = "restarted"
    commander.drive(0.1, 0.0)
    assert not commander.dropped
    driver.command, driver.ready = None, False
    commander.drive(0.1, 0.0)
    assert not commander.dropped


# -- why the robot stands


CAUSES = [
    (module.ADRIFT, {"ready": False, "may_be_moving": True}),
    (module.EMERGENCY, {}),
    (module.DISABLED, {}),
    (module.LINK, {"ready": False}),
    (module.BATTERY, {"battery_state": "empty"}),
    (module.WHEEL, {"mismatch": MISMATCH}),
    (module.HELD, {"hold": HELD}),
    ("link watchdog", {"stop_reason": "link_watchdog"}),
]
"""The causes in their order, and what the driver says then."""


def standing(commander, driver, places):
    """Let these of the causes be true at once."""
    commander.drive(0.1, 0.0)
    driver.command = None
    for place in sorted(places, reverse=True):
        cause, facts = CAUSES[place]
        vars(driver).update(facts)
        if cause == module.EMERGENCY:
            commander.latch()
        elif cause == module.DISABLED:
            commander.enable(False)


@pytest.mark.parametrize("place", range(len(CAUSES)))
def test_each_cause_is_named_alone(commander, driver, place):
    standing(commander, driver, [place])
    assert commander.stopped_by == CAUSES[place][0]


@pytest.mark.parametrize("place", range(len(CAUSES) - 1))
def test_of_several_causes_the_one_that_must_be_ended_first_is_named(commander, driver, place):
    standing(commander, driver, range(place, len(CAUSES)))
    assert commander.stopped_by == CAUSES[place][0]


@pytest.mark.parametrize("place", range(len(CAUSES)))
def test_the_next_command_moves_the_robot_unless_something_must_be_ended_before(commander, driver, place):
    standing(commander, driver, [place])
    assert commander.ready == (CAUSES[place][0] == "link watchdog")


@pytest.mark.parametrize(("state", "named"), [("off", True), ("empty", True), ("low", False), ("ok", False)])
def test_a_battery_stops_the_robot_when_it_is_empty_or_off(commander, driver, state, named):
    driver.battery_state = state
    assert (commander.stopped_by == module.BATTERY) == named


def test_a_board_that_has_stopped_for_a_wheel_is_named_and_the_wheel_is_a_fault(commander, driver):
    assert not commander.wheel_fault
    driver.mismatch = Mismatch("", "wheel_blocked")
    assert (commander.stopped_by, commander.wheel_fault, commander.ready) == ("wheel blocked", True, False)


def test_a_wheel_that_was_the_reason_waits_behind_an_emergency_stop(commander, driver):
    driver.mismatch = MISMATCH
    commander.latch()
    assert commander.stopped_by == module.EMERGENCY
    assert commander.refusal() == module.REFUSALS[module.EMERGENCY]


def test_a_command_in_force_has_no_reason_whatever_stopped_the_robot_before(commander, driver):
    commander.drive(0.1, 0.0)
    driver.stop_reason = "link_watchdog"
    assert commander.stopped_by == module.NONE


def test_a_robot_that_the_board_has_stopped_before_any_command_is_stopped_for_that(commander, driver):
    """Only the start of the board is no reason."""
    driver.stop_reason = "link_watchdog"
    assert commander.stopped_by == "link watchdog"


@pytest.mark.parametrize(
    ("told", "named"), [("not_a_number", "command not finite"), ("command_timeout", "command timeout")]
)
def test_the_drivers_reason_is_named_in_words(commander, driver, told, named):
    driver.stop_reason = told
    assert commander.stopped_by == named


# -- refusals


def test_a_refusal_for_the_battery_has_its_state_and_voltage(commander, driver):
    driver.battery_state, driver.battery_v = "off", 9.04
    assert commander.refusal() == "the battery is off at 9.0 V, charge it"


def test_a_refusal_for_a_wheel_says_how_to_go_on(commander, driver):
    driver.mismatch = MISMATCH
    assert commander.refusal() == (
        f"{MISMATCH}; once that is put right, a command of zero lets it drive again"
    )


@pytest.mark.parametrize(("since_s", "paused"), [(0.0, True), (QUEUED_S - 0.001, True), (QUEUED_S, False)])
def test_a_refusal_after_a_pause_says_so_while_commands_may_have_waited(commander, driver, since_s, paused):
    driver.since_pause_s = since_s
    assert (commander.refusal() == module.PAUSED) == paused


def test_a_refusal_for_another_reason_says_that_the_board_is_silent(commander, driver):
    driver.ready = False
    assert commander.refusal() == (
        "the board is silent or just restarting; send the command again when telemetry is back"
    )


def test_a_pause_is_not_named_while_the_motors_are_disabled(commander, driver):
    driver.since_pause_s = 0.0
    commander.enable(False)
    assert commander.refusal() == module.REFUSALS[module.DISABLED]


# -- zones


class Halving:
    """Zones that allow half of each speed, or nothing."""

    def __init__(self, share=0.5):
        self.share, self.asked_s = share, None

    def limit(self, linear_m_s, now):
        self.asked_s = now
        return linear_m_s * self.share

    def limited(self, velocity_m_s, now):
        self.asked_s = now
        return velocity_m_s[0] * self.share, velocity_m_s[1] * self.share


def within(commander, driver, share, *speeds):
    """Return what the driver may do of these speeds, while a command is in force."""
    zones = Halving(share)
    commander.watch(zones)
    assert commander.zones is zones
    commander.drive(*speeds)
    allowed = driver.restriction(speeds, 7.0)
    assert zones.asked_s == 7.0
    return allowed


def test_zones_lower_the_speed_and_leave_the_turn(commander, driver):
    assert within(commander, driver, 0.5, 0.2, 0.7) == (0.1, 0.7)
    assert commander.stopped_by == module.NONE


def test_zones_lower_the_speed_to_the_side_as_well(commander, driver):
    assert within(commander, driver, 0.5, 0.2, 0.7, -0.4) == (0.1, 0.7, -0.2)
    assert commander.stopped_by == module.NONE


@pytest.mark.parametrize(
    "speeds", [(0.2, 0.0), (-0.2, 0.7), (0.2, 0.0, 0.1), (0.0, 0.0, 0.1), (0.2, 0.7, 0.0)]
)
def test_zones_that_allow_nothing_are_the_reason(commander, driver, speeds):
    within(commander, driver, 0.0, *speeds)
    assert commander.stopped_by == module.ZONE and commander.ready


@pytest.mark.parametrize("speeds", [(0.0, 0.0), (0.0, 0.7), (0.0, 0.7, 0.0)])
def test_zones_are_no_reason_for_a_robot_that_was_not_to_leave_its_place(commander, driver, speeds):
    within(commander, driver, 0.0, *speeds)
    assert commander.stopped_by == module.NONE


@pytest.mark.parametrize("speeds", [(0.2, 0.0, 0.0), (0.0, 0.0, 0.2)])
def test_a_robot_that_may_go_one_way_is_not_held(commander, driver, speeds):
    assert math.hypot(*within(commander, driver, 0.5, *speeds)) == pytest.approx(0.1)
    assert commander.stopped_by == module.NONE


def test_zones_that_have_held_the_robot_are_no_reason_once_its_command_has_ended(commander, driver):
    within(commander, driver, 0.0, 0.2, 0.0)
    driver.command, driver.stop_reason = None, "command_timeout"
    assert commander.stopped_by == module.TIMEOUT
