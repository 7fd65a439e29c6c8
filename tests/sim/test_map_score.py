"""The score of a robot's map."""

import math

import numpy as np
import pytest

from mrl_driver.geometry import Pose
from sim_arduino.world import grid_map, map_score
from sim_arduino.world.grid_map import FREE, OCCUPIED, GridMap
from sim_arduino.world.world_file import load

CELL_M = 0.05


@pytest.fixture(scope="module")
def room():
    return load("room")


def with_block(made, x_m, y_m, cells=4):
    """The map with a block of occupied cells whose lowest corner is at x, y."""
    copy = made.cells.copy()
    row, column = round((y_m - made.origin.y_m) / CELL_M), round((x_m - made.origin.x_m) / CELL_M)
    copy[row : row + cells, column : column + cells] = OCCUPIED
    return made._replace(cells=copy)


def test_the_true_map_is_perfect(room):
    found = map_score.score(grid_map.draw(room, CELL_M), room)
    assert (found.found, found.false) == (1.0, 0.0)
    assert found.farthest_m < CELL_M


def test_a_wall_that_is_missing_is_not_found(room):
    made = grid_map.draw(room, CELL_M)
    cells = made.cells.copy()
    cells[:, : cells.shape[1] // 4] = FREE
    assert map_score.score(made._replace(cells=cells), room).found == pytest.approx(0.625, abs=0.03)


def test_cells_off_the_walls_are_false(room):
    made = with_block(grid_map.draw(room, CELL_M), 0.0, 0.0)
    walls = np.count_nonzero(made.cells == OCCUPIED) - 16
    found = map_score.score(made, room)
    assert found.false == pytest.approx(16 / (walls + 16))
    assert found.farthest_m == pytest.approx(2.0, abs=CELL_M)


def test_a_map_within_the_limit_counts_as_the_same(room):
    made = grid_map.draw(room, CELL_M)
    shifts = [Pose(shift_m, 0.0, 0.0) for shift_m in (0.06, 0.2)]
    assert [map_score.score(made, room, shift).false > 0.3 for shift in shifts] == [False, True]


def test_the_frame_of_the_map_is_turned_and_moved(room):
    """A mapper that began at 1, 0 and looked to the left has the world a quarter to the right."""
    frame = Pose(1.0, 0.0, math.pi / 2)
    made = grid_map.draw(room, CELL_M)
    back = Pose(0.0, 0.0, 0.0).relative_to(frame)
    turned = made._replace(origin=back.compose(*made.origin))
    assert map_score.score(turned, room, frame) == pytest.approx(map_score.score(made, room), abs=1e-6)


def test_walls_that_nobody_can_see_do_not_count(tmp_path):
    world = tmp_path / "world.yaml"
    world.write_text(
        "walls: [[-1, -1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1], [-1, 1, -1, -1], [2, 0, 3, 0]]\n"
    )
    made = GridMap(np.full((48, 48), FREE, np.int8), CELL_M, Pose(-1.2, -1.2, 0.0))
    for edges in (np.s_[4, 4:44], np.s_[43, 4:44], np.s_[4:44, 4], np.s_[4:44, 43]):
        made.cells[edges] = OCCUPIED
    assert map_score.score(made, load(str(world))).found == 1.0
