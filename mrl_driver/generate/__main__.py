"""`python -m mrl_driver.generate` renders the files, or checks them with `--check`."""

import sys

from .render import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
