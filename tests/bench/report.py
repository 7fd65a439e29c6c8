"""Benchmark figures as flat JSON under build/bench/."""

import json
import os
import pathlib
import statistics
from typing import Callable, Dict, Union

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "build" / "bench"


def write(name: str, figures: Dict[str, Union[int, float]]) -> pathlib.Path:
    """Puts `figures` into build/bench/`name`.json; keys of earlier runs that are not among them stay."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    new = path.with_name(f".{name}.{os.getpid()}")
    new.write_text(json.dumps({**known, **figures}, indent=2, sort_keys=True) + "\n")
    new.replace(path)
    return path


def median_of(runs: int, measure: Callable[[], float]) -> float:
    """Median of `runs` measurements."""
    return statistics.median(measure() for _ in range(runs))
