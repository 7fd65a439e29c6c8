"""What pages may say, and how our messages look."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.apps.web import messages
from mrl_driver.apps.web.helm import Control, Goal, Helm
from mrl_driver.apps.web.messages import Malformed, parse
from mrl_driver.apps.web.robot import PhoneReading
from mrl_driver.robot.models import load

CONTROL = {
    "type": "control",
    "seq": 3,
    "t": 2500.5,
    "heard": 1000,
    "heard_t": 2000,
    "press": 1,
    "held": False,
}
SPEEDS = {**CONTROL, "held": True, "linear": 0.2, "angular": -1, "lateral": 0}
GOAL = {**CONTROL, "held": True, "goal": [1, 2.5]}
PHONE = {
    "type": "phone",
    "t": 40,
    "alpha": 10,
    "beta": None,
    "gamma": -3,
    "absolute": False,
    "acceleration": [0, 0, 9.8],
    "rotation": None,
}


def read(**fields):
    return parse(json.dumps(fields)).value


def test_control_with_speeds():
    assert read(**SPEEDS) == Control(3, 2.5005, 1.0, 2.0, 1, True, 0.2, -1.0, 0.0)


@pytest.mark.parametrize("goal, read_as", [([1, 2.5], Goal(1.0, 2.5)), ([1, 2, -3], Goal(1.0, 2.0, -3.0))])
def test_control_with_a_goal(goal, read_as):
    assert read(**{**GOAL, "goal": goal}).goal == read_as


WRONG = [
    ({**SPEEDS, "goal": [1, 2]}, "control has a field 'linear', expected"),
    ({**SPEEDS, "linear": "0.2"}, "control: linear is '0.2', expected a number from -100 to 100"),
    ({**SPEEDS, "linear": True}, "control: linear is True, expected a number"),
    ({**SPEEDS, "angular": 1e300}, "control: angular is 1e+300, expected a number"),
    ({**SPEEDS, "angular": 10**400}, "control: angular is 10"),
    ({**CONTROL, "linear": 0.2}, "control has a field 'linear', expected"),
    ({**CONTROL, "seq": 1.5}, "control: seq is 1.5, expected a whole number"),
    ({**CONTROL, "seq": -1}, "control: seq is -1, expected a whole number"),
    ({**CONTROL, "held": 1}, "control: held is 1, expected true or false"),
    ({**CONTROL, "t": None}, "control: t is None, expected a number"),
    ({**GOAL, "goal": [1]}, "control: goal is [1], expected a list of 2 or 3"),
    ({**GOAL, "goal": [1, 2e4]}, "control: goal is 20000.0, expected a number"),
    ({**GOAL, "goal": [1, 2, 101]}, "control: goal is [1, 2, 101], expected a yaw of at most 100 rad"),
    ({"type": "control"}, "control has no seq, expected"),
    ({"type": "take", "off": 1}, "take has a field 'off', expected none"),
    ({"type": "drive"}, "type is 'drive', expected one of hello, control"),
    ({"type": ["take"]}, "type is ['take'], expected one of"),
    ({}, "type is None, expected one of"),
    ({"type": "hello", "token": "", "name": "x" * 41}, "expected at most 40 printable characters"),
    ({"type": "hello", "token": "", "name": "a\nb"}, "expected at most 40 printable characters"),
    ({**PHONE, "alpha": 361}, "phone: alpha is 361, expected a number from -360 to 360"),
    ({**PHONE, "rotation": [1, 2]}, "phone: rotation is [1, 2], expected a list of 3"),
]
"""Fields of a message, and what its refusal says."""
NO_MESSAGES = [
    "",
    "{",
    "[]",
    "7",
    "null",
    '"stop"',
    b"\xff\xfe",
    "[" * 4000,
    '{"type":"record","on":NaN}',
    '{"type":"ping","t":Infinity,"heard":null,"heard_t":null}',
    '{"type":"ping","t":1e999,"heard":null,"heard_t":null}',
    '{"type":"take","type":"stop"}',
    '{"type":"take"} {"type":"take"}',
    '{"type":"take"}' + " " * 4096,
    '{"type":"hello","token":"\\ud800","name":""}',
    "\ud800",
    '{"type":"control","seq":' + "9" * 4000 + "}",
]


def refusal(text):
    """Why a message is refused; None if it is not."""
    try:
        parse(text)
    except Malformed as error:
        return str(error)
    return None


def test_what_is_wrong_is_named_in_one_line():
    for fields, why in WRONG:
        said = refusal(json.dumps(fields))
        assert said is not None and why in said and "\n" not in said and len(said) < 200, (fields, said)


def test_what_is_no_message_is_refused():
    assert [text for text in NO_MESSAGES if refusal(text) is None] == []


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=4,
)


@given(st.sampled_from([SPEEDS, GOAL, PHONE, CONTROL]), st.data())
def test_no_field_can_be_anything_that_moves_a_robot_wrongly(fields, data):
    """Either it is refused, or all numbers are finite and in range."""
    name = data.draw(st.sampled_from([*fields, "goal", "linear"]))
    try:
        found = read(**{**fields, name: data.draw(JSON)})
    except Malformed:
        return
    assert isinstance(found, (Control, PhoneReading))
    if isinstance(found, Control):
        speeds = found.linear_m_s, found.angular_rad_s, found.lateral_m_s
        assert all(abs(speed) <= 100 for speed in speeds) and isinstance(found.held, bool)
        assert found.goal is None or (
            speeds == (0, 0, 0) and all(abs(part) <= 1e4 for part in found.goal[:2])
        )


@given(st.binary(max_size=200))
def test_any_bytes_are_refused_in_one_line(data):
    said = refusal(data)
    assert said is not None and "\n" not in said


# -- ours


def test_numbers_that_json_lacks():
    text = messages.sample(1.0, [1 / 3, math.nan, math.inf, -math.inf])
    assert json.loads(text)["v"] == [0.333333, None, "inf", "-inf"]


def test_helm():
    helm = Helm()
    helm.join(4, True, 1.0)
    helm.take(4, 1.0)
    helm.stop(4, 1.0)
    found = json.loads(messages.helm(1.0, helm.state(), {4: "Zoë"}))
    assert (found["driver"], found["latched_by"], found["latched_by_name"]) == (4, 4, "Zoë")
    assert (found["names"], found["spent"], found["age_ms"], found["viewers"]) == (
        {"4": "Zoë"},
        {"4": -1},
        None,
        1,
    )


def test_facts_of_a_robot():
    model = load("traxbot")
    facts = messages.robot_facts("traxbot 1", model, model.limits)
    assert facts["drive"] == "differential"
    assert facts["limits"]["linear"] == model.limits.linear_m_s
    assert facts["sonars"]["left"] == pytest.approx([*model.sonars["left"].pose, math.radians(36)])
