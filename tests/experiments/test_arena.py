"""The arena of the sensor experiment: its sources, the path around its obstacles, and what is found of them."""

import math

import numpy as np
import pytest

from mrl_driver.geometry import Pose, wrap_angle
from sim_arduino.experiments import arena, arena_sweep, experiment_report
from sim_arduino.experiments.arena_sweep import ALCOHOL, DUST, HEAT, SOURCES, VARIABLES, Drive, Sample
from sim_arduino.experiments.experiment_robot import Setting

SEEDS = range(1000, 1004)
FOUND_M = 0.5  # Largest distance of a place found from its source where poses and readings have no errors


def places(sources):
    return [source[:2] for source in sources]


@pytest.fixture(scope="module")
def arenas():
    return [arena.drawn(seed) for seed in SEEDS]


@pytest.fixture(scope="module")
def flawless():
    """A sweep without a robot: true readings along the path, and in the turns at its corners."""
    world = arena.drawn(1000)
    path, poses, yaw = [world.start[:2], *arena.sweep(world)], [], world.start.yaw_rad
    for here, there in zip(path, path[1:]):
        before, yaw = yaw, math.atan2(there[1] - here[1], there[0] - here[0])
        poses += [Pose(*here, yaw - share * wrap_angle(yaw - before)) for share in (1.0, 0.75, 0.5, 0.25)]
        for share in np.arange(0.0, 1.0, 0.1 / max(0.1, math.dist(here, there))):
            poses.append(Pose(*(a + share * (b - a) for a, b in zip(here, there)), yaw))
    return Drive(world, [true_sample(world, pose) for pose in poses], 0, 0.0)


def true_sample(world, pose):
    around = world.scene.sensed(world.scene.ambient, pose, world.sees)
    return Sample(0.0, pose, (around.pixels_c, (around.dust_pcs_l,), (1023 - around.alcohol_count,)))


def found(drive, each, alert=None):
    return arena_sweep.spots(VARIABLES.index(each), drive, each.alert if alert is None else alert)


def test_seed_draws_the_places_of_all_sources_apart_and_containers_are_obstacles(arenas):
    kinds = [
        [places(getattr(world.scene, SOURCES[each])) for world in arenas] for each in (HEAT, DUST, ALCOHOL)
    ]
    assert all(len({str(each) for each in kind}) == len(SEEDS) for kind in kinds)
    pairs = [places(kind) for world in arenas for kind in (world.scene.gas, world.scene.heat)]
    assert min(math.dist(*pair) for pair in pairs) >= arena.APART_M
    assert all(world.is_solid(*place) for world in arenas for place in places(world.scene.gas))
    assert arenas[0].bounds() == (0.0, 0.0, 4.0, 4.6)


def test_path_keeps_away_from_all_obstacles(arenas):
    """Between the points of the lattice too."""
    for world in arenas[:2]:
        path = [world.start[:2], *arena.sweep(world)]
        assert len(path) > 10
        for (x, y), (to_x, to_y) in zip(path, path[1:]):
            shares = np.arange(0.0, 1.001, 0.125 / math.dist((x, y), (to_x, to_y)))
            gaps = [world.clearance(x + s * (to_x - x), y + s * (to_y - y)) for s in shares]
            assert min(gaps) >= arena.CLEAR_M - 0.01


@pytest.mark.parametrize("each", VARIABLES, ids=lambda each: each.title)
def test_sources_are_found_in_true_readings(flawless, each):
    """And not in the control, whose readings count for nothing."""
    sources = np.array(places(getattr(flawless.world.scene, SOURCES[each])))
    off_m = [
        arena_sweep.apart_m(sources, arena_sweep.objects(each, found(flawless, each, alert)))
        for alert in (None, arena_sweep.IGNORED)
    ]
    assert off_m[0] < FOUND_M < 2.0 < off_m[1]


def test_a_sweep_does_not_collide_and_noise_alone_gives_no_alert(tmp_path, monkeypatch):
    """Of half a metre; what the scene contains is marked."""
    monkeypatch.setattr(experiment_report, "SEEDS", 1)
    monkeypatch.setattr(arena, "sweep", lambda *_: [(0.5, 1.0)])
    figures = {row.key: row for row in arena_sweep.run(Setting(str(tmp_path))).rows}
    assert (tmp_path / "environment.png").exists()
    assert figures["collisions"].ours == 0 and figures["off_cm"].ours < 30.0
    assert [figures[f"{each.title}_without_sources"].worst for each in VARIABLES] == [0] * len(VARIABLES)
    marked = {key for key, row in figures.items() if row.put_in}
    assert marked == {f"{each.title}_most" for each in VARIABLES}
