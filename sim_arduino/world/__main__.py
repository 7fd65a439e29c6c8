"""`python -m sim_arduino.world` renders the JSON Schema of world files, or checks it with `--check`."""

import sys
from pathlib import Path

from mrl_driver.generate.render import write_stale
from mrl_driver.yaml_form import schema_text

from .world_file import SCHEMA, WorldFile

if __name__ == "__main__":
    text = schema_text("World of mrl-sim", WorldFile().schema())
    files = {"sim_arduino/world/world.schema.json": (Path(SCHEMA), text)}
    sys.exit(write_stale(files, "python -m sim_arduino.world", sys.argv[1:]))
