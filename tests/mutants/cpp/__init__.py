"""Mutants of the firmware's C++, tried on its PC build."""

import hashlib
import random
import time
from collections import Counter
from typing import Any, Callable, Dict, List, Optional, Sequence

from tests.mutants.cpp import build, runner
from tests.mutants.cpp.schemata import Mutant

Result = Dict[str, Any]
FOLDER = "firmware/mrl_firmware/"
SAFETY = tuple(FOLDER + name for name in build.SAFETY)
FILES = SAFETY + tuple(FOLDER + name for name in build.OTHERS)
SAVE_EVERY = 25


def run(
    files: Sequence[str],
    save: Callable[[Result], None],
    load: Callable[[str], Optional[Result]] = lambda file: None,
    most_tests: Optional[int] = None,
    sample: int = 0,
    seed: int = 1,
) -> None:
    """Tries the mutants of these files; `save` gets the result of a file, again and again until it is complete.

    A `sample` is that many of them, chosen by `seed`.

    A mutant that an unchanged test has killed is not tried again while its file is the same; one that survived, while
    the tests are the same.  `most_tests` limits the tests for each mutant, for a first look.
    """
    mutants = [each for each in build.build() if each.file in files]
    if sample:
        mutants = random.Random(seed).sample(mutants, sample)
    runner.with_tests(lambda session: _run(session, mutants, save, load, most_tests))


def _run(
    session: runner.Session,
    mutants: List[Mutant],
    save: Callable[[Result], None],
    load: Callable[[str], Optional[Result]],
    most_tests: Optional[int],
) -> None:
    hashes = {path: _hash(path) for path in {test.split("::")[0] for test in session.items}}
    tests_hash = hashlib.sha256(repr(sorted(hashes.items())).encode()).hexdigest()[:16]
    results: Dict[str, Result] = {}
    todo: List[Mutant] = []
    for mutant in mutants:
        if mutant.file not in results:
            results[mutant.file] = {
                "file": mutant.file,
                "file_hash": _hash(mutant.file),
                "tests_hash": tests_hash,
                "mutants": {},
            }
        known = _known(mutant, results[mutant.file], load(mutant.file), hashes)
        results[mutant.file]["mutants"][mutant.key] = known or _row(mutant)
        if known is None:
            todo.append(mutant)
    left, ended = Counter(mutant.file for mutant in todo), 0
    for file in set(results) - set(left):
        save(_complete(results[file]))
    if not todo:
        return
    reach = runner.measure_reach(session, build.made_of(), hashes)
    begun_s = time.monotonic()

    def end(mutant: Mutant, verdict: runner.Verdict) -> None:
        nonlocal ended
        row = results[mutant.file]["mutants"][mutant.key]
        row.update(
            state=verdict.state,
            by=verdict.by,
            seconds=verdict.seconds,
            by_hash=hashes.get(verdict.by.split("::")[0], ""),
        )
        left[mutant.file] -= 1
        ended += 1
        if not left[mutant.file] or not ended % SAVE_EVERY:
            save(_complete(results[mutant.file]))
        if not ended % 100:
            print(f"{ended} of {len(todo)} mutants, {time.monotonic() - begun_s:.0f} s", flush=True)

    runner.run_mutants(session, todo, reach, end, most_tests)


def _row(mutant: Mutant) -> Dict[str, Any]:
    return {
        "key": mutant.key,
        "line": mutant.line,
        "kind": mutant.kind,
        "before": mutant.before,
        "after": mutant.after,
    }


def _complete(result: Result) -> Result:
    return {**result, "mutants": [row for row in result["mutants"].values() if "state" in row]}


def _known(
    mutant: Mutant, result: Result, old: Optional[Result], hashes: Dict[str, str]
) -> Optional[Dict[str, Any]]:
    if old is None or old["file_hash"] != result["file_hash"]:
        return None
    row = next((row for row in old["mutants"] if row["key"] == mutant.key), None)
    if row is None:
        return None
    if row["state"] in ("survived", "unreached"):
        return row if old["tests_hash"] == result["tests_hash"] else None
    return row if row.get("by_hash") == hashes.get(row["by"].split("::")[0]) else None


def _hash(path: str) -> str:
    return build.fingerprint([build.ROOT / path])
