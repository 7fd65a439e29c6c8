"""The model of the stop without each guard; `make verify` runs all of it, `make smoke` a short form."""

import shutil
from pathlib import Path

import pytest
import yaml

from tests.long.verify.model.__main__ import CONTROLS, ROOT
from tests.long.verify.model.checker import BUS, CALLBACK, HOST, LINE, PORT, compile_model, run

BUGS = yaml.safe_load((ROOT / "tests/long/verify/seeded_bugs.yaml").read_text())
QUICK_CONTROLS = tuple(control for control in CONTROLS if control[2] in (0, BUS, HOST, CALLBACK, LINE | PORT))


@pytest.fixture(scope="module")
def checker(tmp_path_factory) -> Path:
    if shutil.which("spin") is None:
        pytest.fail("spin is not installed; install it with: make setup")
    return compile_model(tmp_path_factory.mktemp("model"), "-O0")


@pytest.mark.parametrize("number, guard, parts, settings", QUICK_CONTROLS)
def test_without_its_guard_a_property_is_violated(checker, number, guard, parts, settings):
    assert run(checker, parts, BUG=guard, PROPERTIES=1 << (number - 1), **settings).broken == f"P{number}"


def test_each_seeded_bug_is_one_edit_that_the_code_still_has_room_for():
    places = {bug["number"]: (ROOT / bug["file"]).read_text().count(bug["find"]) for bug in BUGS}
    assert places == {number: 1 for number in range(1, 22)}
