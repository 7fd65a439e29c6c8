"""`make smoke`: every make target that measures, verifies or draws, in its shortest form.

python -m tests.long.bench.smoke [TARGET...]

`targets` of `figures.yaml` has a row for each: its options, the tables whose figures it promises, and the files that it
makes.  A target fails if it ends with an error, or if a figure is missing, not finite or outside its plausible range.
The output of each is in build/smoke.
"""

import json
import math
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Sequence

from tests.long.bench.figures import ROOT, catalogue, promised, tables

FOLDER = ROOT / "build" / "smoke"
AT_ONCE = 3
LIMIT_S = 300.0 * float(os.environ.get("MRL_TEST_PATIENCE", "1"))
TAIL_LINES = 15


class Outcome(NamedTuple):
    """What came of a target: its problems, and what it took [s]."""

    target: str
    problems: List[str]
    wall_s: float
    cpu_s: float


def rows() -> Dict[str, Dict[str, Any]]:
    """The rows of the targets that are run; the others say where they are run or why they are not."""
    return {
        name: row for name, row in catalogue()["targets"].items() if "not" not in row and "within" not in row
    }


def judge(names: Sequence[str], folder: Path) -> Iterator[str]:
    """What is wrong with the figures of these tables in a folder."""
    for name in names:
        path = folder / f"{tables()[name].file}.json"
        figures = json.loads(path.read_text()) if path.exists() else {}
        missing = [key for key in promised(name) if key not in figures]
        if missing:
            yield f"{len(missing)} figures of {name} are missing: {', '.join(missing[:4])}"
        for key, (low, high) in promised(name).items():
            value = figures.get(key, low)
            if not math.isfinite(value) or not low <= value <= high:
                yield f"{key} is {value}, expected {low} to {high}"


def run(target: str, row: Mapping[str, Any], folder: Path = FOLDER) -> Outcome:
    figures, log = folder / target, folder / f"{target}.log"
    shutil.rmtree(figures, ignore_errors=True)
    figures.mkdir(parents=True)
    made = [ROOT / file for file in row.get("makes", ())]
    for file in made:
        file.unlink(missing_ok=True)
    begun_s = time.monotonic()
    with log.open("w") as output:
        command = [
            "timeout",
            f"{LIMIT_S:g}",
            "make",
            "--no-print-directory",
            target,
            *row.get("options", ["FAST=1"]),
        ]
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "FIGURES_FOLDER": str(figures)},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = status
    problems = [
        *judge(row.get("tables", ()), figures),
        *(f"{file} is not there" for file in made if not file.exists()),
    ]
    if status:
        tail = log.read_text(errors="replace").splitlines()[-TAIL_LINES:]
        problems = [f"ended with an error; the end of {log.relative_to(folder.parent)}:", *tail, *problems]
    return Outcome(target, problems, time.monotonic() - begun_s, usage.ru_utime + usage.ru_stime)


def main(arguments: Sequence[str]) -> int:
    """Run the named targets, or all; 1 if one fails."""
    chosen = {name: row for name, row in rows().items() if name in arguments or not arguments}
    failed, cpu_s, begun_s = [], 0.0, time.monotonic()
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for done in pool.map(lambda item: run(*item), chosen.items()):
            print(
                f"{done.target:20}{done.wall_s:6.0f} s  CPU {done.cpu_s:5.1f} s  "
                f"{'FAILED' if done.problems else 'passed'}"
            )
            print("".join(f"  {problem}\n" for problem in done.problems), end="", flush=True)
            failed += [done.target] * bool(done.problems)
            cpu_s += done.cpu_s
    print(
        f"{len(chosen)} targets in {time.monotonic() - begun_s:.0f} s, CPU {cpu_s:.0f} s; "
        f"failed: {', '.join(failed) or 'none'}"
    )
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
