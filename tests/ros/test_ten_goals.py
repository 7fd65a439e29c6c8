"""`make test-navigation`: its goals can be reached, its judge sees what happens, and it says what is missing."""

import math
import subprocess
from collections import deque

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.world import world_file
from tests.long.navigation.goals import CONTACT_M, GOALS, REACHED_M, ROBOTS, Judge, Outcome, row_of, table_of
from tests.long.navigation.stack import NEEDED, require_sources
from tests.waiting import PATIENCE

from .rig import ROOT
from .test_move_base import parameters

CELL_M = 0.1
RADIUS_M = max(parameters(f"{robot}.yaml")["global_costmap"]["robot_radius"] for robot in ROBOTS)
"""Largest radius that a planner plans with."""


@pytest.fixture(scope="module", params=sorted(GOALS))
def world(request):
    return request.param, world_file.load(request.param)


def cell(x, y):
    return round(x / CELL_M), round(y / CELL_M)


def reachable(scene):
    """Cells to which a robot of the largest radius comes from the start."""
    first = cell(scene.start.x_m, scene.start.y_m)
    seen, waiting = {first}, deque([first])
    while waiting:
        x, y = waiting.popleft()
        for after in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if after not in seen and scene.clearance(after[0] * CELL_M, after[1] * CELL_M) > RADIUS_M:
                seen.add(after)
                waiting.append(after)
    return seen


def test_each_robot_can_stand_at_each_of_ten_goals_and_come_there(world):
    name, scene = world
    there = reachable(scene)
    assert len(GOALS[name]) == 10
    assert all(cell(x, y) in there for x, y, _ in GOALS[name])


def test_goals_of_the_house_are_in_all_rooms():
    rooms = {(x > 3, y > 2.2) for x, y, _ in GOALS["house"]}
    assert len(rooms) == 4


@pytest.fixture
def judge():
    """Of a TraxBot in the room, whose walls are 2 m from its middle."""
    return Judge(world_file.load("room"), footprint_for(models.load("traxbot")))


@pytest.mark.parametrize("gap_m, contact", [(CONTACT_M * 2, False), (CONTACT_M / 2, True)])
def test_body_at_a_wall_is_a_contact(judge, gap_m, contact):
    judge.see(Pose(2.0 - models.load("traxbot").body.length_m / 2 - gap_m, 0.0, 0.0))
    assert judge.contact == contact


def test_contact_on_the_way_is_not_forgotten(judge):
    for x in (0.0, 1.95, 0.0):
        judge.see(Pose(x, 0.0, 0.0))
    assert judge.contact and judge.distance_m((0.3, 0.4, 0)) == pytest.approx(0.5)


@pytest.mark.parametrize(
    "succeeded, error_m, reached", [(True, 0.1, True), (True, REACHED_M * 1.1, False), (False, 0.0, False)]
)
def test_goal_counts_if_the_action_says_so_and_the_robot_is_there(succeeded, error_m, reached):
    assert Outcome(succeeded, error_m, False, 1.0).reached == reached


def test_row_has_the_error_of_the_goals_that_were_reached():
    outcomes = [
        Outcome(True, 0.06, False, 20.0),
        Outcome(True, 0.10, True, 30.0),
        Outcome(False, 3.0, False, 180.0),
    ]
    row = row_of("traxbot", "house", outcomes)
    assert (row["reached"], row["goals"], row["mean_error_cm"], row["contacts"]) == (2, 3, 8.0, 1)
    assert table_of([row]).splitlines()[-1] == "| traxbot, `house` | 2 of 3 | 8.0 cm | 1 |"


def test_row_without_a_goal_that_was_reached_has_no_error():
    row = row_of("omni", "room", [Outcome(False, math.nan, False, 1.0)])
    assert row["mean_error_cm"] is None and "0 of 1 |  |" in table_of([row])


def test_without_a_source_one_line_says_what_is_missing():
    done = subprocess.run(
        ["make", "-s", "test-navigation"], cwd=ROOT, capture_output=True, text=True, timeout=60 * PATIENCE
    )
    (line, *rest) = done.stderr.splitlines()
    assert done.returncode == 2 and done.stdout == "" and all("***" in word for word in rest)
    assert line.startswith(
        "NAVIGATION_SRC is not set, expected a folder with the sources of https://github.com/"
    )


@pytest.mark.parametrize("there", [(), NEEDED[:2]])
def test_source_without_the_packages_is_refused(tmp_path, there):
    for name in there:
        (tmp_path / name).mkdir()
        (tmp_path / name / "package.xml").write_text("<package/>")
    with pytest.raises(ConfigError, match=f"lacks {', '.join(NEEDED[len(there) :])}, expected a folder"):
        require_sources(tmp_path)
