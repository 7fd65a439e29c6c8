"""`python -m tests.mutants.image [FILE ...]`: mutants of the hal files on the simulated chip.

python -m tests.mutants.image --sample 60        that many, chosen by a seed; it goes on where it was ended
python -m tests.mutants.image --sample 60 --table    what is known, as a table, and the survivors; runs nothing

Results are kept in build/mutants-image.
"""

import argparse
import hashlib
import json
import random
import sys
from pathlib import Path
from typing import Any, Dict, List, Tuple

from tests.mutants.cpp.build import FIRMWARE, ROOT, fingerprint
from tests.mutants.cpp.schemata import Mutant
from tests.mutants.image import runner
from tests.mutants.image.build import BUILD, IMAGES, Images
from tests.mutants.image.changes import mutants_of
from tests.mutants.results import KILLED, equivalents

SEED = 1
FOLDER = "firmware/mrl_firmware/"
HEAD = "| source | mutants | byte-identical | equivalent | tried | noticed | score |\n|---|---|---|---|---|---|---|"
Rows = Dict[str, Dict[str, Any]]


def chosen(names: List[str], sample: int) -> List[Tuple[Mutant, str]]:
    """The mutants of these sources, or a sample of them."""
    found = [each for name in names for each in mutants_of(FOLDER + name, (FIRMWARE / name).read_text())]
    random.Random(SEED).shuffle(found)
    return found[: sample or None]


def made_of(source: str) -> str:
    """Changes when the source, a header or the compiler's options do."""
    return fingerprint([ROOT / source, *FIRMWARE.glob("*.h"), ROOT / "firmware" / "firmware.mk"])


def load(source: str) -> Rows:
    """What is known of the mutants of a source as it is now, by key."""
    path = BUILD / f"{Path(source).name}.json"
    kept = json.loads(path.read_text()) if path.exists() else {}
    return kept["mutants"] if kept.get("file_hash") == made_of(source) else {}


def save(source: str, rows: Rows) -> None:
    """Keeps what is known; a reader sees the old file or the new one."""
    path = BUILD / f"{Path(source).name}.json"
    new = path.with_suffix(".new")
    new.write_text(json.dumps({"file_hash": made_of(source), "mutants": rows}, indent=1))
    new.replace(path)


def is_known(row: Dict[str, Any], hashes: Dict[str, str], tests_hash: str) -> bool:
    """Whether it need not be tried again: a test that noticed it is the same, or all of them are if none did."""
    if row["state"] == "survived":
        return bool(row["tests_hash"] == tests_hash)
    return not row["by"] or row["by_hash"] == hashes.get(row["by"].split("::")[0])


def run(mutants: List[Tuple[Mutant, str]], most_s: float, checks: bool) -> None:
    """Tries the mutants that are not known; with `checks`, survivors with those of `tests.verify.interrupts` too."""
    images = Images()

    def work(session: runner.Session, redirected: runner.Redirected) -> None:
        files = {test.split("::")[0] for test in [*session.items, runner.CHECK]}
        hashes = {file: fingerprint([ROOT / file]) for file in files}
        tests_hash = hashlib.sha256(repr(sorted(hashes.items())).encode()).hexdigest()[:16]
        known = {FOLDER + name: load(FOLDER + name) for name in IMAGES}
        todo = [
            (mutant, text)
            for mutant, text in mutants
            if mutant.key not in known[mutant.file]
            or not is_known(known[mutant.file][mutant.key], hashes, tests_hash)
        ]
        print(f"{len(todo)} of {len(mutants)} mutants are to be tried", flush=True)

        def end(mutant: Mutant, verdict: runner.Verdict) -> None:
            by_hash = hashes.get(verdict.by.split("::")[0], "")
            row = {**verdict._asdict(), "by_hash": by_hash, "tests_hash": tests_hash, "line": mutant.line}
            known[mutant.file][mutant.key] = row
            save(mutant.file, known[mutant.file])
            print(
                f"{verdict.state:9} {verdict.seconds:5.1f} s  {mutant.line:3} {mutant.key}  {verdict.by}",
                flush=True,
            )

        usual = runner.measure(session, redirected, hashes)
        runner.run_mutants(session, redirected, images, usual, todo, end, most_s)
        if checks:
            states = {mutant.key: known[mutant.file][mutant.key]["state"] for mutant, _ in mutants}
            own = {mutant.key for mutant, _ in mutants if mutant.key in equivalents().get(mutant.file, {})}
            left = [each for each in mutants if states[each[0].key] == "survived" and each[0].key not in own]
            runner.run_checks(left, end)

    runner.with_tests(work, images)


def table(mutants: List[Tuple[Mutant, str]]) -> str:
    """What is known of these mutants, and the survivors.

    A mutant that does not compile is none; one whose images are those without it, byte for byte, cannot be noticed.
    """
    lines, left, listed = [HEAD], [], equivalents()
    for name in IMAGES:
        rows, own = load(FOLDER + name), listed.get(FOLDER + name, {})
        of_file = [mutant for mutant, _ in mutants if mutant.file == FOLDER + name and mutant.key in rows]
        states = {mutant.key: rows[mutant.key]["state"] for mutant in of_file}
        identical, compiled = (
            list(states.values()).count("identical"),
            len(states) - list(states.values()).count("invalid"),
        )
        survivors = [mutant for mutant in of_file if states[mutant.key] == "survived"]
        equivalent = sum(mutant.key in own for mutant in survivors)
        noticed = sum(state in KILLED for state in states.values())
        tried = compiled - identical - equivalent
        share = f"{noticed / tried:.1%}" if tried else ""
        lines.append(
            f"| `{name}` | {compiled} | {identical} | {equivalent} | {tried} | {noticed} | {share} |"
        )
        left += [f"{name}:{mutant.line} {mutant.key}" for mutant in survivors if mutant.key not in own]
    return "\n".join([*lines, "", *left])


def main(arguments: List[str]) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants.image")
    parser.add_argument("files", nargs="*", default=list(IMAGES))
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument(
        "--most-seconds", type=float, default=12.0, help="CPU time of the tests of each image [s]"
    )
    parser.add_argument(
        "--checks", action="store_true", help="try survivors with tests.verify.interrupts as well"
    )
    parser.add_argument("--table", action="store_true", help="print what is known, and run nothing")
    given = parser.parse_args(arguments)
    mutants = chosen(given.files or list(IMAGES), given.sample)
    if not given.table:
        run(mutants, given.most_seconds, given.checks)
    print(table(mutants))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
