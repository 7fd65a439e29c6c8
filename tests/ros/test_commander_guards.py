"""What keeps the zones' state whole: one caller at a time; and each cause of a standstill that the commander tells."""

import threading
from types import SimpleNamespace

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from mrl_driver.robot.hold import Hold
from mrl_driver.safety.protective_zones import Scan, Zones, ZoneSettings
from ros1_bridge.control import commander as module
from ros1_bridge.control.commander import Commander

ENTERED_S = 0.1
"""A call that need not wait is over long before."""


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


class Driver:
    """Does as it is told."""

    def __init__(self):
        self.command, self.ready, self.battery_state, self.mismatch = None, True, "ok", None
        self.hold = None
        self.stop_reason = "none"

    def inhibit(self, reason):
        self.command = None

    def stop(self):
        self.command = None


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


class Inhibited(Driver):
    """Refuses commands for each of its reasons, and lets the intruder in before it takes or drops one."""

    def __init__(self):
        super().__init__()
        self.inhibited, self.intruder, self.may_be_moving = set(), None, False

    def inhibit(self, reason):
        self.intruder.enter()
        self.inhibited.add(reason)

    def allow(self, reason):
        self.intruder.enter()
        self.inhibited.discard(reason)


@pytest.mark.parametrize(
    "first, second, refused",
    [
        (Commander.release, Commander.latch, module.EMERGENCY),
        (Commander.latch, Commander.release, None),
        (lambda it: it.enable(True), lambda it: it.enable(False), module.DISABLED),
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
    assert commander.stopped_by == (refused or module.NONE)


@pytest.mark.parametrize(
    "command, driving", [(None, False), ((0.0, 0.0), False), ((0.1, 0.0), True), ((0.0, 0.2), True)]
)
def test_robot_drives_while_a_command_other_than_standstill_is_in_force(command, driving):
    commander = Commander(SimpleNamespace(command=command))
    assert commander.driving is driving


def test_disabled_motors_are_named_as_the_cause():
    commander = Commander(Driver())
    commander.enable(False)
    assert commander.stopped_by == module.DISABLED and "enable_motors" in commander.refusal()


def test_emergency_stop_comes_before_disabled_motors():
    commander = Commander(Driver())
    commander.enable(False)
    commander.latch()
    assert commander.stopped_by == module.EMERGENCY


@pytest.mark.parametrize(
    "cause, told, stopped_by",
    [
        (module.NONE, "none", module.NONE),
        (module.NONE, "user", module.NONE),
        (module.NONE, "link_watchdog", "link watchdog"),
        (module.NOT_FINITE, "user", module.NOT_FINITE),
        (module.NOT_FINITE, "link_watchdog", module.NOT_FINITE),
    ],
)
def test_own_cause_of_a_stop_comes_before_the_drivers(cause, told, stopped_by):
    driver = Driver()
    commander = Commander(driver)
    commander.stop(cause)
    driver.stop_reason = told
    assert commander.stopped_by == stopped_by


def held(state="held"):
    return Hold(state, 1, 0, 0, 0x0013A20040A1B2C3)


@pytest.mark.parametrize("state", ["listening", "held", "silent"])
def test_hold_by_radio_is_named_as_the_cause(state):
    commander = Commander(Driver())
    commander._driver.hold = held(state)
    assert commander.stopped_by == module.HELD and not commander.ready
    assert commander.refusal() == str(held(state))


@pytest.mark.parametrize("state", ["off", "free"])
def test_robot_that_nobody_holds_is_ready(state):
    commander = Commander(Driver())
    commander._driver.hold = held(state)._replace(holders=0)
    assert commander.ready
