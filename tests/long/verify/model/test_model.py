"""The model of the stop, in a short form; `make verify` runs all of it."""

import shutil
from pathlib import Path

import pytest
import yaml

from tests.long.verify.explorer.to_model import script_of
from tests.long.verify.model.__main__ import CONTROLS, ROOT
from tests.long.verify.model.checker import (
    BRIDGE,
    BUS,
    CALLBACK,
    HOST,
    LINE,
    PORT,
    Tick,
    compile_model,
    follow,
    run,
)

BUGS = yaml.safe_load((ROOT / "tests/long/verify/seeded_bugs.yaml").read_text())
QUICK_BUGS = ((4, LINE), (6, 0), (10, LINE | PORT), (11, BRIDGE), (21, CALLBACK))
"""Seeded bugs that are found within a tenth of a second, and what may happen then."""
COAST_M = 0.01  # The wheels turn at most this far while they slow down [m]
QUICK_CONTROLS = tuple(control for control in CONTROLS if control[2] in (0, BUS, HOST, CALLBACK, LINE | PORT))


@pytest.fixture(scope="module")
def checker(tmp_path_factory) -> Path:
    if shutil.which("spin") is None:
        pytest.fail("spin is not installed; install it with: make setup")
    return compile_model(tmp_path_factory.mktemp("model"), "-O0")


def test_the_real_design_holds_all_properties_while_the_host_is_paused_killed_or_suspended(checker):
    result = run(checker, HOST)
    assert (result.broken, result.complete) == ("", True)
    assert result.states > 10_000


@pytest.mark.parametrize("number, guard, parts, settings", QUICK_CONTROLS)
def test_without_its_guard_a_property_is_violated(checker, number, guard, parts, settings):
    assert run(checker, parts, BUG=guard, PROPERTIES=1 << (number - 1), **settings).broken == f"P{number}"


@pytest.mark.parametrize("number, parts", QUICK_BUGS)
def test_a_seeded_bug_is_found(checker, number, parts):
    assert run(checker, parts, BUG=number).broken


def test_a_counterexample_is_a_sequence_of_events_with_times(checker):
    assert run(checker, LINE | PORT, BUG=10).trace == (
        "    0 ms  drive",
        "   50 ms  the port goes away",
        "  100 ms  the port comes back",
        "  100 ms  the bytes to the board are lost",
        "  100 ms  P4 violated",
    )


@pytest.mark.parametrize(
    "path, bug, broken", [("dX", 1, "P1"), ("dlsW", 7, "P5"), ("id", 11, "P4"), ("ow", 13, "P7")]
)
def test_a_sequence_that_finds_a_bug_in_the_real_code_finds_it_in_the_model_and_holds_without_it(
    checker, path, bug, broken
):
    script = script_of(path)
    assert (follow(checker, script, BUG=bug), follow(checker, script)) == (broken, "")


def test_a_callback_that_hangs_does_so_in_the_ticks_of_what_follows():
    hangs = Tick(other="HANGS")
    assert script_of("hdc") == [
        *3 * [hangs],
        hangs._replace(user="DRIVE"),
        *(Tick(other="UNPLUG"), hangs, Tick(other="PLUG")),
    ]
    assert script_of("hPw") == [*3 * [hangs], *6 * [Tick(other="STOPPED")], Tick(), Tick()]


def test_a_fault_of_the_next_tick_joins_the_event_that_follows():
    assert script_of("lmds") == [Tick("CUT_BOTH", user="DRIVE"), Tick(user="STOP")]


def test_each_seeded_bug_is_one_edit_that_the_code_still_has_room_for():
    places = {bug["number"]: (ROOT / bug["file"]).read_text().count(bug["find"]) for bug in BUGS}
    assert places == {number: 1 for number in range(1, 22)}
