"""A board of 2013 that is cut off while it drives: status, diagnostics and log say that it may still be moving."""

from types import SimpleNamespace

import pytest

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot import models
from mrl_driver.session.events import MAY_MOVE, WAITS, Stale
from ros1_bridge.control import commander as module
from ros1_bridge.robot.services import Services
from ros1_bridge.status import robot_status
from ros1_bridge.status.link_report import ERROR, News
from ros1_bridge.status.robot_status import StatusTeller

from .rig import values_of


def lost(may_be_moving):
    def inhibit(_):
        if may_be_moving:
            raise BoardTimeout(f"no telemetry arrives: {MAY_MOVE}")

    return SimpleNamespace(
        ready=False,
        may_be_moving=may_be_moving,
        command=None,
        stop_reason=StopReason.NO_TELEMETRY,
        mismatch=None,
        inhibit=inhibit,
    )


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


@pytest.mark.parametrize(
    "may_move, words, moving",
    [(True, f"no telemetry; {MAY_MOVE}", "unknown"), (False, "stopped by no telemetry", "false")],
)
def test_status_and_diagnostics_say_whether_it_may_be_moving(may_move, words, moving):
    commander, told = module.Commander(lost(may_move)), []
    commander.limits = models.load("traxbot").limits
    StatusTeller(commander, lambda status, _: told.append(status), "/robot_node", "port robot 1").tell()
    values = values_of(told[0])
    assert (told[0].message, values["moving"]) == (words, moving)
    assert (values["mode"], values["ready"]) == ("may_be_moving" if may_move else "no_telemetry", "false")
    assert robot_status.motion_report(commander).values["Moving"].lower() == moving or not may_move
