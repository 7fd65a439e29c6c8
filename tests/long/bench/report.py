"""What a bench measures: repeated, printed beside goal and reference, and written as JSON.

`figures.yaml` has the figures' names, goals and plausible ranges.  With FAST=1 a bench measures in its shortest form;
with KEEP=1 its figures go to docs/figures, from which `make figures` renders the tables of the documents.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any, Callable, Dict, Iterable, List, Mapping, Sequence, TypeVar, Union

from tests.long.bench import figures
from tests.long.bench.figures import KEPT, ROOT

FOLDER = Path(os.environ.get("FIGURES_FOLDER") or ROOT / "build" / "bench")
FAST = os.environ.get("FAST") == "1"
KEEP = os.environ.get("KEEP") == "1"
Number = Union[int, float]
Measured = Union[Number, Sequence[Number], str, Mapping[str, Any]]
"""A figure, its values in several runs, the words of others, or `value` and `spread`."""
Item = TypeVar("Item")
for _table in figures.tables().values() if KEEP else ():
    figures.contents(tuple(_table.subject))  # remembered as it is before anything is measured


def either(full: Item, short: Item) -> Item:
    """The first, or with FAST=1 the second."""
    return short if FAST else full


def repeat(name: str, runs: int, measure: Callable[[], Item]) -> List[Item]:
    """What `runs` measurements give; each is announced on stderr, for they take long."""
    found = []
    for number in range(1, runs + 1):
        print(f"{name}: run {number} of {runs}", file=sys.stderr, flush=True)
        found.append(measure())
    return found


def by_key(runs: Iterable[Mapping[str, Number]]) -> Dict[str, Measured]:
    found: Dict[str, List[Number]] = {}
    for run in runs:
        for key, value in run.items():
            found.setdefault(key, []).append(value)
    return dict(found)


def conclude(name: str, measured: Mapping[str, Measured]) -> int:
    """Prints the figures and writes them to build/bench/`name`.json; 1 if a full run misses a goal, else 0.

    Figures of earlier runs that are not among them stay in the file.
    """
    records = {key: record(value) for key, value in measured.items()}
    for line in figures.shown(name, records):
        print(line)
    missed = figures.missed(name, records)
    write(FOLDER / f"{name}.json", {key: each["value"] for key, each in records.items()})
    if KEEP and not FAST:
        about, subjects = origin(), figures.subjects(name)
        kept = {key: {**each, **about, **subjects.get(key, {})} for key, each in records.items()}
        write(KEPT / f"{name}.json", kept)
    return int(bool(missed) and not FAST)


def record(measured: Measured) -> Dict[str, Any]:
    """A figure: the median of its runs, their number, and their smallest and largest value."""
    if isinstance(measured, str):
        return {"value": measured}
    if isinstance(measured, Mapping):
        return dict(measured)
    if not isinstance(measured, Sequence):
        return {"value": rounded(measured)}
    if len(measured) == 1:
        return {"value": rounded(measured[0]), "runs": 1}
    spread = [rounded(min(measured)), rounded(max(measured))]
    return {"value": rounded(median(measured)), "runs": len(measured), "spread": spread}


def rounded(value: Number) -> Number:
    """Five digits; a whole number stays."""
    return value if isinstance(value, int) else float(f"{value:.5g}")


def origin() -> Dict[str, str]:
    """Commit, date, compiler and processor of what is measured; the hash of its files says whether it has changed.

    The figures that another bench has just written are no change.
    """
    changed = _said("git", "diff", "--name-only", "HEAD", "--", ".", ":!docs/figures")
    return {
        "commit": _said("git", "rev-parse", "--short", "HEAD") + ("-dirty" if changed else ""),
        "date": time.strftime("%Y-%m-%d"),
        "compiler": _said("avr-gcc", "--version"),
        "cpu": next(
            (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")),
            "",
        ),
    }


def _said(*command: str) -> str:
    try:
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.partition("\n")[0]


def write(path: Path, figures: Mapping[str, Any]) -> None:
    """Puts figures into a file, one a line; what else it has stays.  A reader sees the old file or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    known = {**(json.loads(path.read_text()) if path.exists() else {}), **figures}
    lines = [f"{json.dumps(key)}: {json.dumps(known[key])}" for key in sorted(known)]
    new = path.with_name(f".{path.name}.{os.getpid()}")
    new.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    new.replace(path)
