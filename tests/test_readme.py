"""The tests that README.md names are there."""

import pathlib
import re

import pytest

FOLDER = pathlib.Path(__file__).parent
NAMED = sorted(set(re.findall(r"`([\w/]+\.py)::(\w+)`", (FOLDER / "README.md").read_text(encoding="utf-8"))))


@pytest.mark.parametrize("file", sorted({file for file, _ in NAMED}))
def test_named_tests_exist(file):
    text = (FOLDER / file).read_text(encoding="utf-8")
    assert [name for where, name in NAMED if where == file and f"\ndef {name}(" not in text] == []


def test_every_fault_has_a_test():
    rows = re.findall(
        r"^\|(?! fault| from|---)(.*)\|$", (FOLDER / "README.md").read_text(encoding="utf-8"), re.M
    )
    assert len(rows) == 43 + 10 and all("::test_" in row for row in rows)
