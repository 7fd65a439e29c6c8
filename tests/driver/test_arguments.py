"""Each public call with arguments that it cannot use, and with numbers of all kinds."""

import inspect
import math
import re
from decimal import Decimal
from fractions import Fraction
from operator import attrgetter

import numpy as np
import pytest

from mrl_driver.driver import Driver, Options, Status
from mrl_driver.driver.driver_recorder import DriverRecorder
from mrl_driver.driver.radio import Radio
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.servos import Servos
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.covariance import AT_START
from tests.radio_board import PEER, Engine, RadioBoard

MOVE_MOTORS, READ_CONFIG = BY_NAME["move_motors"].code, BY_NAME["read_config"].code
STEP_S = 0.02


class Unshown:
    """A value that not even its error can show."""

    def __repr__(self):
        raise RuntimeError("no representation")


def without(values, *names):
    return {name: value for name, value in values.items() if name not in names}


NO_VALUE = {
    "None": None,
    "list": [0.1],
    "dictionary": {},
    "unshown": Unshown(),
    "array": np.array([0.1, 0.2]),
    "truth value": True,
    "truth value of numpy": np.bool_(True),
    "complex": 1j,
}
NO_NUMBER = {
    **NO_VALUE,
    "text": "0.1",
    "bytes": b"1",
    "nan": math.nan,
    "nan of numpy": np.float32("nan"),
    "decimal nan": Decimal("NaN"),
    "signalling nan": Decimal("sNaN"),
    "beyond floats": 10**400,
    "beyond digits": 10**5000,
    "fraction beyond floats": Fraction(10**400, 3),
}
INFINITE = {"infinity": math.inf, "minus infinity": -math.inf, "decimal infinity": Decimal("Infinity")}
NO_SPEED = {**NO_NUMBER, **INFINITE}
FAR = {**NO_SPEED, "far away": 1.001e8}
NO_WHOLE = {**NO_SPEED, "half": 0.5}
NO_LIMIT = {**NO_NUMBER, "minus infinity": -math.inf, "zero": 0.0, "negative": -0.1}
NO_TIME = {name: value for name, value in NO_NUMBER.items() if value is not None}
NO_TEXT = {**NO_VALUE, "number": 5, "empty": ""}
NO_FLAG = {**without(NO_VALUE, "truth value"), "number": 1}
NO_FUNCTION = {**NO_VALUE, "number": 5, "text": "print"}
LIMITS = ("linear_m_s", "angular_rad_s", "linear_acceleration_m_s2", "angular_acceleration_rad_s2")


def set_limit(name):
    return lambda driver, bad: setattr(driver, "limits", driver.limits._replace(**{name: bad}))


CALLS = {
    "drive": {
        "linear_m_s": (lambda driver, bad: driver.drive(bad, 0.1), NO_SPEED),
        "angular_rad_s": (lambda driver, bad: driver.drive(0.1, bad), NO_SPEED),
        "lateral_m_s": (lambda driver, bad: driver.drive(0.1, 0.1, bad), NO_SPEED),
    },
    "limits": {
        "limits": (lambda driver, bad: setattr(driver, "limits", bad), NO_TEXT),
        **{name: (set_limit(name), NO_LIMIT) for name in LIMITS},
        "lateral_m_s": (set_limit("lateral_m_s"), without(NO_LIMIT, "zero")),
    },
    "restrict": {"allowed": (lambda driver, bad: driver.restrict(bad), without(NO_FUNCTION, "None"))},
    "request": {
        "code": (lambda driver, bad: driver.request(bad), NO_WHOLE),
        "argument 1": (lambda driver, bad: driver.request(MOVE_MOTORS, bad, 20), NO_WHOLE),
        "argument 2": (lambda driver, bad: driver.request(MOVE_MOTORS, 20, bad), NO_WHOLE),
        "command": (lambda driver, bad: driver.request(bad), {"unknown": 999, "zero": 0}),
        "motor_1": (lambda driver, bad: driver.request(MOVE_MOTORS, bad, 20), {"beyond": 20_000}),
    },
    "ask": {
        "code": (lambda driver, bad: driver.ask(bad), NO_WHOLE),
        "argument 1": (lambda driver, bad: driver.ask(READ_CONFIG, bad), NO_WHOLE),
        "timeout_s": (lambda driver, bad: driver.ask(READ_CONFIG, 1, timeout_s=bad), NO_TIME),
    },
    "inhibit": {"reason": (lambda driver, bad: driver.inhibit(bad), NO_TEXT)},
    "allow": {"reason": (lambda driver, bad: driver.allow(bad), NO_TEXT)},
    "radio.discover": {"duration_s": (lambda driver, bad: driver.radio.discover(bad), NO_SPEED)},
    "limited": {
        "linear_m_s": (lambda driver, bad: driver.limited(bad, 0.1), NO_SPEED),
        "angular_rad_s": (lambda driver, bad: driver.limited(0.1, bad), NO_SPEED),
        "lateral_m_s": (lambda driver, bad: driver.limited(0.1, 0.1, bad), NO_SPEED),
    },
    "recorder.note_clock": {"ahead_s": (lambda driver, bad: driver.recorder.note_clock(bad), NO_SPEED)},
    "pause": {"seconds": (lambda driver, bad: driver.pause(bad), {**NO_SPEED, "negative": -1})},
    "recorder.remark": {"remark": (lambda driver, bad: driver.recorder.remark(bad), NO_TEXT)},
    "reset_pose": {
        "pose": (lambda driver, bad: driver.reset_pose(bad), NO_TEXT),
        "x_m": (lambda driver, bad: driver.reset_pose((bad, 0.0, 0.0)), FAR),
        "y_m": (lambda driver, bad: driver.reset_pose((0.0, bad, 0.0)), FAR),
        "yaw_rad": (lambda driver, bad: driver.reset_pose((0.0, 0.0, bad)), NO_SPEED),
        "covariance": (lambda driver, bad: driver.reset_pose((0.0, 0.0, 0.0), bad), NO_TEXT),
        "xx of the covariance": (
            lambda driver, bad: driver.reset_pose((0.0, 0.0, 0.0), (bad, *AT_START[1:])),
            NO_SPEED,
        ),
    },
    "radio.send": {
        "address": (lambda driver, bad: driver.radio.send(bad, "x"), {**NO_WHOLE, "negative": -1}),
        "text": (lambda driver, bad: driver.radio.send(PEER, bad), NO_TEXT),
    },
    "servos.move": {
        "name": (lambda driver, bad: driver.servos.move(bad, 0.1), {**NO_VALUE, "unknown": "pan"}),
    },
    "on": {
        "kind": (lambda driver, bad: driver.on(bad, print), NO_TEXT),
        "callback": (lambda driver, bad: driver.on(Status, bad), NO_FUNCTION),
    },
    "recorder.start": {"path": (lambda driver, bad: driver.recorder.start(bad), NO_TEXT)},
    "wait": {"timeout_s": (lambda driver, bad: driver.wait(bad), NO_TIME)},
    **{
        name: {"callback": (lambda driver, bad, name=name: attrgetter(name)(driver)(bad), NO_FUNCTION)}
        for name in (*("on_event", "on_telemetry", "radio.on_text"),)
    },
}
"""By method and argument, the call with a value, and the values that it cannot use."""
RECORDED = {
    name: {argument: (lambda driver, bad, name=name: getattr(driver, name)(bad), NO_FUNCTION)}
    for name, argument in (
        *(("on_heard", "callback"), ("on_remark", "callback"), ("on_sent", "callback"), ("play", "advance")),
    )
}
WITHOUT_ARGUMENTS = {
    *(
        "connect",
        "close",
        "stop",
        "limit_again",
        "radio.release_hold",
        "release_emergency",
        "radio.require",
        "recorder.stop",
    ),
}


def rows(calls):
    """A call, the name that its error must have, and the values that it cannot use."""
    return [
        pytest.param(call, name, values, id=f"{method}-{name}".replace(" ", "-"))
        for method, arguments in calls.items()
        for name, (call, values) in arguments.items()
    ]


@pytest.fixture(scope="module")
def connected():
    with SteppedDriver(Engine(RadioBoard()), "traxbot", options=Options(command_timeout_s=None)) as driver:
        yield driver


@pytest.fixture
def robot(connected):
    """A robot that stands, with its own limits."""
    limits = connected.limits
    yield connected
    connected.restrict(None)
    connected.limits = limits
    connected.stop()
    connected.wait(STEP_S)


def refusals(call, robot, values):
    """For each value its name, the error, and why the robot was stopped; the driver goes on."""
    for what, value in values.items():
        assert robot.drive(0.1, 0.0), what
        with pytest.raises(MrlError) as refused:
            call(robot, value)
        assert "\n" not in str(refused.value), what
        yield what, str(refused.value), robot.stop_reason if robot.command is None else ""
        robot.wait(STEP_S)
        assert robot.error is None, what


@pytest.mark.parametrize("call, name, values", rows(CALLS))
def test_a_call_stops_the_robot_if_it_cannot_use_an_argument(robot, call, name, values):
    for what, told, stopped_by in refusals(call, robot, values):
        assert name in told and stopped_by == "not_a_number", what
        assert re.search(r", expected .*; the robot was stopped$", told), what


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    file = str(tmp_path_factory.mktemp("recorded") / "drive.mrl")
    with SteppedDriver(Engine(RadioBoard()), options=Options(record=file)):
        return RecordedDriver(file)


@pytest.mark.parametrize("call, name, values", rows(RECORDED))
def test_a_recording_names_a_function_that_is_none(recorded, call, name, values):
    for value in values.values():
        with pytest.raises(ConfigError, match=f"^{name} is .*, expected a function"):
            call(recorded, value)


@pytest.mark.parametrize(
    "speeds, words",
    [
        *((speeds, "") for speeds in (None, (), (0.1,), 0.1)),
        ("ab", "^linear of the "),
        ((0.1, math.nan), "^angular of the "),
        ((0.1, None), "^angular of the "),
    ],
    ids=repr,
)
def test_a_restriction_that_returns_no_speeds_stops_the_robot_but_not_the_driver(robot, speeds, words):
    assert robot.drive(0.1, 0.0)
    robot.restrict(lambda wanted, now: speeds)
    robot.wait(2 * STEP_S)
    assert (robot.command, robot.stop_reason, robot.error) == (None, "not_a_number", None)
    with pytest.raises(MrlError, match=f"{words}speed that restrict allows .*the robot was stopped"):
        robot.drive(0.1, 0.0)


ALIKE = [Decimal("0.125"), Fraction(1, 8), np.float16(0.125), np.float32(0.125), np.longdouble(0.125)]


@pytest.mark.parametrize(
    "number", [*ALIKE, 1, np.int8(1), np.uint64(1)], ids=lambda number: type(number).__name__
)
def test_numbers_of_all_kinds_are_speeds_limits_and_times(robot, number):
    robot.limits = robot.limits._replace(linear_m_s=number, angular_rad_s=number)
    assert all(type(limit) is float for limit in robot.limits) and robot.limits.linear_m_s == number
    assert robot.drive(number, number) and robot.command == (number, number)
    assert not robot.wait(number)
    robot.reset_pose((number, number, number))
    assert robot.pose == (number, number, number)


def option(name):
    return lambda _, bad: Driver("/nowhere", options=Options(**{name: bad}))


OPTIONS = {
    **dict.fromkeys(("period_ms", "watchdog_ms", "imu_period_ms", "line_baud"), NO_WHOLE),
    "robot_id": without(NO_WHOLE, "None"),
    **dict.fromkeys(("greeting_s", "port_timeout_s", "queued_s"), NO_SPEED),
    "command_timeout_s": without(NO_SPEED, "None"),
    **dict.fromkeys(("check", "ignore_battery", "any_id", "identify", "reconnect", "fast"), NO_FLAG),
    "virtual": without(NO_FLAG, "None"),
    "build": without(NO_TEXT, "empty"),
    "record": without(NO_TEXT, "None"),
    "tap": without(NO_FUNCTION, "None"),
}
NEW = {
    "Driver": {
        name: (lambda _, bad, name=name: Driver(**{"port": "/nowhere", name: bad}), NO_VALUE)
        for name in ("port", "robot", "baud", "options")
    },
    "SteppedDriver": {"stepped": (lambda _, bad: SteppedDriver(bad), NO_VALUE)},
    "Options": {name: (option(name), values) for name, values in OPTIONS.items()},
}


@pytest.mark.parametrize("call, name, values", rows(NEW))
def test_an_argument_of_a_new_driver_that_cannot_be_used_is_named(call, name, values):
    for what, value in values.items():
        with pytest.raises(ConfigError) as refused:
            call(None, value)
        assert re.match(f"{name} is .*, expected", str(refused.value)), what


def test_the_tables_have_all_options():
    assert {*OPTIONS} == {*Options._fields}


PLACES = {
    "": (Driver, SteppedDriver, RecordedDriver),
    "radio.": (Radio,),
    "recorder.": (DriverRecorder,),
    "servos.": (Servos,),
}


def test_the_tables_have_all_calls_with_arguments():
    public = {
        place + name
        for place, kinds in PLACES.items()
        for kind in kinds
        for name, member in inspect.getmembers(kind)
        if not name.startswith("_") and (callable(member) or getattr(member, "fset", None))
    }
    assert public == {*CALLS, *RECORDED, *WITHOUT_ARGUMENTS}
    assert sum(not name.startswith("_") for name in dir(Driver("/nowhere"))) <= 45, "a user can learn these"
