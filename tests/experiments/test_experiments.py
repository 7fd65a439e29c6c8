"""The papers' experiments come out as they should; long ones are cut short."""

import json
import math
from types import SimpleNamespace

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN
from mrl_driver.robot import models
from sim_arduino.experiments import (
    arena_sweep,
    experiment_report,
    l_course,
    mixed_team,
    power,
    shared_waypoint,
    sonar_approach,
    square,
    step_test,
    team,
    turnaround,
)
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.world import grid_map, world_file
from sim_arduino.world.world import World

WALLS_BY_LASER, WALLS_BY_SONARS = 95.0, 80.0
"""Least share of wall cells found, and of cells found that are walls [%]."""
LAP_CM, LAP_DEG = 1.0, 0.5


def run(experiment, folder, **short):
    """Figures of an experiment by their keys, some of its constants replaced."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in short.items():
            patch.setattr(experiment, name, value)
        result = experiment.run(Setting(str(folder)))
    for picture in result.pictures:
        assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    return {row.key: row.ours for row in result.rows}


@pytest.fixture(scope="module")
def l_course_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("l-course")


@pytest.fixture(scope="module")
def l_course_figures(l_course_folder):
    return run(l_course, l_course_folder)


@pytest.mark.parametrize("figure", ["walls_found_percent", "cells_on_walls_percent"])
@pytest.mark.parametrize(("sensor", "least"), [("laser", WALLS_BY_LASER), ("sonars", WALLS_BY_SONARS)])
def test_l_course_is_mapped(l_course_figures, sensor, least, figure):
    assert l_course_figures[f"{sensor}_{figure}"] >= least


@pytest.mark.parametrize("sensor", ["laser", "sonars"])
def test_maps_of_the_l_course_can_be_loaded(l_course_figures, l_course_folder, sensor):
    world = world_file.load(str(l_course_folder / f"l-course-{sensor}.yaml"))
    assert len(world.walls) > 20


@pytest.fixture(scope="module")
def square_figures(tmp_path_factory):
    return run(square, tmp_path_factory.mktemp("square"), TEAM=1)


def test_squares_close_after_calibration(square_figures):
    assert square_figures["others_after_cm"] < LAP_CM and square_figures["others_after_deg"] < LAP_DEG


def test_square_before_calibration_is_off_by_the_published_angles(square_figures):
    angles = square_figures["counter_clockwise_before_deg"], square_figures["clockwise_before_deg"]
    assert angles == pytest.approx((-4.93, 2.13), abs=0.1)


def test_sonar_curve_is_found(tmp_path):
    figures = run(sonar_approach, tmp_path, APPROACHES=2)
    assert figures["r2"] >= 0.999 and figures["error_cm"] < 1.0


def test_packs_last_shorter_at_speed(tmp_path):
    figures = run(power, tmp_path, EMPTY_V=13.2, SPEEDS_MM_S=(50, 200))
    assert 0 < figures["hours_200_mm_s"] < figures["hours_50_mm_s"]


@pytest.mark.realtime
def test_mirror_follows_within_a_second(tmp_path):
    """The median of all poses of a drive."""
    figures = run(step_test, tmp_path, WAYPOINTS=((0.15, 0.0),))
    assert figures["mirror_delay_ms_median"] < 1000 and figures["end_error_mm"] < 50


@pytest.mark.parametrize("name", ["front", "left", "right"])
@pytest.mark.parametrize("silent", [{}, math.nan], ids=["absent", "nan"])
def test_wanderer_stands_while_a_sonar_has_no_reading(name, silent):
    ranges = {each: math.inf for each in ("front", "left", "right") if each != name}
    ranges.update({name: silent} if silent else {})
    assert mixed_team.Wanderer(models.load("traxbot").limits).command(ranges) == (0.0, 0.0)


def test_sonar_without_a_reading_is_unknown_although_nothing_stands_in_the_virtual_world():
    model = models.load("traxbot")
    robot = SimpleNamespace(
        model=model, pose=ORIGIN, ranges={"front": math.nan, "left": 2.0}, reset_pose=lambda pose: None
    )
    ranges = team.Player(team.Member("real", ORIGIN, virtual=False), robot, World()).ranges()
    assert math.isnan(ranges["front"]) and ranges["left"] == 2.0


def test_mixed_team_does_not_collide(tmp_path):
    figures = run(mixed_team, tmp_path, DURATION_S=30.0)
    assert figures["collisions"] == 0 and figures["distance_m"] > 7


def test_team_shares_a_waypoint_without_a_collision(tmp_path):
    figures = run(shared_waypoint, tmp_path, ROUNDS=1)
    assert (figures["collisions"], figures["rounds"]) == (0, 3)


def test_shared_waypoint_is_one_robots_at_a_time():
    claims = shared_waypoint.Claims()
    assert claims.ask("a") and not claims.ask("b")
    claims.release("b")
    assert not claims.ask("b")
    claims.release("a")
    assert claims.ask("b")


def test_alerts_lie_at_their_sources(tmp_path):
    figures = run(arena_sweep, tmp_path, LANE_M=3.0)
    assert all(figures[f"{each.title}_distance_m"] < 1.0 for each in arena_sweep.VARIABLES)


def test_messages_take_less_than_those_of_2013(tmp_path):
    figures = run(turnaround, tmp_path, COUNTS=(20,))
    assert figures["plain_20_ms"] < min(turnaround.PUBLISHED_MS, figures["firmware_2013_20_ms"])


@pytest.mark.parametrize("experiment", [square, mixed_team, shared_waypoint, turnaround])
def test_port_is_refused_where_robots_are_emulated(experiment):
    with pytest.raises(ConfigError, match="leave out --port"):
        experiment.run(Setting("/nowhere", port="/dev/ttyACM0"))


def test_result_is_read_as_it_was_saved(tmp_path):
    row = experiment_report.Figure("distance_m", "distance", 1.25, "m", "1 m")
    result = experiment_report.Result("drive", "A drive", [row], ["drive.png"], "remark")
    experiment_report.save(result, str(tmp_path))
    assert experiment_report.read(str(tmp_path), "drive") == result


def test_report_has_all_results(tmp_path):
    for name in ("one", "two"):
        experiment_report.save(experiment_report.Result(name, f"Title {name}", []), str(tmp_path))
    text = (tmp_path / "report.md").read_text()
    assert "Title one" in text and "Title two" in text


def test_maps_cells_hold_what_beams_said():
    from mrl_driver.geometry import Pose
    from sim_arduino.experiments.occupancy import Grid

    grid = Grid((0.0, 0.0), (2.0, 1.0), 0.1)
    import numpy as np

    grid.beams(Pose(0.05, 0.55, 0.0), np.array([0.0]), np.array([1.0]), 4.0)
    cells = grid.map().cells[5]
    assert cells[10] == grid_map.OCCUPIED and cells[3] == grid_map.FREE and cells[15] == grid_map.UNKNOWN


def test_sonar_without_an_echo_makes_its_cone_free():
    from mrl_driver.geometry import Pose
    from sim_arduino.experiments.occupancy import Grid

    grid = Grid((0.0, 0.0), (2.0, 1.0), 0.1)
    grid.cone(Pose(0.0, 0.55, 0.0), math.radians(18), math.inf, 1.5)
    cells = grid.map().cells
    assert (
        cells[5][10] == grid_map.FREE and cells[5][16] == grid_map.UNKNOWN and cells[9][3] == grid_map.UNKNOWN
    )


def test_json_names_what_was_published(tmp_path):
    row = experiment_report.Figure("distance_m", "distance", 1.25, "m", "1 m")
    experiment_report.save(experiment_report.Result("drive", "A drive", [row]), str(tmp_path))
    assert json.loads((tmp_path / "drive.json").read_text())["rows"][0]["published"] == "1 m"
