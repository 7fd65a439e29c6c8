"""`python -m tests.mutants [SOURCE ...]`: change the sources one place at a time, and count what the nearest tests notice.

Results are kept in build/mutants; a source whose file and tests did not change is not run again.
"""

import argparse
import os
import sys
from typing import Any, Dict, List

from tests.mutants import results
from tests.mutants.python import run as python


def main() -> int:
    """Run, print the table, and return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("sources", nargs="*", help="parts of the paths of sources; all if none is given")
    parser.add_argument("--workers", type=int, default=2, help="mutants at a time (default 2)")
    parser.add_argument("--survivors", action="store_true", help="list what no test notices and what is not equivalent")
    parser.add_argument("--table", action="store_true", help="print what is known and run nothing")
    given = parser.parse_args()
    os.nice(10)
    found, listed, wrong = [], results.equivalents(), []
    for source, target in _chosen(given.sources).items():
        result = results.load(source) if given.table else _run(source, target, given.workers)
        if result is None:
            continue
        found.append(results.row(result, target["safety"], listed))
        wrong += results.errors(result, target["safety"], listed)
        print(found[-1], flush=True)
        if given.survivors:
            _print_survivors(result, listed)
    print("\n".join(["", results.HEAD, *found, "", *wrong]))
    return bool(wrong)


def _chosen(parts: List[str]) -> Dict[str, Any]:
    return {
        source: target
        for source, target in python.targets().items()
        if not parts or any(part in source for part in parts)
    }


def _run(source: str, target: Dict[str, Any], workers: int) -> results.Result:
    return python.run(source, target["tests"], workers)


def _print_survivors(result: results.Result, listed: results.Equivalents) -> None:
    for each in results.survivors(result):
        if each["key"] not in listed.get(result["file"], {}):
            print(f"  {result['file']}:{each['line']}: {each['state']}: {each['key']}")


if __name__ == "__main__":
    sys.exit(main())
