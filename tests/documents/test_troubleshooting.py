"""Codes of messages, and the table that explains them, from which docs/troubleshooting.md is rendered."""

import ast
import functools
import re

import pytest
from click.testing import CliRunner

from mrl_driver import errors
from mrl_driver.cli.main import cli
from mrl_driver.problems import PLACEHOLDERS, PROBLEMS
from mrl_driver.view.words import STOPS, stopped_text

from .blocks import ROOT

PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")
TABLE = ROOT / "mrl_driver" / "problems.py"
ERRORS = [
    each for each in vars(errors).values() if isinstance(each, type) and issubclass(each, errors.MrlError)
]
REVIEW = "".join(each.read_text() for each in (ROOT / "mrl_driver/apps/review/findings").glob("*.py"))
FROM_THE_TABLE = {code for code in PROBLEMS if f'"{code}"' in REVIEW or code.startswith("battery_")}
FROM_THE_TABLE |= {"imu_dead", "imu_frozen", "imu_wrong", "imu_tilted"}
"""Codes whose message is read from the table."""


def text_of(node):
    """A string as it is shown, with a mark for each value in it."""
    if isinstance(node, ast.JoinedStr):
        return "".join(text_of(each) for each in node.values)
    if isinstance(node, ast.Constant):
        return str(node.value)
    return "\0"


@functools.lru_cache(maxsize=None)
def sources():
    """The strings of all modules but the table, one a line."""
    found = []
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if path != TABLE:
                tree = ast.parse(path.read_text(encoding="utf-8"))
                found += [
                    text_of(node)
                    for node in ast.walk(tree)
                    if isinstance(node, (ast.JoinedStr, ast.Constant))
                ]
    return "\n".join(text.replace("\n", " ") for text in found)


MESSAGES = [(row.code, text) for row in PROBLEMS.values() for text in (row.message, *row.also)]
STOPPED = {stopped_text(reason) for reason in STOPS}


def test_the_messages_are_those_that_users_see():
    """A changed message must be changed in the table too."""
    holes, unseen = re.compile("|".join(PLACEHOLDERS)), []
    for code, text in MESSAGES:
        parts = [re.escape(part) for part in holes.split(text)]
        if text not in STOPPED and not re.search("[^\n]*".join(parts), sources(), re.IGNORECASE):
            unseen.append((code, text))
    assert {code for code, _ in unseen} - FROM_THE_TABLE == set(), unseen


@pytest.mark.parametrize("kind", ERRORS, ids=lambda each: each.__name__)
def test_an_errors_code_is_a_row(kind):
    assert not kind.code or kind.code in PROBLEMS
    assert kind("text").line == (f"text  [{kind.code}]" if kind.code else "text")


@pytest.mark.parametrize("word", ["port_busy", "[port_busy]", "port-busy"])
def test_explain_prints_cause_and_remedy(word):
    row, done = PROBLEMS["port_busy"], CliRunner().invoke(cli, ["explain", word])
    assert done.exit_code == 0 and row.cause in done.output and row.advice in done.output
