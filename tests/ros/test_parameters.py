"""The node's parameters: what is refused, and how the refusal reads."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits
from ros1_bridge.navigation.follow_waypoints_node import LIST, PARAMETERS
from ros1_bridge.node.parameters import read
from ros1_bridge.node.robot_parameters import GROUPS, PARTS, ROWS, Parameters, check
from ros1_bridge.robot import reconfigure

GOOD = {"port": "/dev/ttyACM0"}


def test_only_the_port_must_be_given():
    defaults = {row.name: row.default for row in ROWS if row.name != "port"}
    assert check(GOOD, "/n") == Parameters(port="/dev/ttyACM0", **defaults)
    left = {group: {"kp": 700} for group in GROUPS}  # by dynamic_reconfigure
    given = {**GOOD, **left, "port": "tcp://10.0.0.7:3333", "cmd_vel_timeout": 1}
    assert check(given, "/n").port == "tcp://10.0.0.7:3333"


@pytest.mark.parametrize(
    "name, value",
    [
        ("port", 7),
        ("port", ""),
        ("build", "gas"),
        ("baud", "fast"),
        ("baud", True),
        ("baud", 1),
        ("robot", " "),
        ("odom_frame", "/odom"),
        ("odom_frame", "my odom"),
        ("publish_tf", "true"),
        ("cmd_vel_timeout", "0.5"),
        ("cmd_vel_timeout", 0),
        ("cmd_vel_timeout", 10.1),
        ("cmd_vel_timeout", math.nan),
        ("cmd_vel_timeout", math.inf),
    ],
)
def test_refusal_names_key_value_and_range(name, value):
    with pytest.raises(ConfigError) as error:
        check({**GOOD, name: value}, "/ns/n")
    assert str(error.value).startswith(f"parameter /ns/n/{name} is {value!r}, expected ")
    assert "\n" not in str(error.value)


words = st.text("ab/ \n", max_size=4)
anything = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), words, st.lists(st.integers(), max_size=1)
)


@given(st.dictionaries(st.sampled_from([row.name for row in ROWS] + ["other"]), anything))
def test_every_value_is_accepted_in_range_or_refused(given_values):
    """Nothing but ConfigError comes out, and what is accepted is within the rows."""
    try:
        values = check({**GOOD, **given_values}, "/n")
    except ConfigError:
        return
    for row in ROWS:
        value = getattr(values, row.name)
        assert type(value) is row.kind
        assert row.kind is not float or row.low <= value <= row.high


@pytest.mark.parametrize("parts", ["odometry, status", "odometry status", ["odometry", "status"]])
def test_parts_are_a_list_or_a_text(parts):
    made = check({**GOOD, "parts": parts}, "/n")
    assert [made.has(part) for part in PARTS] == [True, False, False, True, False]


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"prot": "/dev/ttyACM0"}, "/n/prot is unknown, expected port, port_timeout, baud, fast, robot"),
        ({"base_frame": "odom"}, "/n/base_frame is 'odom'"),
        (
            {"base_frame": "r1/base_footprint", "publish_footprint": True},
            "/n/base_frame is 'r1/base_footprint', which publish_footprint publishes",
        ),
        (
            {"odom_frame": "base_footprint", "publish_footprint": True},
            "/n/odom_frame is 'base_footprint', which publish_footprint publishes",
        ),
        (
            {"port": "tcp://10.0.0.7"},
            "parameter /n/port 'tcp://10.0.0.7' does not parse, expected tcp://HOST:PORT",
        ),
        ({"fast": True, "port": "tcp://a:1"}, "fast is given with port tcp://a:1, expected a device name"),
        ({"fast": True, "baud": 9600}, "fast is given with baud 9600, expected 115200"),
        (
            {"parts": "odometry, wings"},
            "/n/parts is 'wings' in 'odometry, wings', expected all, or some of odometry,",
        ),
        ({"parts": []}, "/n/parts is"),
        ({"zones": "sonars", "parts": "odometry"}, "/n/zones needs the part commands"),
        ({"zones": "scan", "zone_protective": 0.5}, "zone_.*warning_m is 0.5, expected more than 0.55"),
        ({"zones": "sonars", "rate": 2}, "/n/rate is 2, expected 5 Hz or more with zones"),
        ({"zones": "both", "zone_warning": math.nan}, "/n/zone_warning is nan"),
    ],
)
def test_what_cannot_be_together_is_refused(wrong, words):
    with pytest.raises(ConfigError, match=words):
        check({**GOOD, **wrong}, "/n")


def test_missing_port_and_unknown_names_are_told_with_what_is_expected():
    expected = "parameter /n/port is missing, expected the serial port of the board, such as /dev/ttyACM0"
    with pytest.raises(ConfigError, match=expected):
        check({}, "/n")
    with pytest.raises(ConfigError, match="/n/waypoint is unknown, expected waypoints, map_frame"):
        read(PARAMETERS, {"waypoint": []}, "/n", [LIST])


def test_a_port_may_be_a_name(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    named_robots.write({"lab3": named_robots.Target("tcp://10.0.0.7:7000", name="lab3", id=3, virtual=True)})
    found = check({"port": "lab3"}, "/robot_node")
    assert (found.port, found.robot_id, found.virtual) == ("tcp://10.0.0.7:7000", 3, True)
    assert check({"port": "lab4"}, "/robot_node").port == "lab4"


OWN = Limits(0.3, 1.0, 0.2, 1.0)


@pytest.mark.parametrize("name", reconfigure.LIMITS)
def test_limit_that_is_no_number_stays_as_it_was(name):
    """And the answer says so."""
    config = {**dict(zip(reconfigure.LIMITS, (0.1, 0.5, 0.05, 0.2))), name: math.nan}
    at = reconfigure.LIMITS.index(name)
    assert reconfigure.limits_of(config, OWN)[at] == config[name] == OWN[at]


def test_low_limit_of_the_parameters_is_not_raised_at_the_start():
    """dynamic_reconfigure raises a value to the least that is allowed."""
    start = Limits(0.005, 0.001, 0.002, 0.003)
    offered = reconfigure.limits_description(models.load("traxbot"), start)
    assert [offered.min[name] for name in reconfigure.LIMITS] == list(start[:4])
