"""Experiments with teams, cut short: wandering, a shared waypoint."""

import math
import time
from types import SimpleNamespace

import pytest

from mrl_driver.geometry import ORIGIN
from mrl_driver.robot import models
from sim_arduino.experiments import mixed_team, shared_waypoint, team
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.testing import EmulatedBoard
from sim_arduino.world.world import World

from .test_experiments import rows

SEED = 1000
CONTROL_SEEDS = range(1003, 1013)  # Of the first rounds, about one in three ends with a collision


def once(run, setting):
    """In place of the runs with many seeds."""
    return [run(setting._replace(seed=SEED))]


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
    ranges = team.Player(team.Member("real", ORIGIN, virtual=False), robot, World(), World()).ranges()
    assert math.isnan(ranges["front"]) and ranges["left"] == 2.0


def test_mixed_team_does_not_collide(tmp_path):
    """Unless real and virtual robots do not see each other, or one that slips hears no echoes of the virtual one."""
    figures = rows(mixed_team, tmp_path, over_seeds=once, DURATION_S=20.0, CONTROL_S=20.0, SLIPPING_S=20.0)
    for key in ("collided", "slip_touched"):
        assert (figures[key].ours, figures[key].control) == ("0 of 1", "1 of 1")
    assert figures["distance_m"].ours > 7
    assert figures["slip_nearest_m"].ours > 0.5 > figures["slip_nearest_m"].control


@pytest.mark.parametrize(
    "experiment, limit",
    [(mixed_team, "SLIPPING_S"), (shared_waypoint, "TIME_LIMIT_S")],
    ids=["mixed-team", "shared-waypoint"],
)
def test_first_robot_of_a_team_is_the_one_on_the_port(experiment, limit, tmp_path, monkeypatch):
    """It drives in real time, among robots in simulated time, and stands at the end."""
    monkeypatch.setattr(experiment, limit, 1.0)
    with EmulatedBoard(robot="traxbot", world="room") as board:
        start_s = time.monotonic()
        result = experiment.run(Setting(str(tmp_path), port=board.port))
        assert time.monotonic() - start_s >= 1.0
        board.motors.assert_commanded("move_differential")
        board.motors.assert_stopped()
    shown = {row.key: row for row in result.rows}
    assert board.port in result.title and shown["collided"].ours == "0 of 1"


def test_robots_that_claim_the_shared_waypoint_do_not_collide(tmp_path, monkeypatch):
    """Though many messages are lost; they do if every claim is granted at once."""
    monkeypatch.setattr(shared_waypoint, "ROUNDS", 1)
    setting = Setting("/nowhere", seed=SEED)
    claimed = shared_waypoint.drive(setting, loss=0.5)
    assert (claimed.team.collisions, claimed.arrived) == (0, 3)
    controls = (shared_waypoint.drive(setting._replace(seed=seed), claims=False) for seed in CONTROL_SEEDS)
    control = next(run for run in controls if run.team.collisions)

    def over_seeds(run, _):
        return [control if "claims" in getattr(run, "keywords", ()) else claimed]

    monkeypatch.setattr(shared_waypoint, "over_seeds", over_seeds)
    shown = {row.key: row for row in shared_waypoint.run(Setting(str(tmp_path)), claimed).rows}
    assert (shown["collided"].ours, shown["collided"].control) == ("0 of 1", "1 of 1")
    assert shown["lossy_collided"].ours == "0 of 1" and shown["ros_rounds"].ours == 3
