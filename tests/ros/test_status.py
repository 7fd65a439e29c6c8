"""What the status says, and when it is told."""

import math
from types import SimpleNamespace

import pytest

from ros1_bridge.control.commander import BATTERY, EMERGENCY, NONE, TIMEOUT, ZONE
from ros1_bridge.status.link_report import ERROR, OK, WARN
from ros1_bridge.status.robot_status import StatusTeller, battery_health, battery_values, board_values


class Told(list):
    """A teller's messages; `tell` tells a state."""

    def __init__(self):
        super().__init__()
        self.commander = self._commander = SimpleNamespace(
            moving=False, stopped_by=NONE, seeking=False, zones=None
        )
        self._teller = StatusTeller(self._commander, self.append, "/robot_node", "port robot 1")

    def tell(self, moving, stopped_by):
        self._commander.moving, self._commander.stopped_by = moving, stopped_by
        self._teller.tell()


def test_state_is_told_once():
    told = Told()
    for moving in (False, False, True, True, False):
        told.tell(moving, NONE)
    assert [message.message for message in told] == ["ready", "moving", "ready"]


def test_what_is_not_measured_is_no_fault():
    assert battery_health("ok", math.nan).level == OK
    assert battery_values(math.nan, "ok", 2.6)["Voltage"] == "not measured"
    assert board_values(None, math.nan)["Motor Board Temperature"] == "not measured"


def test_each_status_is_a_message_of_its_own():
    """A latched one may be on its way to a new subscriber."""
    told = Told()
    told.tell(True, NONE)
    told.tell(False, TIMEOUT)
    assert {pair.key: pair.value for pair in told[0].values}["moving"] == "true"


@pytest.mark.parametrize(
    "cause, level, mode, ready",
    [
        (NONE, OK, "drive", "true"),
        (TIMEOUT, OK, "drive", "true"),
        (EMERGENCY, WARN, "emergency stop", "false"),
        (BATTERY, ERROR, "battery", "false"),
        ("wheel blocked", ERROR, "drive", "true"),
        ("encoder", ERROR, "drive", "true"),
        ("undervoltage", ERROR, "drive", "true"),
    ],
)
def test_status_says_what_keeps_the_robot_from_moving(cause, level, mode, ready):
    told = Told()
    told.tell(False, cause)
    values = {pair.key: pair.value for pair in told[0].values}
    assert (told[0].level, values["mode"], values["ready"], values["stopped by"]) == (
        level,
        mode,
        ready,
        cause,
    )


def values_of(message):
    return {pair.key: pair.value for pair in message.values}


def test_zones_are_told_where_there_are_some():
    told = Told()
    told.tell(False, NONE)
    told.commander.zones = SimpleNamespace(warning_clear=False, protective_clear=True)
    told.tell(False, NONE)
    keys = "warning zone clear", "protective zone clear"
    assert [[values_of(each)[key] for key in keys] for each in told] == [
        ["not watched"] * 2,
        ["false", "true"],
    ]


@pytest.mark.parametrize(
    "cause, safety", [(NONE, "false"), ("user", "false"), (TIMEOUT, "true"), (ZONE, "true")]
)
def test_safety_stop_is_a_stop_that_the_user_did_not_ask_for(cause, safety):
    told = Told()
    told.tell(False, cause)
    assert values_of(told[0])["safety stop"] == safety
