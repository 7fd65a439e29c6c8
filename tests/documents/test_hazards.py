"""docs/hazards.md: its tests, properties and links to figures are those of the project."""

import re

import pytest

from .blocks import ROOT

TEXT = (ROOT / "docs" / "hazards.md").read_text(encoding="utf-8")
BENCHMARKS = (ROOT / "BENCHMARKS.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`([\w/]+\.py)::(\w+)`", TEXT)))
ROWS = [
    [cell.strip() for cell in row.split("|")] for row in re.findall(r"^\|( \d+ \|.*)\|$", TEXT, re.MULTILINE)
]
PROPERTIES = set(
    re.findall(
        r"\bP\d\b",
        (ROOT / "tests/long/verify/README.md").read_text(encoding="utf-8").split("## The model")[0],
    )
)
SECTIONS = dict(re.findall(r"^\[(\w+)\]: \.\./BENCHMARKS\.md#(.*)$", TEXT, re.MULTILINE))


@pytest.mark.parametrize("file", sorted({file for file, _ in NAMED}))
def test_named_tests_exist(file):
    text = (ROOT / "tests" / file).read_text(encoding="utf-8")
    assert [name for where, name in NAMED if where == file and f"\ndef {name}(" not in text] == []


def test_each_hazard_has_a_number_a_guard_a_limit_and_a_test():
    """The first 34 are the faults that a soak counts."""
    assert [int(row[0]) for row in ROWS] == list(range(1, len(ROWS) + 1)) and len(ROWS) >= 53
    assert [row[0] for row in ROWS if len(row) != 7 or not all(row) or "::test_" not in row[6]] == []


def test_each_property_is_one_that_is_verified_and_each_has_a_hazard():
    named = {each for row in ROWS for each in row[4].split()} - {"-"}
    assert named == PROPERTIES == {f"P{number}" for number in range(1, 8)}


def section(anchor):
    """The section of BENCHMARKS.md with this anchor."""
    parts = re.split(r"^## (.*)$", BENCHMARKS, flags=re.MULTILINE)
    titles = {
        re.sub(r"[^\w -]", "", title).lower().replace(" ", "-"): text
        for title, text in zip(parts[1::2], parts[2::2])
    }
    return titles[anchor]


@pytest.mark.parametrize("row", [row for row in ROWS if row[5] != "test"], ids=lambda row: row[0])
def test_what_is_measured_is_in_the_benchmarks(row):
    """The figures are there alone."""
    sources = row[5].split(", ")
    assert sources and all(section(SECTIONS[source[1:-1]]) for source in sources)


def test_all_inputs_that_are_refused_have_tests():
    rows = re.findall(
        r"^\| [^|]+ \| (`[^|]*::test_[^|]*) \|$", TEXT.split("## Input that is refused")[1], re.M
    )
    assert len(rows) == 10
