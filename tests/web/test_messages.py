"""What pages may say, how our messages look, and the age of a page's messages without a common clock."""

import json
import math
import time
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.apps.web import messages
from mrl_driver.apps.web.helm import DEAF_S, WINDOW_S, Control, Freshness, Goal, Helm
from mrl_driver.apps.web.messages import Malformed, parse
from mrl_driver.apps.web.robot import PhoneReading
from mrl_driver.clocks import clock_s
from mrl_driver.robot.models import load
from mrl_driver.safety.operator_delay import DRIFT

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
    (
        {**SPEEDS, "goal": [1, 2]},
        "control: ['angular', 'lateral', 'linear'] missing or unknown, expected the fields seq",
    ),
    ({**SPEEDS, "linear": "0.2"}, "control: linear is '0.2', expected a number from -100 to 100"),
    ({**SPEEDS, "linear": True}, "control: linear is True, expected a number"),
    ({**SPEEDS, "angular": 1e300}, "control: angular is 1e+300, expected a number"),
    ({**SPEEDS, "angular": 10**400}, "control: angular is 10"),
    ({**CONTROL, "linear": 0.2}, "control: ['linear'] missing or unknown, expected the fields seq"),
    ({**CONTROL, "seq": 1.5}, "control: seq is 1.5, expected a whole number"),
    ({**CONTROL, "seq": -1}, "control: seq is -1, expected a whole number"),
    ({**CONTROL, "held": 1}, "control: held is 1, expected true or false"),
    ({**CONTROL, "t": None}, "control: t is None, expected a number"),
    ({**GOAL, "goal": [1]}, "control: goal is [1], expected a list of 2 or 3"),
    ({**GOAL, "goal": [1, 2e4]}, "control: goal is 20000.0, expected a number"),
    ({**GOAL, "goal": [1, 2, 101]}, "control: goal is [1, 2, 101], expected a yaw of at most 100 rad"),
    ({"type": "control"}, "control: ['heard', 'heard_t', 'held', 'press', 'seq', 't'] missing or unknown"),
    ({"type": "take", "off": 1}, "take: ['off'] missing or unknown, expected the fields none"),
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
    assert (found["names"], found["spent"]) == ({"4": "Zoë"}, {"4": -1})


def test_facts_of_a_robot():
    model = load("traxbot")
    facts = messages.robot_facts("traxbot 1", model, model.limits)
    assert facts["drive"] == "differential"
    assert facts["limits"]["linear"] == model.limits.linear_m_s
    assert facts["sonars"]["left"] == pytest.approx([*model.sonars["left"].pose, math.radians(36)])


AHEAD_S = -1234.5  # The page's clock is this far ahead of the server's


def age_s(freshness, sent_s, heard_s, heard_at_s, now_s, ahead_s=AHEAD_S):
    """All times are the server's."""
    return freshness.age_s(sent_s + ahead_s, heard_s, heard_at_s + ahead_s, now_s)


def test_the_age_is_the_way_there_and_the_shortest_way_back():
    assert age_s(Freshness(), sent_s=10.05, heard_s=10.0, heard_at_s=10.02, now_s=10.08) == pytest.approx(
        0.03 + 0.02, abs=1e-3
    )


def test_it_is_forgotten_after_ten_seconds():
    freshness = Freshness()
    age_s(freshness, 10.0, 9.9, 9.901, 10.0)
    assert age_s(freshness, 20.0, 19.8, 19.9, 20.0) == pytest.approx(0.1, abs=1e-3)
    assert WINDOW_S == 10.0


@pytest.mark.parametrize("heard_s, heard_t_s", [(None, None), (9, None), (None, 9), (10.01, 10), (9, 11)])
def test_a_page_that_has_heard_nothing_until_now_has_no_age(heard_s, heard_t_s):
    assert Freshness().age_s(10.0, heard_s, heard_t_s, 10.0) == math.inf


def test_a_page_that_has_heard_nothing_for_two_seconds_has_no_age():
    freshness = Freshness()
    assert age_s(freshness, 12.0, 10.0, 10.0, 12.0) < 0.01
    assert age_s(freshness, 12.1, 10.0, 10.0, 12.1) == math.inf
    assert DEAF_S == 2.0


def test_a_clock_that_jumps_forward_makes_no_message_younger_for_long():
    """Once it shows, all that was known before is forgotten."""
    freshness = Freshness()
    age_s(freshness, 10.0, 9.99, 9.99, 10.0)
    assert age_s(freshness, 10.1, 10.0, 10.0, 10.1, AHEAD_S + 1.0) == math.inf
    assert age_s(freshness, 10.2, 10.11, 10.11, 10.3, AHEAD_S + 1.0) == pytest.approx(0.1, abs=1e-3)


def test_a_clock_that_stood_still_is_a_late_message_until_something_is_heard():
    freshness = Freshness()
    age_s(freshness, 10.0, 9.99, 9.99, 10.0)
    assert freshness.age_s(10.5 + AHEAD_S, 10.0, 10.0 + AHEAD_S, 11.0) == pytest.approx(0.5, abs=0.01)
    assert age_s(freshness, 11.1, 11.05, 11.05, 11.1, AHEAD_S - 0.5) < 0.01


@pytest.mark.parametrize("early_s, expected_s", [(0.019, 0.0), (0.021, math.inf)])
def test_a_clock_that_is_20_ms_coarse_still_has_an_age(early_s, expected_s):
    assert age_s(Freshness(), 10.0, 9.99, 9.99 - early_s, 10.0) == expected_s


def test_the_clock_goes_on_while_the_computer_is_suspended(monkeypatch):
    """Or a burst of commands from before would look fresh."""
    clocks = []
    monkeypatch.setattr(time, "clock_gettime", lambda clock: clocks.append(clock) or 7.0)
    assert clock_s() == 7.0 and clocks == [time.CLOCK_BOOTTIME]


WAY_S = st.floats(0.0, 0.4)
STEPS = st.lists(st.tuples(st.floats(0.0, 1.0), WAY_S, WAY_S, st.floats(0.0, 0.1)), min_size=1, max_size=30)


@given(STEPS, st.floats(-1e6, 1e6), st.floats(-DRIFT, DRIFT))
def test_no_message_is_older_than_its_age_says(steps, ahead_s, drift):
    """Whatever the two clocks are set to, with the largest drift between them."""
    freshness, start_s = Freshness(), 1000.0

    def page_s(time_s):
        return time_s + ahead_s + drift * (time_s - start_s)

    now_s = start_s
    for wait_s, down_s, up_s, hold_s in steps:
        made_s = now_s + wait_s
        sent_s = made_s + down_s + hold_s
        now_s = sent_s + up_s
        said_s = freshness.age_s(page_s(sent_s), made_s, page_s(made_s + down_s), now_s)
        assert said_s >= up_s * (1 - 2 * DRIFT) - 1e-6


def test_many_echoes_take_no_memory():
    """A page that echoes worse and worse times, as fast as it can."""
    freshness = Freshness()
    tracemalloc.start()
    for step in range(20000):
        time_s = 10.0 + step * 1e-4
        freshness.age_s(time_s, time_s, time_s - 1 + step * 1e-6, 12.0)
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert taken < 100_000
