"""`python -m ros1_bridge.description` renders the URDF files and launch files' arguments; `--check` checks them."""

import sys

from mrl_driver.generate.render import write_stale

from . import launch_arguments, urdf

if __name__ == "__main__":
    made = {str(path): (path, text) for path, text in [*urdf.files(), *launch_arguments.files()]}
    sys.exit(write_stale(made, "python -m ros1_bridge.description", sys.argv[1:]))
