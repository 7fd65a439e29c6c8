"""A board of 2013 that is cut off while it drives: status, diagnostics and log say that it may still be moving."""

from types import SimpleNamespace

import pytest

from mrl_driver.errors import BoardTimeout
from mrl_driver.robot import models
from mrl_driver.session.events import MAY_MOVE, WAITS, Stale
from ros1_bridge.control import commander as module
from ros1_bridge.robot.services import Services
from ros1_bridge.status import robot_status
from ros1_bridge.status.link_report import ERROR, News
from ros1_bridge.status.robot_status import StatusTeller


def cut_off(may_be_moving):
    """A commander whose driver has lost a board."""
    return module.Commander(lost(may_be_moving))


def lost(may_be_moving):
    def inhibit(_):
        if may_be_moving:
            raise BoardTimeout(f"no telemetry arrives: {MAY_MOVE}")

    return SimpleNamespace(
        ready=False,
        may_be_moving=may_be_moving,
        command=None,
        stop_reason="stale",
        mismatch=None,
        inhibit=inhibit,
    )


def values_of(commander):
    told = []
    StatusTeller(commander, lambda status, _: told.append(status), "/robot_node", "port robot 1").tell()
    return told[0], {pair.key: pair.value for pair in told[0].values}


def test_status_does_not_know_whether_it_moves():
    message, values = values_of(cut_off(True))
    assert (message.level, message.message) == (ERROR, f"no telemetry; {MAY_MOVE}")
    assert (values["moving"], values["mode"], values["ready"]) == ("unknown", "no link", "false")


def test_status_of_a_board_that_stops_by_itself_says_that_it_stands():
    message, values = values_of(cut_off(False))
    assert (message.message, values["moving"]) == ("stopped by no telemetry", "false")


def test_diagnostics_do_not_know_whether_it_moves():
    commander = cut_off(True)
    commander.limits = models.load("traxbot").limits
    assert robot_status.motion_values(commander)["Moving"] == "unknown"


def test_commander_of_a_robot_that_may_be_moving_is_not_ready():
    assert not cut_off(True).ready


def test_diagnostics_say_it_too():
    assert robot_status.motion_health(False, module.ADRIFT).message == f"no telemetry; {MAY_MOVE}"


@pytest.mark.parametrize("latched", [True, False])
def test_emergency_stop_does_not_hide_it(latched):
    commander = cut_off(True)
    commander.latched = latched
    assert commander.stopped_by == module.ADRIFT


@pytest.mark.parametrize("may_move, words", [(True, MAY_MOVE), (False, WAITS)])
def test_log_says_what_the_robot_may_do(may_move, words):
    told = News().of(Stale(0.3, may_move))
    assert told.level == ERROR and told.message.endswith(words)


@pytest.mark.parametrize("may_move", [True, False])
def test_services_that_stop_do_not_claim_to_have_stopped_it(may_move):
    driver = lost(may_move)
    services = Services(driver, module.Commander(driver))
    for done, text in (services.stop(), services.enable_motors(False)):
        assert (done, MAY_MOVE in text) == (not may_move, may_move)
