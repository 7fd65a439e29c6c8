"""The runs of an experiment over many seeds, and its result: our figures and the published ones, pictures, JSON."""

import json
import os
from statistics import median
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, TypeVar, Union

from mrl_driver.files import replace_file

from .experiment_robot import Setting

SEEDS = 10  # runs of an experiment, each with random numbers of its own
_APART = 1000  # the seeds of two settings differ from each other if theirs do
_T = TypeVar("_T")
Number = Union[int, float, str]


class Figure(NamedTuple):
    """One figure."""

    key: str  # its name in the JSON file
    text: str
    ours: Number  # its value; the median if there are several seeds
    unit: str = ""
    published: str = ""  # value in the papers, as printed there; empty if they give none
    worst: Optional[Number] = None  # the worst value of all seeds
    control: Optional[Number] = None  # median of the same runs without the feature under test
    seeds: int = 1  # number of runs, each with random numbers of its own
    put_in: bool = False
    """Whether the emulator contains the value, or one fitted to it, so that it proves nothing."""


class Measure(NamedTuple):
    """A figure of many runs.

    Attributes:
        of: Computes its value of a run; by default it is the attribute `key` of the run.
        worst: Picks the worst value: `max` for errors, `min` for shares found.
        published, put_in: As in `Figure`.
    """

    key: str
    text: str
    unit: str = ""
    of: Optional[Callable[[Any], float]] = None
    worst: Callable[[Sequence[float]], float] = max
    published: str = ""
    put_in: bool = False

    def figure(self, runs: Sequence[Any], control: Sequence[Any] = ()) -> Figure:
        """Median and worst value of runs; `control` are the runs without the feature under test, if there are any."""
        values, others = ([self._value(run) for run in each] for each in (runs, control))
        beside = median(others) if others else None
        worst, middle = self.worst(values), median(values)
        return Figure(
            self.key, self.text, middle, self.unit, self.published, worst, beside, len(values), self.put_in
        )

    def _value(self, run: Any) -> Any:
        return self.of(run) if self.of else getattr(run, self.key)


def figures(measures: Sequence[Measure], runs: Sequence[Any], control: Sequence[Any] = ()) -> List[Figure]:
    """The figures of runs, one for each measure."""
    return [each.figure(runs, control) for each in measures]


def over_seeds(run: Callable[[Setting], _T], setting: Setting, count: int = 0) -> List[_T]:
    """The results of `count` or `SEEDS` runs, or of as many as the setting asks for, each with a seed of its own."""
    numbers = range(setting.seeds or count or SEEDS)
    return [run(setting._replace(seed=_APART * setting.seed + number)) for number in numbers]


# ---- results


class Result(NamedTuple):
    """Result of one experiment."""

    name: str
    title: str
    rows: Sequence[Figure]
    pictures: Sequence[str] = ()  # names of the files drawn, in the folder of the report
    remark: str = ""  # note for the comparison


HEADINGS = ("figure", "ours", "worst", "control", "published")


def cells(row: Figure) -> List[str]:
    """A figure as text, under `HEADINGS`; the values with their unit."""
    ours, worst, control = (_value(each, row.unit) for each in (row.ours, row.worst, row.control))
    if worst and row.seeds > 1:
        worst += f" of {row.seeds}"
    if row.put_in:
        ours += " (put in)"
    return [row.text, ours, worst, control, row.published]


def _value(number: Optional[Number], unit: str) -> str:
    if number is None:
        return ""
    value = f"{number:.4g}" if isinstance(number, float) else str(number)
    return f"{value} {unit}".strip()


def save(result: Result, folder: str) -> None:
    """Writes `NAME.json`, and the report of all results in the folder; OutputError if one cannot be written."""
    data = {**result._asdict(), "rows": [row._asdict() for row in result.rows]}
    replace_file(os.path.join(folder, f"{result.name}.json"), json.dumps(data, indent=1) + "\n")
    replace_file(os.path.join(folder, "report.md"), _report(folder))


def read(folder: str, name: str) -> Optional[Result]:
    """A saved result; None if there is none."""
    try:
        with open(os.path.join(folder, f"{name}.json"), encoding="utf-8") as file:
            data = json.load(file)
    except OSError:
        return None
    return Result(**{"name": name, **data, "rows": [Figure(**row) for row in data["rows"]]})


def _report(folder: str) -> str:
    names = sorted(file[:-5] for file in os.listdir(folder) if file.endswith(".json"))
    parts = ["# Experiments\n"]
    for result in filter(None, (read(folder, name) for name in names)):
        lines = [HEADINGS, ["---"] * len(HEADINGS), *map(cells, result.rows)]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        parts.append(f"## {result.title}\n\n{table}\n")
        parts += [f"{result.remark}\n"] if result.remark else []
        parts += [f"![{result.title}]({picture})\n" for picture in result.pictures]
    return "\n".join(parts)
