"""The figures of the project: their tables in the documents are rendered from docs/figures.

python -m tests.long.bench.figures            renders the tables of `DOCUMENTS`, and the figures of `mrl measure`
python -m tests.long.bench.figures --check    says what is stale; and which make target `make smoke` does not know

`figures.yaml` has the rows of each table.  A figure whose subject has changed since it was measured is marked with the
commit that it is of: a hash of the subject's files tells, which needs no history.
"""

import functools
import hashlib
import json
import math
import re
import sys
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

import yaml

from mrl_driver.apps.measure import report as measure
from mrl_driver.apps.measure.rows import COURSE, KINDS

ROOT = Path(__file__).resolve().parents[3]
KEPT = ROOT / "docs" / "figures"
MEASURED, ROBOTS = ROOT / "docs" / "measured", ROOT / "docs" / "robots"
EMULATED = ROOT / "mrl_driver" / "apps" / "measure" / "emulated.json"
"""Figures that the product needs, without docs/figures next to it."""
DOCUMENTS = (
    *("README.md", "BENCHMARKS.md", "docs/command_line.md", "docs/experiments.md", "docs/measured/README.md"),
    *("docs/raspberry_pi.md", "docs/robots/kits.md", "ros1_bridge/README.md"),
)
_REGION = re.compile(r"(<!-- figures: ([\w-]+) -->\n).*?(<!-- end of figures -->)", re.DOTALL)
_NAMED = re.compile(r"\{([\w-]+)/([\w.-]+?)(?: / (\d+))?\}")
MISSED = " **missed**"
Records = Mapping[str, Mapping[str, Any]]
"""Figures by key: `value`; if known `runs`, `spread`, `commit`, `date`, `compiler`, `cpu`, and the hash `subject`."""


class Row(NamedTuple):
    """A figure of a table.

    Attributes:
        range: What is plausible, in a short run too.
        goal: Such as `<= 300`; empty if there is none.
        limit: What physics allows.
        beside: Key of its reference in the same run.
        only: The one column that has it; empty for all.
    """

    key: str
    text: str
    range: Tuple[float, float]
    goal: str = ""
    limit: str = ""
    beside: str = ""
    only: str = ""

    def is_missed(self, figure: Mapping[str, Any]) -> bool:
        """Whether the goal is missed, in one run at least if the figure has no median."""
        sign, _, limit = self.goal.partition(" ")
        values = figure.get("spread", []) if figure["value"] is None else [figure["value"]]
        return bool(sign) and any(v > float(limit) if sign == "<=" else v < float(limit) for v in values)


class Table(NamedTuple):
    """Figures of one file.

    Attributes:
        columns: Key of a row's figure by heading; `*` stands for the row's key.
        history: The same for figures that a run need not give.
        subject: Files and folders that the figures depend on.
    """

    file: str
    rows: Sequence[Row]
    columns: Mapping[str, str]
    history: Mapping[str, str]
    reference: str
    subject: Sequence[str]

    def keys(self, row: Row) -> Dict[str, str]:
        """Key by heading, of the figures that a run must give."""
        own = {heading: key.replace("*", row.key) for heading, key in self.columns.items()}
        return {heading: key for heading, key in own.items() if row.only in ("", heading)}


@functools.lru_cache(maxsize=None)
def catalogue() -> Any:
    """The whole of `figures.yaml`."""
    return yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))


@functools.lru_cache(maxsize=None)
def tables() -> Dict[str, Table]:
    found = {}
    for name, one in catalogue()["tables"].items():
        rows = [
            Row(key, range=tuple(row.pop("range")), text=row.pop("text", key), **row)
            for key, row in ((key, dict(row)) for key, row in one["rows"].items())
        ]
        columns, history = one.get("columns", {"measured": "*"}), one.get("history", {})
        reference = one.get("reference", "reference")
        found[name] = Table(one["file"], rows, columns, history, reference, one["subject"])
    return found


def promised(name: str) -> Dict[str, Tuple[float, float]]:
    """Plausible ranges of the figures of a table, which a run must give, by key."""
    table = tables()[name]
    return {key: row.range for row in table.rows for key in table.keys(row).values()}


def number(value: float) -> str:
    """A figure in three or four digits, a count in all of them, a share near 1 in four."""
    if not math.isfinite(value):
        return str(value)
    if value == int(value) or abs(value) >= 1000:
        return f"{value:,.0f}".replace(",", " ") if abs(value) >= 10000 else f"{value:.0f}"
    return f"{value:.1f}" if abs(value) >= 100 else f"{value:.{4 if 0.99 <= value < 1 else 3}g}"


def shown_figure(figure: Mapping[str, Any]) -> str:
    spread = " to ".join(map(number, figure.get("spread", ())))
    if figure["value"] is None or isinstance(figure["value"], str):
        return figure["value"] or spread
    return number(figure["value"]) + (f" ({spread})" if spread else "")


def lines(table: Table, records: Records) -> Iterator[List[str]]:
    """The cells of the heading and of each row, without the commits."""
    has_goal, has_limit, has_reference = (
        any(getattr(row, name) for row in table.rows) for name in ("goal", "limit", "beside")
    )
    yield [
        "figure", *["goal"] * has_goal, *table.columns, *[table.reference] * has_reference, *table.history,
        *["limit"] * has_limit,
    ]  # fmt: skip
    for row in table.rows:
        keys = table.keys(row)

        def cell(key: str, row: Row = row) -> str:
            figure = records.get(key)
            return shown_figure(figure) + MISSED * row.is_missed(figure) if figure else ""

        yield [
            row.text,
            *[row.goal] * has_goal,
            *(cell(keys[heading]) if heading in keys else "" for heading in table.columns),
            *[shown_figure(records[row.beside]) if row.beside in records else ""] * has_reference,
            *(shown_figure(records[key]) if key in records else ""
              for key in (key.replace("*", row.key) for key in table.history.values())),
            *[row.limit] * has_limit,
        ]  # fmt: skip


def shown(file: str, records: Records) -> Iterator[str]:
    """The tables of a file for a terminal, then the figures that are in none."""
    listed = set()
    for table in (table for table in tables().values() if table.file == file):
        if not any(key in records for row in table.rows for key in table.keys(row).values()):
            continue
        cells = list(lines(table, records))
        widths = [max(map(len, column)) for column in zip(*cells)]
        for row in cells:
            yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
        listed |= {key for row in table.rows for key in (*table.keys(row).values(), row.beside)}
    for key in records:
        if key not in listed:
            yield f"{key} {shown_figure(records[key])}"


def missed(file: str, records: Records) -> List[str]:
    return [
        key
        for table in tables().values()
        if table.file == file
        for row in table.rows
        for key in table.keys(row).values()
        if key in records and row.is_missed(records[key])
    ]


# -- documents


@functools.lru_cache(maxsize=None)
def kept(file: str) -> Dict[str, Any]:
    """The figures of docs/figures/`file`.json; none if no run has written it yet."""
    path = KEPT / f"{file}.json"
    found: Dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return found


bytes_of = functools.lru_cache(maxsize=None)(Path.read_bytes)


@functools.lru_cache(maxsize=None)
def contents(subject: Tuple[str, ...], root: Path = ROOT) -> str:
    """A hash of names and bytes of the files of a subject, without documents and what is rendered from figures."""
    found, whole = {root / each for each in subject}, hashlib.sha256()
    files = found.union(*(each.rglob("*") for each in found))
    for path in sorted(each for each in files if not each.is_dir()):
        name = path.relative_to(root)
        if "__pycache__" not in name.parts and path.suffix != ".md" and root / name != EMULATED:
            whole.update(f"{name} {len(bytes_of(path))} ".encode() + bytes_of(path))
    return whole.hexdigest()[:16]


def subjects(file: str) -> Dict[str, Dict[str, str]]:
    """The hashes of what the figures of a file depend on, as their `subject`, by key."""
    own = [table for table in tables().values() if table.file == file]
    return {
        key: {"subject": contents(tuple(table.subject))}
        for table in own
        for row in table.rows
        for key in table.keys(row).values()
    }


def commits(table: Table, figures: Sequence[Mapping[str, Any]]) -> str:
    """The commits of those figures whose subject has changed since, or that have no hash of it."""
    now = contents(tuple(table.subject))
    return ", ".join(sorted({each["commit"] for each in figures if each.get("subject") != now}))


def rendered(name: str) -> str:
    """A table in Markdown, and what was measured when and where."""
    if name in catalogue()["written"]:
        return "\n".join(_markdown(list(_written(name))))
    if name in ("boards", "kits"):
        found = _boards(MEASURED) if name == "boards" else _boards(ROBOTS, COURSE)
        return "\n".join(_markdown(list(found)))
    table, records = tables()[name], kept(tables()[name].file)
    rows = list(lines(table, records))
    used = [[records[key] for key in table.keys(row).values() if key in records] for row in table.rows]
    marked = [[*rows[0], "of commit"]]
    for cells, own in zip(rows[1:], used):
        marked.append([*cells, commits(table, own) if own else "not measured"])
    figures = [each for own in used for each in own]
    facts = [
        sorted({each[fact] for each in figures if each.get(fact)}) for fact in ("date", "compiler", "cpu")
    ]
    dates = " to ".join(dict.fromkeys((facts[0][0], facts[0][-1]))) if facts[0] else ""
    measured = "; ".join(filter(None, (dates, *map(", ".join, facts[1:])))) or "not yet"
    return "\n".join([*_markdown(marked), "", f"Measured: {measured}."])


def _boards(folder: Path, section: str = "") -> Iterator[List[str]]:
    """The rows of all measurements in a folder: all next to the emulated figures, or those of one section."""
    boards = {path.stem: measure.load(str(path)) for path in sorted(folder.glob("*.json"))}
    whole = not section
    yield ["figure", *["emulated"] * whole, *boards]
    yield ["what it is", *["simulated chip"] * whole, *(one["about"] for one in boards.values())]
    dates = (f"{one['made'][:10]}, {one['mrl_driver']}" for one in boards.values())
    yield ["measured", *[""] * whole, *dates]
    found = [{row["key"]: row for row in one["rows"]} for one in boards.values()]
    for key, kind in KINDS.items():
        cells = [_measured(each[key]) if key in each else "" for each in found]
        emulated = {each[key]["emulated"] for each in found if key in each} - {None}
        if any(cells) and section in ("", kind.section):
            text = f"{kind.text} [{kind.unit}]" if kind.unit else kind.text
            expected = " or ".join(dict.fromkeys(map(number, sorted(emulated))))
            yield [text, *[expected] * whole, *cells]


def _measured(row: Mapping[str, Any]) -> str:
    value = row["value"]
    return "" if value is None else measure.number(value) + " **worse**" * (row["verdict"] == "worse")


def emulated_text() -> str:
    """What `EMULATED` must hold: the newest values of the figures that it names."""
    named = [name.split("/") for name in json.loads(EMULATED.read_text(encoding="utf-8"))]
    rows = [f'"{file}/{key}": {json.dumps(kept(file)[key]["value"])}' for file, key in named]
    return "{\n" + ",\n".join(rows) + "\n}\n"


def _markdown(rows: Sequence[Sequence[str]]) -> List[str]:
    return [f"| {' | '.join(row)} |" for row in (rows[0], ["---"] * len(rows[0]), *rows[1:])]


def _written(name: str) -> Iterator[List[str]]:
    """The heading and the rows of a table of the README; `{file/key / 1000}` is a figure in another unit."""
    rows = {
        (table.file, key): row
        for table in tables().values()
        for row in table.rows
        for key in table.keys(row).values()
    }
    for cells in catalogue()["written"][name]:
        named = [match[:2] for match in _NAMED.findall(cells[1])]
        late = any(rows[each].is_missed(kept(each[0])[each[1]]) for each in named)
        filled = [_NAMED.sub(_filled, cell) for cell in cells]
        yield [filled[0], filled[1] + MISSED * late, filled[2]]


def _filled(found: "re.Match[str]") -> str:
    value = kept(found[1])[found[2]]["value"]
    return value if isinstance(value, str) else number(value / int(found[3] or 1))


def with_tables(text: str) -> str:
    return _REGION.sub(lambda found: f"{found[1]}{rendered(found[2])}\n{found[3]}", text)


def stale() -> List[str]:
    """Documents whose tables differ from docs/figures."""
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in DOCUMENTS}
    differing = [name for name, text in texts.items() if text != with_tables(text)]
    if EMULATED.read_text(encoding="utf-8") != emulated_text():
        differing.append(str(EMULATED.relative_to(ROOT)))
    return [f"{name}: a table differs from docs/figures; make figures renders it" for name in differing]


def unknown_targets() -> List[str]:
    """Make targets that are not in the table of `make smoke`, and the other way round."""
    makefiles = [ROOT / "Makefile", *ROOT.glob("*/*.mk")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in makefiles)
    named = set(re.findall(r"^([a-z][\w-]*):.*## ", text, re.MULTILINE))
    known = set(catalogue()["targets"])
    return [
        *(
            f"make {name}: expected a row with its short form in {Path(__file__).stem}.yaml"
            for name in sorted(named - known)
        ),
        *(f"figures.yaml: make {name} does not exist; take the row out" for name in sorted(known - named)),
    ]


def main(arguments: Sequence[str]) -> int:
    """Render, or check; 1 if something is stale."""
    if "--check" in arguments:
        wrong = [*stale(), *unknown_targets()]
        print("\n".join(wrong), end="\n" * bool(wrong), file=sys.stderr)
        return int(bool(wrong))
    for name in DOCUMENTS:
        path = ROOT / name
        path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
    EMULATED.write_text(emulated_text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
