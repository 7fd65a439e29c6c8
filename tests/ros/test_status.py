"""What the status says, and when it is told."""

import math
from types import SimpleNamespace

import pytest

from mrl_driver.robot import imu
from mrl_driver.robot.imu import FROZEN, IN_USE, LEARNING, REASONS, WAITING
from ros1_bridge.control.commander import (
    ADRIFT,
    BATTERY,
    DISABLED,
    EMERGENCY,
    HELD,
    LATE,
    LINK,
    NONE,
    NOT_FINITE,
    TIMEOUT,
    TO_MANUAL,
    WHEEL,
    ZONE,
)
from ros1_bridge.status.link_report import ERROR, OK, WARN
from ros1_bridge.status.robot_status import (
    StatusTeller,
    battery_health,
    battery_values,
    board_values,
    imu_health,
    imu_values,
)


class Told(list):
    """A teller's messages; `tell` tells a state, `topics` has all that was published on topics of single values."""

    def __init__(self):
        super().__init__()
        self.commander = SimpleNamespace(
            driving=False,
            wheels_turn=False,
            stopped_by=NONE,
            seeking=False,
            zones=None,
            manual=False,
            linked=True,
            wheel_fault=False,
        )
        self.topics = []
        self._teller = StatusTeller(self.commander, self._publish, "/robot_node", "port robot 1")

    def _publish(self, message, values):
        self.append(message)
        self.topics += values.items()

    def tell(self, **state):
        vars(self.commander).update(state)
        self._teller.tell()


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


def test_operation_mode_is_told():
    told = Told()
    for manual in (False, True):
        told.tell(manual=manual)
    assert [values_of(message)["operation mode"] for message in told] == ["automatic", "manual"]


def test_nothing_is_published_of_zones_that_nobody_watches():
    told = Told()
    told.tell()
    assert not [topic for topic, _ in told.topics if "field" in topic]
    told.tell(zones=SimpleNamespace(outer_clear=False, warning_clear=False, protective_clear=True))
    fields = "warning_field_clear", "outer_warning_field_clear", "protective_field_clear"
    assert told.topics[-3:] == [*zip(fields, (False, False, True))]


def test_no_zone_is_clear_without_telemetry():
    told = Told()
    told.tell(zones=SimpleNamespace(outer_clear=True, warning_clear=True, protective_clear=True))
    assert [value for topic, value in told.topics if "field" in topic] == [True] * 3
    told.tell(linked=False)
    assert [value for topic, value in told.topics if "field" in topic][3:] == [False] * 3


def test_a_robot_of_which_nobody_knows_whether_it_moves_counts_as_moving():
    """Once it has been known; a board without motors never says."""
    told = Told()
    told.tell(wheels_turn=None)
    assert "moving" not in dict(told.topics) and values_of(told[0])["moving"] == "unknown"
    told.tell(wheels_turn=False)
    told.tell(wheels_turn=None, stopped_by=ADRIFT)
    assert [value for topic, value in told.topics if topic == "moving"] == [False, True]


def test_what_is_not_measured_is_no_fault():
    assert battery_health("ok", math.nan).level == OK
    assert battery_values(math.nan, "ok", 2.6)["Voltage"] == "not measured"
    assert board_values(None, math.nan)["Motor Board Temperature"] == "not measured"


def test_each_status_is_a_message_of_its_own():
    """A latched one may be on its way to a new subscriber."""
    told = Told()
    told.tell(wheels_turn=True)
    told.tell(wheels_turn=False, stopped_by=TIMEOUT)
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
    told.tell(stopped_by=cause)
    values = {pair.key: pair.value for pair in told[0].values}
    assert (told[0].level, values["mode"], values["ready"], values["stopped by"]) == (
        level,
        mode,
        ready,
        cause,
    )


def test_a_wheel_for_which_the_board_has_stopped_the_robot_is_a_mode_of_its_own():
    told = Told()
    told.tell(stopped_by="wheel blocked", wheel_fault=True)
    values = values_of(told[0])
    assert (values["mode"], values["ready"], values["stopped by"]) == (
        "wheel mismatch",
        "false",
        "wheel blocked",
    )


def values_of(message):
    return {pair.key: pair.value for pair in message.values}


def test_zones_are_told_where_there_are_some():
    told = Told()
    told.tell()
    told.tell(zones=SimpleNamespace(outer_clear=False, warning_clear=False, protective_clear=True))
    keys = "outer warning zone clear", "warning zone clear", "protective zone clear"
    assert [[values_of(each)[key] for key in keys] for each in told] == [
        ["not watched"] * 3,
        ["false", "false", "true"],
    ]


@pytest.mark.parametrize("cause", [NONE, "user", DISABLED, TO_MANUAL, "closed", TIMEOUT])
def test_end_of_ordinary_driving_is_no_safety_stop(cause):
    told = Told()
    told.tell(stopped_by=cause)
    assert values_of(told[0])["safety stop"] == "false"


@pytest.mark.parametrize(
    "cause",
    [EMERGENCY, ZONE, LINK, ADRIFT, BATTERY, HELD, WHEEL, LATE, NOT_FINITE, "host paused", "link watchdog"],
)
def test_safety_stop_is_a_violated_safety_function(cause):
    told = Told()
    told.tell(stopped_by=cause)
    assert values_of(told[0])["safety stop"] == "true"


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
    told = imu_health(state)
    assert told.level == level and words in told.message


@pytest.mark.parametrize(
    "known, bias",
    [
        (True, "0.03000 rad/s, standard deviation 0.00100 rad/s"),
        (False, "not known yet"),
    ],
)
def test_bias_is_told_once_it_is_known(known, bias):
    reading = SimpleNamespace(
        bias_rad_s=0.03,
        bias_sd_rad_s=0.001,
        bias_known=known,
        yaw_variance_rad2=0.0001,
        angular_velocity_rad_s=(0.0, 0.0, 0.5),
    )
    told = imu_values(IN_USE, reading)
    assert told["Gyro Bias"] == bias
    assert (told["Yaw Rate"], told["Yaw Standard Deviation"]) == ("0.4700 rad/s", "0.0100 rad")
