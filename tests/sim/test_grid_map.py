"""map_server maps in and out."""

import math

import numpy as np
import pytest
import yaml

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.world import grid_map
from sim_arduino.world.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap
from sim_arduino.world.shapes import Wall
from sim_arduino.world.world_file import load

GOOD = {"image": "map.pgm", "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0}
PICTURE = b"P5\n# made by hand\n4 3\n255\n" + bytes([254, 254, 254, 254, 254, 0, 0, 254, 205, 254, 254, 254])
"""Two occupied cells side by side in the middle row, an unknown one at the lower left."""


def write(folder, picture=PICTURE, **changes):
    (folder / "map.pgm").write_bytes(picture)
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}))
    return str(path)


def read(folder, **changes):
    path = write(folder, **changes)
    return grid_map.read(path, {**GOOD, **changes})


def test_row_0_is_the_lowest(tmp_path):
    assert read(tmp_path).cells.tolist() == [[UNKNOWN, FREE, FREE, FREE], [0, 100, 100, 0], [0, 0, 0, 0]]


def test_negate_turns_black_and_white(tmp_path):
    assert read(tmp_path, negate=1).cells[1].tolist() == [OCCUPIED, FREE, FREE, OCCUPIED]


def test_plain_pgm(tmp_path):
    (tmp_path / "map.pgm").write_bytes(b"P2 2 1 # comment\n15\n0 15\n")
    assert grid_map.read(str(tmp_path / "map.yaml"), GOOD).cells.tolist() == [[OCCUPIED, FREE]]


def test_two_bytes_a_pixel(tmp_path):
    (tmp_path / "map.pgm").write_bytes(b"P5 2 1 65535\n\x00\x00\xff\xff")
    assert grid_map.read(str(tmp_path / "map.yaml"), GOOD).cells.tolist() == [[OCCUPIED, FREE]]


@pytest.mark.parametrize("header", [b"P5\r\n2 1\r\n255\r\n", b"P5 # made by\n# hand\n2 # wide\n 1\n255\n"])
def test_headers_of_other_programs(tmp_path, header):
    write(tmp_path, picture=header + bytes([0, 254]))
    assert grid_map.read(str(tmp_path / "map.yaml"), GOOD).cells.tolist() == [[OCCUPIED, FREE]]


def test_occupied_cells_are_solid(tmp_path):
    world = load(write(tmp_path))
    assert [world.is_solid(x, 0.15) for x in (0.05, 0.15, 0.25, 0.35)] == [False, True, True, False]


def test_outlines_are_joined(tmp_path):
    """Two cells of 0.1 m side by side: a box of 0.2 x 0.1 m out of four walls."""
    walls = load(write(tmp_path)).walls
    ends = sorted(tuple(round(v, 9) for v in wall) for wall in walls)
    assert ends == [(0.1, 0.1, 0.1, 0.2), (0.1, 0.1, 0.3, 0.1), (0.1, 0.2, 0.3, 0.2), (0.3, 0.1, 0.3, 0.2)]


def test_cells_at_the_edge_have_outlines_too():
    grid = GridMap(np.full((1, 1), OCCUPIED, np.int8), 1.0, Pose(0, 0, 0))
    assert len(grid_map.walls_of(grid)) == 4


def test_origin_moves_and_turns():
    grid = GridMap(np.full((1, 1), OCCUPIED, np.int8), 1.0, Pose(5.0, 0.0, math.pi / 2))
    xs = [x for wall in grid_map.walls_of(grid) for x in (wall.x1, wall.x2)]
    assert (min(xs), max(xs)) == pytest.approx((4.0, 5.0))


def test_a_sonar_measures_in_a_map(tmp_path):
    """From the left edge, 0.15 m up: the box begins at 0.1 m."""
    world = load(write(tmp_path))
    assert world.nearest(Pose(0.0, 0.15, 0.0), math.radians(18), 6.45) == pytest.approx(0.1)


def test_a_world_file_may_name_a_map(tmp_path):
    write(tmp_path)
    path = tmp_path / "world.yaml"
    path.write_text("map: map.yaml\nwalls: [[0, 0, 1, 0]]\n")
    assert len(load(str(path)).walls) == 5


def test_a_drawn_map_has_walls_floor_and_outside():
    grid = grid_map.draw(load("l-course"), 0.05)
    x, y = ((grid.origin.x_m, grid.origin.y_m), grid.cells.shape)
    assert set(np.unique(grid.cells)) == {UNKNOWN, FREE, OCCUPIED}
    assert (grid.cells == FREE).sum() * 0.05**2 == pytest.approx(2 * 1 + 0.6 * 1, rel=0.12)
    assert (x, y) == ((-0.25, -0.25), (42, 50))


def test_a_drawn_map_comes_back(tmp_path):
    grid = grid_map.draw(load("l-course"), 0.05)
    path = str(tmp_path / "map.yaml")
    grid_map.write(grid, path)
    back = grid_map.read(path, yaml.safe_load((tmp_path / "map.yaml").read_text()))
    assert (back.cells == grid.cells).all()
    assert back[1:] == grid[1:]


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"resolution": 0}, "map.yaml: resolution is 0, expected a number from 0.001 to 10"),
        ({"resolution": "fine"}, "resolution is 'fine'"),
        ({"origin": [0, 0]}, r"origin is \[0, 0\], expected \[x m, y m, yaw rad\]"),
        ({"origin": [0, 0, math.nan]}, "origin is"),
        ({"image": ""}, "image is '', expected the name of a PGM file"),
        ({"resolution": True}, "resolution is True"),
        ({"origin": 7}, "origin is 7, expected"),
        ({"image": 5}, "image is 5, expected the name of a PGM file"),
        ({"image": "none.pgm"}, "none.pgm: No such file"),
        ({"negate": 2}, "negate is 2, expected a number from 0 to 1"),
        ({"occupied_thresh": 65}, "occupied_thresh is 65"),
        ({"mode": "raw"}, "mode is 'raw', expected trinary or scale"),
        ({"resolutoin": 1}, "key resolutoin is unknown, expected image, resolution"),
        ({"picture": b"\x89PNG\r\n"}, r"map.pgm: begins with b'\\x89PNG"),
        ({"picture": b"P5 4 3 255\n123"}, "has 3 pixels, expected 4 x 3 = 12"),
        ({"picture": b"P5 0 3 255\n"}, "0 x 3 pixels"),
        ({"picture": b"P2 1 1 255\nwhite"}, "expected whole numbers"),
        ({"picture": b"P2 1 1 255\nnan"}, "expected whole numbers"),
        ({"picture": b"P2 1 1 255\n" + b"9" * 30}, "expected whole numbers"),
        ({"picture": b"P2 2 1 255\n-1 0"}, "has pixels from -1 to 0, expected 0 to 255"),
        ({"picture": b"P5 1 1 9\n\x0a"}, "has pixels from 10 to 10, expected 0 to 9"),
        ({"picture": b"P5 " + b"9" * 5000 + b" 1 255\n"}, "expected a PGM header"),
        ({"picture": b"P5 9000 9000 255\n"}, "9000 x 9000 pixels up to 255, expected 1 to 64000000"),
        ({"picture": b"P5 1 1 65536\n"}, "pixels up to 65536, expected 1 to 64000000 pixels up to 65535"),
        ({"free_thresh": 0.7}, "free_thresh is 0.7, expected a number from 0 to 0.65"),
        ({"mode": "scale", "negate": True}, "negate is True"),
    ],
)
def test_bad_maps_name_file_key_and_value(tmp_path, changes, message):
    path = write(tmp_path, **changes)
    with pytest.raises(ConfigError, match=message) as caught:
        load(path)
    assert "\n" not in str(caught.value)


def test_a_map_in_a_world_that_is_not_there(tmp_path):
    path = tmp_path / "world.yaml"
    path.write_text("map: nowhere.yaml")
    with pytest.raises(ConfigError, match="nowhere.yaml: No such file"):
        load(str(path))


def test_many_walls_are_heard_like_few():
    """More than a loop takes: the index changes its ways, the answer stays."""
    from sim_arduino.world.wall_index import FEW
    from sim_arduino.world.world import World

    walls = [Wall(3 + i * 0.01, -1, 3 + i * 0.01, 1) for i in range(FEW + 1)]
    answers = [
        (world.nearest(Pose(0, 0, 0), 0.3, 6.45), world.clearance(0, 0), len(world.walls) > 0)
        for world in (World(walls[:FEW]), World(walls))
    ]
    assert answers[0] == pytest.approx(answers[1])
