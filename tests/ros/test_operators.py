"""Which commands of operators arrive too late, by a clock of the test's own; what operators are told."""

from types import SimpleNamespace

import pytest
import rospy
from geometry_msgs.msg import Twist

from ros1_bridge.node import cmd_vel
from ros1_bridge.robot.operators import Operators

from .fake_topics import Topics

LIMIT_S = 1.0
MOST_OPERATORS, SILENT_S = 16, 60.0


class Clock:
    now_s = 1000.0

    def __call__(self):
        return self.now_s


def test_late_commands_are_refused_by_a_clock_that_differs():
    clock = Clock()
    operators = Operators(LIMIT_S, clock)
    assert not operators.refusal("desk", 77.0)
    clock.now_s += 1.0
    assert not operators.refusal("desk", 78.0 - LIMIT_S + 0.001)
    assert "late" in operators.refusal("desk", 78.0 - LIMIT_S - 0.002)
    assert operators.refused == 1
    assert not operators.refusal("sofa", 5.0), "each operator has a clock of his own"
    assert "stamp 0" in operators.refusal("desk", 0.0) and operators.refused == 2


def test_command_that_repeats_a_stamp_is_refused_after_the_limit():
    clock = Clock()
    operators = Operators(LIMIT_S, clock)
    assert not operators.refusal("desk", 900.0)
    clock.now_s += LIMIT_S + 0.01
    assert "late" in operators.refusal("desk", 900.0)


@pytest.fixture
def crowd():
    """A clock, and as many operators as have a place; each has just sent something."""
    clock = Clock()
    operators = Operators(LIMIT_S, clock)
    for n in range(MOST_OPERATORS):
        operators.late_s(str(n), 900.0)
    return clock, operators


def test_late_commands_stay_late_whoever_else_has_sent_something(crowd):
    _, operators = crowd
    for n in range(MOST_OPERATORS):
        operators.late_s(f"other {n}", 900.0)
    assert all("late" in operators.refusal(str(n), 5.0) for n in range(MOST_OPERATORS))


def test_new_operator_without_a_place_is_refused_until_one_has_been_silent_for_long(crowd):
    clock, operators = crowd
    assert "other operators" in operators.refusal("new", 900.0) and operators.refused == 1
    clock.now_s += SILENT_S - 0.001
    assert operators.refusal("new", 900.0)
    clock.now_s += 0.001
    assert not operators.refusal("new", 900.0)


def test_new_operator_takes_the_place_of_the_one_who_was_silent_for_longest(crowd):
    clock, operators = crowd
    clock.now_s += SILENT_S
    operators.late_s("0", 900.0 + SILENT_S)
    operators.late_s("new", 900.0)
    assert not operators.refusal("1", 5.0), "it is known no longer"
    assert "late" in operators.refusal("0", 5.0)


def test_name_of_an_operator_without_a_place_is_quoted_in_one_line(crowd):
    _, operators = crowd
    refusal = operators.refusal("\x1b[2J\n[ERROR] " * 100, 900.0)
    assert refusal.isprintable() and len(refusal) < 300


def test_without_a_limit_nothing_is_refused_and_nobody_needs_a_place():
    operators = Operators(0.0, Clock())
    operators.late_s("desk", 900.0)
    names = ["desk", *map(str, range(MOST_OPERATORS))]
    assert not any(operators.refusal(name, 5.0) for name in names)


@pytest.mark.parametrize("listens", [False, True])
def test_only_where_somebody_listens_a_missing_echo_is_said(listens, monkeypatch):
    """Nodes that start with the robot's may be there long before it."""
    said = []
    nobody = SimpleNamespace(name="cmd_vel/echo", get_num_connections=lambda: 0)
    stand_ins = {
        "Publisher": Topics(*["cmd_vel"] * listens),
        "Subscriber": lambda *args, **options: nobody,
        "get_name": lambda: "/desk",
        "resolve_name": str,
        "on_shutdown": lambda end: None,
        "is_shutdown": lambda: True,
        "logwarn": said.append,
    }
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(rospy, name, stand_in)
    monkeypatch.setattr(cmd_vel, "CONNECT_S", 0.0)
    cmd_vel.OperatorCmdVel().drive(Twist(), 0.0)
    assert ["nobody publishes cmd_vel/echo" in each for each in said] == [True] * listens
