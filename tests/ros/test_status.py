"""What the status says, and when it is told."""

import math
from types import SimpleNamespace

import pytest

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot import imu, models
from mrl_driver.robot.imu import FROZEN, IN_USE, LEARNING, REASONS, WAITING
from mrl_driver.robot.inputs import Inputs
from mrl_driver.session.events import MAY_MOVE, WAITS, Stale
from ros1_bridge.control import commander as module
from ros1_bridge.robot.services import Services
from ros1_bridge.status import robot_status
from ros1_bridge.status.link_report import ERROR, OK, WARN, News
from ros1_bridge.status.robot_status import (
    StatusTeller,
    battery_report,
    board_report,
    imu_report,
    inputs_report,
)

from .rig import values_of


class Told(list):
    """A teller's messages; `tell` tells a state, `topics` has all that was published on topics of single values."""

    def __init__(self):
        super().__init__()
        off = dict.fromkeys(("driving", "wheels_turn", "seeking", "manual", "wheel_fault"), False)
        self.commander = SimpleNamespace(stopped_by=StopReason.NONE, zones=None, linked=True, **off)
        self.topics = []
        self._teller = StatusTeller(self.commander, self._publish, "/robot_node", "port robot 1")

    def _publish(self, message, values, fields):
        self.append(message)
        self.fields = fields
        self.topics += values.items()

    def tell(self, **state):
        vars(self.commander).update(state)
        self._teller.tell()


def test_what_is_not_measured_is_no_fault():
    battery = battery_report("ok", math.nan, 2.6)
    assert (battery.level, battery.values["Voltage"]) == (OK, "not measured")
    assert board_report(None, math.nan).values["Motor Board Temperature"] == "not measured"


def test_state_is_told_once():
    told = Told()
    for driving in (False, False, True, True, False):
        told.tell(driving=driving)
    assert [message.message for message in told] == ["ready", "driving", "ready"]


def test_a_value_is_published_at_first_and_when_it_changes():
    told = Told()
    for state in ({}, {"driving": True}, {"wheels_turn": True}, {"seeking": True}):
        told.tell(**state)
    begin = [("mode", "drive"), ("moving", False), ("safety_stop", False)]
    assert told.topics == [*begin, ("moving", True), ("mode", "pose")]


def test_a_robot_of_which_nobody_knows_whether_it_moves_counts_as_moving():
    """Once it has been known; a board without motors never says."""
    told = Told()
    told.tell(wheels_turn=None)
    assert "moving" not in dict(told.topics) and values_of(told[0])["moving"] == "unknown"
    told.tell(wheels_turn=False)
    told.tell(wheels_turn=None, stopped_by=StopReason.MAY_BE_MOVING)
    assert [value for topic, value in told.topics if topic == "moving"] == [False, True]


@pytest.mark.parametrize(
    "state, level, words",
    [
        (IN_USE, OK, "gyro and wheels"),
        (LEARNING, OK, "the wheels alone: the gyro's bias is learned"),
        (WAITING, OK, "the wheels alone: the IMU is waiting"),
        (imu.OFF, WARN, "the wheels alone: the IMU is off"),
        (FROZEN, WARN, REASONS[FROZEN]),
    ],
)
def test_source_of_the_heading_is_told(state, level, words):
    told = imu_report(state, None)
    assert told.level == level and words in told.message


@pytest.mark.parametrize(
    "known, bias", [(True, "0.03000 rad/s, standard deviation 0.00100 rad/s"), (False, "not known yet")]
)
def test_bias_is_told_once_it_is_known(known, bias):
    told = {"bias_rad_s": 0.03, "bias_sd_rad_s": 0.001, "bias_known": known, "yaw_variance_rad2": 0.0001}
    reading = SimpleNamespace(angular_velocity_rad_s=(0.0, 0.0, 0.5), **told)
    told = imu_report(IN_USE, reading).values
    assert told["Gyro Bias"] == bias
    assert (told["Yaw Rate"], told["Yaw Standard Deviation"]) == ("0.4700 rad/s", "0.0100 rad")


@pytest.mark.parametrize(
    ("inputs", "level", "words"),
    [
        (Inputs((), False, ("cliff_left",)), OK, "no input is active"),
        (
            Inputs(("cliff_left",), False, ("cliff_left",)),
            WARN,
            "cliff left sees no floor; drive away from it",
        ),
        (
            Inputs((), True, ("emergency_stop",)),
            ERROR,
            "the emergency stop was pressed: look whether all is well",
        ),
    ],
)
def test_inputs_that_stop_the_robot_are_told_with_what_they_are_not(inputs, level, words):
    told = inputs_report(inputs)
    assert told.level == level and told.message.startswith(words)
    assert "not a safety device" in told.values["note"]


HARMLESS = [
    "none",
    "user",
    "motors_disabled",
    "manual_mode",
    "closed",
    "command_timeout",
    "commands_unpaused",
]


@pytest.mark.parametrize("reason", StopReason)
def test_safety_stop_is_a_violated_safety_function(reason):
    """The end of ordinary driving is none."""
    told = Told()
    told.tell(stopped_by=reason)
    assert values_of(told[0])["safety stop"] == ("false" if reason in HARMLESS else "true")


@pytest.mark.parametrize(
    "state, level, values",
    [
        ({"manual": True}, OK, {"operation mode": "manual"}),
        (
            {"stopped_by": StopReason.COMMAND_TIMEOUT},
            OK,
            {"mode": "drive", "ready": "true", "stopped by": StopReason.COMMAND_TIMEOUT},
        ),
        ({"stopped_by": StopReason.EMERGENCY_STOP}, WARN, {"mode": "emergency_stop", "ready": "false"}),
        ({"stopped_by": StopReason.BATTERY}, ERROR, {"mode": "battery", "ready": "false"}),
        ({"stopped_by": StopReason.ENCODER}, ERROR, {"mode": "drive", "ready": "true"}),
        ({"stopped_by": StopReason.UNDERVOLTAGE}, ERROR, {"mode": "drive", "ready": "true"}),
        (
            {"stopped_by": StopReason.WHEEL_BLOCKED, "wheel_fault": True},
            ERROR,
            {"mode": "wheel_mismatch", "ready": "false", "stopped by": "wheel_blocked"},
        ),
    ],
)
def test_status_says_what_keeps_the_robot_from_moving(state, level, values):
    told = Told()
    told.tell()
    assert (told[0].level, values_of(told[0])["operation mode"]) == (OK, "automatic")
    told.tell(**state)
    assert told[1].level == level and values.items() <= values_of(told[1]).items()
    assert values_of(told[0])["stopped by"] == StopReason.NONE, (
        "a latched message may be on its way to a new subscriber"
    )


def test_zones_are_told_where_there_are_some_and_none_is_clear_without_telemetry():
    told = Told()
    told.tell()
    assert not [topic for topic, _ in told.topics if "field" in topic]
    for linked in (True, False):
        told.tell(
            zones=SimpleNamespace(outer_clear=False, warning_clear=False, protective_clear=True),
            linked=linked,
        )
    keys = "outer warning zone clear", "warning zone clear", "protective zone clear"
    assert [[values_of(each)[key] for key in keys] for each in told] == [
        ["not watched"] * 3,
        ["false", "false", "true"],
        ["false", "false", "false"],
    ]
    fields = "warning_field_clear", "outer_warning_field_clear", "protective_field_clear"
    shown = [pair for pair in told.topics if "field" in pair[0]]
    assert shown == [*zip(fields, (False, False, True)), ("protective_field_clear", False)]


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
        inputs=None,
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
    StatusTeller(commander, lambda status, *_: told.append(status), "/robot_node", "port robot 1").tell()
    values = values_of(told[0])
    assert (told[0].message, values["moving"]) == (words, moving)
    assert (values["mode"], values["ready"]) == ("may_be_moving" if may_move else "no_telemetry", "false")
    assert robot_status.motion_report(commander).values["Moving"].lower() == moving or not may_move
