"""Writes the map of a world for map_server: FILE.yaml, and a picture next to it."""

import argparse

from mrl_driver.errors import ConfigError
from sim_arduino.world import grid_map, world_file


def main() -> None:
    """Write the map that the program's arguments ask for."""
    parser = argparse.ArgumentParser("save_map", description=__doc__)
    parser.add_argument("world", help="world by name, or path of a .yaml")
    parser.add_argument("file", help="file to write (.yaml)")
    parser.add_argument("--resolution", type=float, default=0.05, help="size of a map cell [m]")
    given = parser.parse_args()
    if not 0.001 <= given.resolution <= 10.0:
        raise ConfigError(f"--resolution is {given.resolution:g}, expected 0.001 to 10 m")
    grid_map.write(grid_map.draw(world_file.load(given.world), given.resolution), given.file)
