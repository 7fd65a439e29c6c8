"""The JSON Schemas of robot and world files: editors refuse by them what the programs refuse."""

import copy
import json
import os
import re

import pytest
from hypothesis import example, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from jsonschema import Draft7Validator

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.robot import models, wirings
from mrl_driver.robot.models import kit
from mrl_driver.robot.models.kit import Kit
from sim_arduino.world import world_file
from sim_arduino.world.world_file import WorldFile

LIGHT, TWO = [0.5, 3.9, 950, 0.9], [0.5, -1, 180, "stingbot"]
BOXES = [[1, 0.5, 0.4, 0.2, 30]]
ALL_KEYS = {"robots": {"two": TWO}, "north": 90, "ambient": {"dust": 300}, "boxes": BOXES, "map": ""}
MAP = {"image": "map.pgm", "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0, "mode": "trinary"}
ONLY_READ = (
    r"expected full_v above low_v",
    r"expected at most .*, the board\.(linear|angular)_ceiling",
    r"expected (about|at most) .*, (to fit|twice the body)",
    r"at most, expected .*: the board cannot control that",
    r"expected three angles, each 120 deg on",
    r"is -?\d+\.0, expected a whole number",
    r"robots\.\w+: robot '.*' is unknown",
    r"expected a map_server YAML",
    r"No such file or directory, expected a PGM or PNG picture",
    r"the occupied_thresh",
    r"is unknown, expected image, resolution",
    r"expected a pin of the",
    r"wiring: \w+ is (not connected|on [AD]\d+)",
    r"wiring has .*, but not .*, expected all or none",
    r"sonars\.\w+ is on the input \w+, which has no pins",
    r"sonars\.\w+\.nearest_m is .*, expected less than farthest_m",
    r"servos\.\w+\.\w+ is .*, expected (less than high_rad|another (length|one)|a servo above it|one with a pin)",
)
"""Errors of the checks that no schema can say, as in docs/own_robot.md."""


def read_all(folder, names):
    return [yaml_file.read(os.path.join(folder, f"{name}.yaml")) for name in names]


ROVER = Kit(
    "rover", 11, 65, 150, 1496, "cytron", {**wirings.load("pwm_d5_d6_dir_d4_d7").pins, "pin_servo_1": 9}
)
ROBOTS = read_all(os.path.dirname(models.__file__), models.packaged())
ROBOTS.append(yaml_file.parse(kit.text_of(ROVER), "rover.yaml"))
WORLDS = read_all(os.path.join(os.path.dirname(world_file.__file__), "worlds"), ("hazards", "room"))
KINDS = {
    "robot": (models.RobotFile(), models.SCHEMA, ROBOTS),
    "world": (WorldFile(), world_file.SCHEMA, [*WORLDS, ALL_KEYS, {**ALL_KEYS, "light": [LIGHT]}, MAP]),
}


def schema(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


VALIDATORS = {kind: Draft7Validator(schema(path)) for kind, (_, path, _) in KINDS.items()}


def first_lines(folder, names):
    for name in names:
        path = os.path.join(folder, f"{name}.yaml")
        with open(path, encoding="utf-8") as file:
            yield path, file.readline()


@pytest.mark.parametrize(
    ("kind", "folder", "names"),
    [
        ("robot", os.path.dirname(models.__file__), models.packaged()),
        ("world", os.path.join(os.path.dirname(world_file.__file__), "worlds"), world_file.names()),
    ],
)
def test_packaged_files_name_their_schema_and_are_valid(kind, folder, names):
    assert names
    for path, line in first_lines(folder, names):
        named = re.fullmatch(r"# yaml-language-server: \$schema=(.*)\n", line).group(1)
        assert os.path.samefile(os.path.join(folder, named), KINDS[kind][1])
        VALIDATORS[kind].validate(yaml_file.read(path))


WORDS = ["", "omni", "none", "tracked", "mecanum", "environment"]
WORDS += ["A4", "a6", "sonar", "tb6612", "TB6612", "scale", "r2d2"]
NUMBERS = [-1, 0, 1, 0.5, 6, 90, 700.0, 40000, 1e9, float("inf")]
LISTS = [[], [1], [1, 1], [60, 180, 300], [0, 90, 180], [1.0, 2, 3], [[0, 0, 1, 1]], ["a"], TWO]
FRONT = {"front": {"x_m": 0.1, "y_m": 0, "yaw_deg": 0}}
MAPPINGS = [{}, FRONT, {"rear": {}}, {"x_m": 0.1}, {"two": TWO}, {"a b": TWO}]
VALUES = st.sampled_from([None, True, False, *WORDS, *NUMBERS, *LISTS, *MAPPINGS])
NAMES = st.sampled_from(
    ["kind", "turn_slip", "bridge", "build", "noise", "imu", "laser", "lateral_m_s", "sonar_a", "wiring"]
    + ["gyro_scale", "image", "map", "heat", "free_thresh", "robots", "angles_deg", "left", "missspelt"]
    + ["servos", "on", "low_us"]
)


def places(data):
    """Container and key of each value in a file."""
    found = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in found:
        yield data, key
        yield from places(value)


@st.composite
def changed(draw, files):
    """A file with a few values replaced, left out or added."""
    data = copy.deepcopy(draw(st.sampled_from(files)))
    for _ in range(draw(st.integers(1, 3))):
        found = list(places(data))
        if not found:
            break
        container, key = draw(st.sampled_from(found))
        change = draw(st.sampled_from(["replace", "replace", "remove", "add"]))
        if change == "replace":
            container[key] = copy.deepcopy(draw(VALUES))
        elif change == "remove":
            del container[key]
        elif isinstance(container, dict):
            container[draw(NAMES)] = copy.deepcopy(draw(VALUES))
    return data


def check_agreement(kind, data):
    form, _, _ = KINDS[kind]
    valid = VALIDATORS[kind].is_valid(data)
    try:
        form.read(yaml_file.Reader("file.yaml"), "", data)
    except ConfigError as error:
        only_read = any(re.search(pattern, str(error)) for pattern in ONLY_READ)
        assert not valid or only_read, f"the schema accepts what the checks refuse: {error}"
    else:
        assert valid, VALIDATORS[kind].iter_errors(data)


TRACKED = {"kind": "tracked", "turn_slip": 0.1, "wheel_separation_m": 0.18, "metres_per_count": 8.7e-5}


@pytest.mark.parametrize(
    ("model", "place", "value"),
    [
        ("duo", ("drive",), TRACKED),
        ("duo", ("build",), "environment"),
        ("traxbot", ("limits", "lateral_m_s"), 0.1),
        ("omni", ("board", "bridge"), "tb6612"),
        ("traxbot", ("ids",), [1, 2, 1]),
        ("traxbot", ("ids",), []),
        ("traxbot", ("sonars", "Rear 1"), {"x_m": 0, "y_m": 0, "yaw_deg": 180, "input": "left"}),
        ("pioneer", ("build",), "sonar"),
        ("pioneer", ("limits",), {}),
        ("omni", ("drive", "angles_deg"), [60, 180]),
    ],
)
def test_schema_and_checks_refuse_what_does_not_go_together(model, place, value):
    data = copy.deepcopy(ROBOTS[models.packaged().index(model)])
    *way, last = place
    section = data[way[0]] if way else data
    section[last] = value
    assert not VALIDATORS["robot"].is_valid(data)
    with pytest.raises(ConfigError):
        models.parse(data, "robot.yaml")


@given(changed(ROBOTS))
@hypothesis_settings(max_examples=150)
def test_a_robot_file_is_refused_by_schema_and_checks_alike(data):
    check_agreement("robot", data)


@given(changed(KINDS["world"][2]))
@hypothesis_settings(max_examples=150)
@example([])
def test_a_world_file_is_refused_by_schema_and_checks_alike(data):
    check_agreement("world", data)
