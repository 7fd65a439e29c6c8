"""`python -m tests.long.mutants [SOURCE ...]`: change the sources one place at a time, and count what the tests notice.

Prints each source as soon as it is done, then what survived; the results are in build/mutants/results.json, and the
least score of each kind in build/bench/mutants.json.
"""

import argparse
import json
import os
import pathlib
import sys
from typing import Any, Dict, List

import yaml

from tests.long.bench import report
from tests.long.mutants import cpp, python

HERE, RESULTS = pathlib.Path(__file__).parent, python.ROOT / "build" / "mutants" / "results.json"
GOALS = {"safety": 0.95, "other": 0.90}
SHORT = [
    {"other": ["sim_arduino/avr/intel_hex.py"], "tests": ["tests/avr/test_build.py"]},
    {
        "other": ["firmware/mrl_firmware/src/sensors/compass.cpp"],
        "tests": ["tests/firmware/test_environment.py"],
    },
]
"""With FAST=1: a source of each language."""


def main() -> int:
    """Run, and return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m tests.long.mutants", description=__doc__)
    parser.add_argument("sources", nargs="*", help="parts of the paths of sources; all if none is given")
    parser.add_argument("--workers", type=int, default=2, help="mutants at a time (default 2)")
    given = parser.parse_args()
    os.nice(10)
    results: Dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    missed: List[str] = []
    least: Dict[str, float] = {}
    print("| source | goal | mutants | noticed | score |\n|---|---|---|---|---|")
    for group in report.either(yaml.safe_load((HERE / "sources.yaml").read_text()), SHORT):
        goals = {source: GOALS[kind] for kind in GOALS for source in group.get(kind, ())}
        chosen = [each for each in goals if not given.sources or any(part in each for part in given.sources)]
        if not chosen:
            continue
        language = "firmware" if chosen[0].startswith("firmware") else "python"
        run = cpp.run if language == "firmware" else python.run
        for source, count, alive in run(chosen, group["tests"], given.workers):
            score = 1 - len(alive) / max(1, count)
            cells = f"`{source}`", f"{goals[source]:.0%}", count, count - len(alive), f"{score:.1%}"
            print("|", " | ".join(map(str, cells)), "|", flush=True)
            kind = "safety" if source in group.get("safety", ()) else "other"
            key = f"{language}_{kind}_least_percent"
            least[key] = min(100 * score, least.get(key, 100.0))
            least[f"{language}_mutants"] = least.get(f"{language}_mutants", 0) + count
            results[source] = {"mutants": count, "survived": alive}
            RESULTS.write_text(json.dumps(results, indent=1))
            missed += [f"{source}: {each}" for each in alive] if score < goals[source] else []
    print("\n".join(missed))
    report.conclude("mutants", least)
    return bool(missed) and not report.FAST


if __name__ == "__main__":
    sys.exit(main())
