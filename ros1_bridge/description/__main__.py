"""`python -m ros1_bridge.description` renders the URDF files, or checks them with `--check`."""

import sys

from .urdf import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
