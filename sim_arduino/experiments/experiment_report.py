"""The result of an experiment: our figures and the published ones, a picture, a JSON file."""

import json
import os
from typing import List, NamedTuple, Optional, Sequence, Union

from mrl_driver.files import replace_file

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
