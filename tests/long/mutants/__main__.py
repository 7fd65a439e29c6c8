"""`python -m tests.long.mutants [NAME ...]`: change the sources one place at a time, and count what the tests notice.

Prints each source as soon as it is done, then what survived: build/mutants/results.json has both.  The share of each
group is in build/bench/mutants.json, its goal in tests/long/bench/figures.yaml.
"""

import argparse
import json
import math
import os
import pathlib
import random
import sys
from typing import Any, Dict, List, Sequence

import yaml

from tests.long.bench import report
from tests.long.mutants import cpp, python

HERE, RESULTS = pathlib.Path(__file__).parent, python.ROOT / "build" / "mutants" / "results.json"
SHORT = {
    "python": {"sources": ["sim_arduino/avr/intel_hex.py"], "tests": ["tests/avr/test_build.py"]},
    "firmware": {
        "sources": ["firmware/mrl_firmware/src/radio/xbee.cpp"],
        "tests": ["tests/firmware/test_xbee.py"],
    },
}
"""With FAST=1: a source of each language."""


def main() -> int:
    """Run, and return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m tests.long.mutants", description=__doc__)
    parser.add_argument("names", nargs="*", help="parts of names of groups or sources; all if none is given")
    parser.add_argument("--sample", type=int, help="mutants of each group, drawn at random; all if not given")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default 1)")
    parser.add_argument("--workers", type=int, default=2, help="mutants at a time (default 2)")
    given = parser.parse_args()

    def draw(mutants: Sequence[Any]) -> Sequence[Any]:
        most = len(mutants) if given.sample is None else given.sample
        return random.Random(given.seed).sample(mutants, most) if most < len(mutants) else mutants

    os.nice(10)
    os.environ.pop("MRL_TEST_PATIENCE", None)  # it needs the plugin for time-outs, which judges the machine
    results: Dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    survivors: List[str] = []
    shares: Dict[str, report.Measured] = {}
    print("| source | mutants | noticed |\n|---|---|---|")
    for group, its in report.either(yaml.safe_load((HERE / "sources.yaml").read_text()), SHORT).items():
        wanted = given.names or [group]
        sources = [each for each in its["sources"] if any(name in f"{group} {each}" for name in wanted)]
        run, tried, lived = cpp.run if "firmware" in group else python.run, 0, 0
        for source, count, alive in run(sources, its["tests"], given.workers, draw) if sources else ():
            print(f"| `{source}` | {count} | {count - len(alive)} |", flush=True)
            results[source] = {"mutants": count, "survived": alive}
            RESULTS.write_text(json.dumps(results, indent=1))
            survivors += [f"{source}: {each}" for each in alive]
            tried, lived = tried + count, lived + len(alive)
        if sources == its["sources"]:
            shares.update({group: share(tried, lived, given.sample), f"{group}_mutants": tried})
    print("\n".join(survivors))
    return report.conclude("mutants", shares)


def share(tried: int, lived: int, sample: Any) -> Dict[str, Any]:
    """What the tests notice [%]; of a sample with Wilson's interval, which holds the share of all at 95 %."""
    part, z2 = 1 - lived / max(1, tried), 1.96**2 / max(1, tried)
    middle, half = part + z2 / 2, math.sqrt(z2 * (part * (1 - part) + z2 / 4))
    ends = [100 * (middle - half) / (1 + z2), 100 * (middle + half) / (1 + z2)] if sample else []
    return {"value": report.rounded(100 * part), "spread": list(map(report.rounded, ends))}


if __name__ == "__main__":
    sys.exit(main())
