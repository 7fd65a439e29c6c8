"""`python -m tests.long.verify.model`: the model of the stop to its fixed points, without each guard, with each bug.

python -m tests.long.verify.model              everything; build/verify/model.json, build/bench/verify.json
python -m tests.long.verify.model --bug 7      one seeded bug, with its sequence of events
"""

import argparse
import json
import pathlib
import sys
from typing import Dict, List, Tuple

import yaml

from tests.long.bench import report

from .checker import (
    BOARD,
    BRIDGE,
    BUS,
    CALLBACK,
    HOLDS,
    HOST,
    LINE,
    NO_BASELINE,
    NO_COMMAND_BEFORE,
    NO_FORGET,
    NO_MOTOR_TIMEOUT,
    NO_REASON,
    NO_REFUSAL,
    NO_RELEASE,
    NO_REPEAT,
    NO_TIMEOUT,
    NO_WATCHDOG,
    PORT,
    Result,
    compile_model,
    run,
    words,
)

ROOT = pathlib.Path(__file__).resolve().parents[4]
BUILD = ROOT / "build" / "verify"
EACH = LINE | BUS | HOST | PORT | BOARD | HOLDS
FIXED_POINTS: Tuple[Tuple[int, Dict[str, int]], ...] = (
    *((LINE | BUS | HOST, {"TICKS": ticks}) for ticks in (1, 2, 4, 10, 20)),
    (LINE | PORT, {"BOTH": 1}),
    (EACH, {"TICKS": 2}),
    (EACH, {}),
    (LINE | BUS | HOST, {"OLDER": 1}),
    (LINE | BRIDGE, {}),
    (HOST | BRIDGE, {}),
    *((CALLBACK | part, {}) for part in (LINE, HOST, BUS, PORT, BRIDGE)),
)
"""Runs without a bug: what may happen, and settings.  TICKS is the command timeout.  OLDER is firmware from before the
board's own stops were final.
"""
FED_BLINDLY = 21  # A seeded bug that removes a guard
CONTROLS: Tuple[Tuple[int, int, int, Dict[str, int]], ...] = (
    (1, NO_WATCHDOG, LINE, {}),
    (1, NO_MOTOR_TIMEOUT, BUS, {}),
    (2, NO_TIMEOUT, 0, {}),
    (3, NO_WATCHDOG, HOST, {}),
    (4, NO_REFUSAL, LINE, {}),
    (4, NO_REFUSAL, BUS, {}),
    (4, NO_FORGET, LINE | PORT, {"OLDER": 1}),
    (5, NO_REPEAT, LINE, {}),
    (6, NO_REASON, 0, {}),
    (7, NO_BASELINE, LINE | PORT, {}),
    (8, NO_RELEASE, BUS, {}),
    (9, FED_BLINDLY, CALLBACK, {}),
    (9, NO_COMMAND_BEFORE, LINE | CALLBACK, {}),
)
"""Property, the guard that is removed, what may happen, and settings."""
SHORT_BUGS = {4: LINE, 6: 0, 10: LINE | PORT, 11: BRIDGE, 21: CALLBACK}
"""With FAST=1: bugs that are found within a tenth of a second, and what may happen then."""
LADDER = (0, LINE, HOST, CALLBACK, LINE | PORT, BRIDGE, LINE | BUS | HOST, LINE | PORT | BRIDGE, EACH)
"""A bug is searched with these parts, one after the other, until it is found."""
FINDINGS = (
    ("P4 over UDP", LINE, {"UDP": 1}),
    ("P2 over UDP", LINE, {"UDP": 1, "PROPERTIES": 2}),
    ("P9 while the board restarts", BOARD | CALLBACK, {"PROPERTIES": 256}),
)
"""What the real design does not hold; see the README."""


def main(arguments: List[str]) -> int:
    """Run what is asked for; the exit code is 0 if all properties hold, and all guards and bugs are noticed."""
    parser = argparse.ArgumentParser(prog="python -m tests.long.verify.model")
    parser.add_argument("--bug", type=int, help="number of one seeded bug")
    number = parser.parse_args(arguments).bug
    checker = compile_model(BUILD, *report.either((), ("-O0",)))
    bugs = yaml.safe_load((ROOT / "tests/long/verify/seeded_bugs.yaml").read_text())
    rows: List[Dict[str, object]] = []
    not_expected = 0

    def note(what: str, parts: int, result: Result, expected: bool) -> None:
        nonlocal not_expected
        not_expected += not expected
        outcome = result.broken or ("holds, fixed point" if result.complete else "NOT COMPLETE")
        print(
            f"{what:44} {words(parts):36} {outcome:18} {result.states:>9} states, depth {result.depth}, "
            f"{result.seconds:.1f} s, {result.memory_mb:.0f} MB{'' if expected else '   <- not expected'}",
            flush=True,
        )
        rows.append({"what": what, "parts": words(parts), "outcome": outcome, **result._asdict()})
        if result.trace and (number is not None or what.startswith("P")):
            print("\n".join(f"    {event}" for event in result.trace))

    if number is None:
        for parts, settings in report.either(FIXED_POINTS, ((HOST, {}),)):
            what = "all properties" + "".join(f", {name} {value}" for name, value in settings.items())
            result = run(checker, parts, **settings)
            note(what, parts, result, result.complete)
        for n, guard, parts, settings in report.either(CONTROLS, CONTROLS[1:3]):
            result = run(checker, parts, BUG=guard, PROPERTIES=1 << (n - 1), **settings)
            note(f"without a guard of P{n} ({guard})", parts, result, result.broken == f"P{n}")
    for bug in bugs:
        if number == bug["number"] or number is None and (not report.FAST or bug["number"] in SHORT_BUGS):
            parts, result = search(checker, bug["number"])
            note(f"{bug['number']} {bug['name']}"[:44], parts, result, bool(result.broken))
    for what, parts, settings in report.either(FINDINGS, ()) if number is None else ():
        note(what, parts, run(checker, parts, **settings), True)
    (BUILD / "model.json").write_text(json.dumps(rows, indent=1) + "\n")
    if number is None:
        states = sum(row["states"] for row in rows)  # type: ignore[misc]
        figures = {"model_runs": len(rows), "model_not_expected": not_expected, "model_states": states}
        report.conclude("verify", figures)
    return int(not_expected > 0)


def search(checker: pathlib.Path, bug: int) -> Tuple[int, Result]:
    """Search a bug with more and more that may happen; return where it was found, or the last result."""
    for parts in (SHORT_BUGS[bug],) if report.FAST else LADDER:
        result = run(checker, parts, BUG=bug)
        if result.broken:
            break
    return parts, result


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
