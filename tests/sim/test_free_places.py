"""Start places for many robots: free floor that can be reached from the start."""

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.world import world_file
from sim_arduino.world.free_places import GAP_M, free_places
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World

RADIUS_M = 0.16


def test_the_first_robot_has_the_start_and_the_next_stand_beside_it():
    places = free_places(World(start=Pose(1.0, 2.0, 0.0)), RADIUS_M, 3)
    assert places == [Pose(1.0, 2.0, 0.0), Pose(1.0, 2.5, 0.0), Pose(1.0, 1.5, 0.0)]


@pytest.mark.parametrize("name", ["room", "house", "corridor", "hazards", "steps"])
def test_twenty_robots_keep_away_from_walls_and_from_each_other(name):
    world = world_file.load(name)
    places = free_places(world, RADIUS_M, 20)
    assert len(places) == 20
    for place in places:
        assert world.clearance(place.x_m, place.y_m) >= RADIUS_M + GAP_M - 1e-9
        world.place(f"{place}", place, Footprint(2 * RADIUS_M, 2 * RADIUS_M, True))


def test_a_world_that_is_too_small_says_how_many_fit():
    with pytest.raises(ConfigError, match="expected at most 6: there is no free floor"):
        free_places(world_file.load("l-course"), RADIUS_M, 20)
