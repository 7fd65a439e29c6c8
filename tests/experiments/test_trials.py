"""Figures over many seeds, what is reported of them, the errors of their robots, and two robots at a crossing."""

import math
import random
from statistics import pstdev

import pytest

from mrl_driver.geometry import ORIGIN, Pose
from sim_arduino.experiments import crossing, disturbances, experiment_report, tip_over
from sim_arduino.experiments.experiment_report import Figure
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.faults.key_values import robot_errors


def test_each_run_has_a_seed_of_its_own():
    """Settings with other seeds share no run."""
    one, two = (
        experiment_report.over_seeds(lambda each: each.seed, Setting("", seed=seed)) for seed in (1, 2)
    )
    assert len({*one, *two}) == len(one) + len(two) == 2 * experiment_report.SEEDS


def test_figure_is_the_median_with_the_worst_run_and_the_median_of_the_control():
    measure = experiment_report.Measure("real", "error", "cm", published="3 cm")
    figure = measure.figure([1.0, 9.0, 2.0], [4.0, 5.0, 6.0])
    assert figure == Figure("real", "error", 2.0, "cm", "3 cm", worst=9.0, control=5.0, seeds=3)
    found = experiment_report.Measure("found", "", of=lambda share: 100 * share, worst=min)
    assert found.figure([0.75, 0.5]).worst == 50.0


SEEDS = range(200)


def ratio(seed, name=""):
    errors = robot_errors(disturbances.error(seed, name))
    return errors.right_scale / errors.left_scale


def test_a_robot_is_known_by_its_seed_and_name():
    assert disturbances.error(3, "robot1") == disturbances.error(3, "robot1")
    assert len({disturbances.error(seed, name) for seed in (3, 4) for name in ("robot1", "robot2")}) == 4


def test_errors_spread_as_stated():
    assert pstdev(map(ratio, SEEDS)) == pytest.approx(disturbances.WHEEL_RATIO_SD, rel=0.15)
    slips = [robot_errors(disturbances.error(seed)).turn_slip for seed in SEEDS]
    assert 0 <= min(slips) < 0.001 and 0.019 < max(slips) <= disturbances.MAX_SLIP
    found = [disturbances.placed(Pose(2.0, 1.0, math.pi), seed) for seed in SEEDS]
    assert pstdev(pose.x_m for pose in found) == pytest.approx(disturbances.PLACED_M, rel=0.15)
    assert all(abs(pose.y_m - 1.0) < 0.03 and abs(pose.yaw_rad) > 3.0 for pose in found)
    rng = random.Random(1)
    assert pstdev(disturbances.measured(ORIGIN, rng).x_m for _ in SEEDS) == pytest.approx(0.002, rel=0.15)


def test_given_errors_are_not_drawn():
    errors = robot_errors(disturbances.error(1, slip=0.05, wheel_ratio=1.0, wheel_size=1.01))
    assert (errors.turn_slip, errors.left_scale, errors.right_scale) == (0.05, 1.01, 1.01)


SETTING = Setting("/nowhere", seed=1000)


def test_second_robot_waits_until_the_first_has_left(tmp_path, monkeypatch):
    """Nobody gets the crossing while the radio is cut, and a silent robot is named."""
    by_radio, cut = (crossing.cross(SETTING, cut=cut) for cut in (False, True))
    control = crossing.cross(SETTING, claims=False)
    assert (by_radio.tours.team.collisions, by_radio.tours.arrived) == (
        0,
        2,
    ) and by_radio.tours.waited_s > 5.0
    assert control.tours.team.collisions and control.tours.arrived == 0
    assert cut.tours.arrived == 2, "after the radio is back"
    assert (cut.entered, cut.unnamed, cut.tours.team.collisions) == (0, 0, 0) and 0 < cut.named_s < 6.0

    def over_seeds(run, _):
        return [by_radio if run is crossing.cross else control if "claims" in run.keywords else cut]

    monkeypatch.setattr(crossing, "over_seeds", over_seeds)
    result = crossing.run(Setting(str(tmp_path)))
    shown = {row.key: row for row in result.rows}
    assert (shown["collided"].ours, shown["collided"].control) == ("0 of 1", "1 of 1")
    assert shown["cut_entered"].ours == 0 and (tmp_path / result.pictures[0]).exists()


def test_a_robot_with_a_mast_tips_without_the_limits_and_does_not_with_them(tmp_path):
    """An emergency stop is as short with them."""
    result = tip_over.run(Setting(str(tmp_path), seeds=1))
    rows = {row.key: row for row in result.rows}
    assert rows["tips_s"].ours == 0.0 < rows["tips_s"].control
    assert rows["emergency_m"].ours == pytest.approx(rows["emergency_m"].control, rel=0.05)
    assert rows["braking_m"].ours == pytest.approx(0.5**2 / 2 / 0.5, abs=0.03)
