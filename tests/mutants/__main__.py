"""`python -m tests.mutants [SOURCE ...]`: change the sources at one place, and see what the nearest tests notice.

Results are kept in build/mutants; a source whose file and tests did not change is not run again.  A run
that was broken off continues where it was.
"""

import argparse
import os
import sys
from typing import Dict, List, Optional

from tests.mutants import cpp, results
from tests.mutants.python import run as python


def main() -> int:
    """Run, print the table, and return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("sources", nargs="*", help="parts of the paths of sources; all if none is given")
    parser.add_argument("--workers", type=int, default=2, help="mutants at a time (default 2)")
    parser.add_argument(
        "--survivors", action="store_true", help="list what no test notices and what is not equivalent"
    )
    parser.add_argument("--table", action="store_true", help="print what is known and run nothing")
    given = parser.parse_args()
    os.nice(10)
    chosen = {name: target for name, target in python.targets().items() if _is_chosen(name, given.sources)}
    firmware = [name for name in cpp.FILES if _is_chosen(name, given.sources)]
    if not given.table:
        for source, target in chosen.items():
            print(
                results.row(python.run(source, target["tests"], given.workers), target["safety"], {}),
                flush=True,
            )
        if firmware:
            cpp.run(firmware, results.save, results.load)
    safety = {
        **{name: each["safety"] for name, each in chosen.items()},
        **{n: n in cpp.SAFETY for n in firmware},
    }
    return _report(safety, given.survivors)


def _is_chosen(source: str, parts: List[str]) -> bool:
    return not parts or any(part in source for part in parts)


def _report(safety: Dict[str, bool], survivors: bool) -> int:
    """Print the table and what is wrong; return 1 if something is."""
    listed, wrong = results.equivalents(), []
    print(results.HEAD)
    for source in safety:
        result = results.load(source)
        if result is None:
            wrong.append(f"{source}: not run")
            continue
        print(results.row(result, safety[source], listed))
        wrong += results.errors(result, safety[source], listed)
    for source in safety if survivors else ():
        _print_survivors(results.load(source), listed)
    print("\n".join(wrong))
    return bool(wrong)


def _print_survivors(result: Optional[results.Result], listed: results.Equivalents) -> None:
    for each in results.survivors(result) if result else ():
        if each["key"] not in listed.get(result["file"], {}):
            print(f"{result['file']}:{each['line']}: {each['state']}: {each['key']}")


if __name__ == "__main__":
    sys.exit(main())
