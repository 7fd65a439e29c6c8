"""`python -m tests.long.bench NAME` measures with `bench_NAME`, prints its figures and writes build/bench/NAME.json."""

import importlib
import sys

from mrl_driver.errors import MrlError
from tests.long.bench import report


def main(name: str) -> int:
    """0 if every goal is met, 1 if one is missed, and the error's own code without image or simulator."""
    try:
        return report.conclude(name, importlib.import_module(f"tests.long.bench.bench_{name}").figures())
    except MrlError as error:
        print(error, file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
