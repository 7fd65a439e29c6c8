"""Compares a map in map_server's format with the walls of a simulated world."""

import argparse
import math
import sys

from sim_arduino.world import grid_map, map_score, world_file


def main() -> None:
    """Print the share of the walls that the map has, and of its occupied cells where there is no wall."""
    parser = argparse.ArgumentParser("compare_map", description=__doc__)
    parser.add_argument("world", help="world by name, or path of a .yaml")
    parser.add_argument("file", help="map (.yaml)")
    parser.add_argument(
        "--frame",
        metavar="X,Y,YAW",
        help="pose of the map's frame in the world [m, deg]; default: the start of the world, where a mapper begins",
    )
    given = parser.parse_args()
    world = world_file.load(given.world)
    frame = world_file.parse_pose(given.frame, world.start)
    made = grid_map.load(given.file)
    best = map_score.fitted(made, world, frame)
    found, fit = (map_score.score(made, world, pose) for pose in (frame, best))
    moved = best.relative_to(frame)
    sys.stdout.write(
        f"walls found: {100 * found.found:.1f} %, after the best fit {100 * fit.found:.1f} %\n"
        f"occupied cells off the walls: {100 * found.false:.1f} %, after the best fit {100 * fit.false:.1f} %\n"
        f"farthest cell: {found.farthest_m:.2f} m off, after the best fit {fit.farthest_m:.2f} m\n"
        f"best fit: {moved.x_m:.2f} m, {moved.y_m:.2f} m, {math.degrees(moved.yaw_rad):.1f} deg\n"
        f"within {100 * map_score.NEAR_M:g} cm counts as the same\n"
    )
