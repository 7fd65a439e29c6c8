"""Benchmark figures as flat JSON under build/bench/."""

import json
import os
import pathlib
import statistics
import sys
from typing import Callable, List, Mapping, TypeVar, Union

Figures = TypeVar("Figures")
FOLDER = pathlib.Path(__file__).resolve().parents[2] / "build" / "bench"


def write(name: str, figures: Mapping[str, Union[int, float, str]]) -> pathlib.Path:
    """Puts `figures` into build/bench/`name`.json; keys of earlier runs that are not among them stay."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    new = path.with_name(f".{name}.{os.getpid()}")
    new.write_text(json.dumps({**known, **figures}, indent=2, sort_keys=True) + "\n")
    new.replace(path)
    return path


def repeat(name: str, runs: int, measure: Callable[[], Figures]) -> List[Figures]:
    """What `runs` measurements give; each is announced on stderr, for they take long."""
    found = []
    for number in range(1, runs + 1):
        print(f"{name}: run {number} of {runs}", file=sys.stderr, flush=True)
        found.append(measure())
    return found


def median_of(name: str, runs: int, measure: Callable[[], float]) -> float:
    """Median of `runs` measurements."""
    return statistics.median(repeat(name, runs, measure))
