"""What the status says, and when it is told."""

from types import SimpleNamespace

import pytest

from ros1_bridge.commander import BATTERY, EMERGENCY, NONE, TIMEOUT
from ros1_bridge.link_report import ERROR, OK, WARN
from ros1_bridge.robot_status import StatusTeller


class Told(list):
    """A teller's messages; `tell` tells a state."""

    def __init__(self):
        super().__init__()
        self._commander = SimpleNamespace(moving=False, stopped_by=NONE)
        self._teller = StatusTeller(self._commander, self.append, "/robot_node", "port robot 1")

    def tell(self, moving, stopped_by):
        self._commander.moving, self._commander.stopped_by = moving, stopped_by
        self._teller.tell()


def test_state_is_told_once():
    told = Told()
    for moving in (False, False, True, True, False):
        told.tell(moving, NONE)
    assert [message.message for message in told] == ["ready", "moving", "ready"]


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
