"""`make explore`: all sequences of events on the real code, and the seeded bugs; build/verify/explore.json.

The figures go to build/bench/verify.json; FAST=1 takes sequences of two events and one bug.
"""

import argparse
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Tuple

import yaml

from tests.long.bench import report
from tests.long.verify.edits import edited

from .board import BUILD, LIBRARY, ROOT, ExploredBoard, build
from .events import ALL, DEEP, QUICK, words
from .recorded import record
from .search import Explorer, Found, Table

PROCESSES, TABLE_BITS, MOST = 2, 25, 1000
LIMIT_S = 3600.0  # Longest time of one search
NOT_HERE = {18: "only in a node, which needs ROS", 19: "only in a node, which needs ROS"}
"""Seeded bugs that cannot exist in what is explored."""
SHORT_BUGS = [11, 16]  # With FAST=1
AS_EFFECT = 16  # Its edit is in a node; here the driver gets what the node then gives it: no command timeout
STAGES = ((ALL, 3), (DEEP, 4), (ALL, 4))
"""A bug is searched with sequences of 1, 2, 3 of all kinds, then with longer ones."""
_explorer: Optional[Explorer] = None


def _visit(task: Tuple[str, int, str, float]) -> Tuple[int, int, float, List[Found]]:
    alphabet, depth, prefix, deadline_s = task
    explorer = _explorer
    assert explorer is not None
    explorer.transitions = explorer.states = 0
    explorer.found, explorer.most, explorer.deadline_s = [], MOST, deadline_s
    begun_s = time.process_time()
    explorer.explore(alphabet, depth, prefix)
    return explorer.transitions, explorer.states, time.process_time() - begun_s, explorer.found


def explore(alphabet: str, depth: int) -> Dict[str, Any]:
    """Visit all sequences of this many events with some processes; return the figures."""
    global _explorer
    table = Table(TABLE_BITS)
    _explorer = Explorer(table=table)
    begun_s = time.monotonic()
    transitions, cpu_s = 0, 0.0
    found: List[Found] = []
    deadline_s = begun_s + LIMIT_S
    tasks = [(alphabet, depth, one + other, deadline_s) for one in alphabet for other in alphabet]
    first = _visit((alphabet, 2, "", deadline_s))
    transitions, cpu_s, found = first[0], first[2], list(first[3])
    done = 0
    with multiprocessing.get_context("fork").Pool(PROCESSES) as pool:
        for result in pool.imap_unordered(_visit, tasks):
            transitions, cpu_s = transitions + result[0], cpu_s + result[2]
            found += result[3]
            done += 1
            if done % max(1, len(tasks) // 20) == 0:
                elapsed_s = time.monotonic() - begun_s
                print(f"{done} of {len(tasks)} parts, {transitions} events, {elapsed_s:.0f} s", flush=True)
    seconds = time.monotonic() - begun_s
    by_depth = table.by_depth
    return {
        "alphabet": alphabet,
        "kinds": len(alphabet),
        "depth": depth,
        "complete": seconds < LIMIT_S and not found,
        "sequences": len(alphabet) ** depth,
        "events": transitions,
        "states": sum(by_depth.values()),
        "states_by_depth": {str(each): by_depth[each] for each in sorted(by_depth)},
        "seconds": round(seconds, 1),
        "cpu_seconds": round(cpu_s, 1),
        "found": [found_words(each) for each in sorted(found, key=lambda each: len(each.path))],
    }


def found_words(found: Found) -> Dict[str, Any]:
    return {"property": found.property, "path": found.path, "events": list(words(found.path))}


def search(library: Path, timeout_s: Optional[float]) -> Dict[str, Any]:
    """Search for the shortest sequences, until one violates a property."""
    begun_s, events = time.process_time(), 0
    deadline_s = time.monotonic() + LIMIT_S
    for alphabet, longest in STAGES:
        for depth in range(1 if longest == 3 else longest, longest + 1):
            explorer = Explorer(ExploredBoard(library), timeout_s, Table(20))
            explorer.most, explorer.deadline_s = 1, deadline_s
            explorer.explore(alphabet, depth)
            events += explorer.transitions
            if explorer.found:
                found = explorer.found[0]
                seconds = round(time.process_time() - begun_s, 1)
                return {**found_words(found), "depth": len(found.path), "tried": events, "seconds": seconds}
    return {"property": "", "tried": events, "seconds": round(time.process_time() - begun_s, 1)}


def _checkout(folder: Path, package: str) -> None:
    """Fill a folder with this checkout: a copy of one package, links to all else."""
    for entry in ROOT.iterdir():
        if entry.name == package:
            shutil.copytree(entry, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
        elif not entry.name.startswith("."):
            (folder / entry.name).symlink_to(entry)


def patched(bug: Dict[str, Any]) -> Dict[str, Any]:
    timeout = ["--no-timeout"] if bug["number"] == AS_EFFECT else []
    with tempfile.TemporaryDirectory() as name:
        folder, library = Path(name), LIBRARY
        if not timeout:
            package = Path(bug["file"]).parts[0]
            _checkout(folder, package)
            source = folder / bug["file"]
            source.write_text(edited(source, bug["find"], bug["replace"]))
            if package == "firmware":
                library = build(
                    folder / "libboard.so",
                    folder / "firmware" / "mrl_firmware",
                    report.either("-O2", "-O0"),
                )
        else:
            _checkout(folder, "")
        command = [sys.executable, "-m", "tests.long.verify.explorer", "--search", str(library), *timeout]
        environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True, check=True
        )
    result: Dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def bugs(numbers: List[int]) -> Iterator[Dict[str, Any]]:
    for bug in yaml.safe_load((ROOT / "tests/long/verify/seeded_bugs.yaml").read_text()):
        number = bug["number"]
        if numbers and number not in numbers:
            continue
        result = {"not_here": NOT_HERE[number]} if number in NOT_HERE else patched(bug)
        print(f"bug {number}: {bug['name']}: {result}", flush=True)
        yield {"number": number, "expected": bug["breaks"], **result}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    alphabet, depth = report.either((DEEP, 6), (QUICK, 3))
    parser.add_argument("--alphabet", default=alphabet, help="kinds of event, by letter; `all` for all")
    parser.add_argument("--depth", type=int, default=depth)
    parser.add_argument("--bug", type=int, action="append", help="only these seeded bugs, and no long search")
    parser.add_argument("--words", metavar="PATH", help="play one sequence, and print what it violates")
    parser.add_argument("--record", metavar="FILE", help="with --words: the file of its recording")
    parser.add_argument("--search", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--no-timeout", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.search:
        print(json.dumps(search(options.search, None if options.no_timeout else 0.5)))
        return
    build(optimise=report.either("-O2", "-O0"))
    if options.words:
        print("\n".join(words(options.words)))
        print(record(options.words, options.record) or "holds")
        return
    file = BUILD / "explore.json"
    results: Dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}
    holds = True
    if not options.bug:
        alphabet = ALL if options.alphabet == "all" else options.alphabet
        results[f"{len(alphabet)} kinds, {options.depth} events"] = figures = explore(alphabet, options.depth)
        holds = figures["complete"]
        violations = len(figures["found"])
        report.conclude("verify", {"explored_states": figures["states"], "explored_violations": violations})
        print(json.dumps(figures, indent=1))
        file.write_text(json.dumps(results, indent=1) + "\n")
        for each in figures["found"][:3]:
            name = BUILD / f"{each['property']}-{each['path']}.mrl"
            record(each["path"], str(name))
            print(f"{name}: {each['property']} is violated: {', '.join(each['events'])}")
    known = {each["number"]: each for each in results.get("bugs", [])}
    for result in bugs(options.bug or report.either([], SHORT_BUGS)):
        known[result["number"]] = result
        results["bugs"] = [known[number] for number in sorted(known)]
        file.write_text(json.dumps(results, indent=1) + "\n")
    found = sum(bool(each.get("property")) for each in known.values())
    report.conclude("verify", {"explored_bugs": len(known), "explored_bugs_found": found})
    if not holds:
        sys.exit("a property is violated, or the time has not sufficed: see `found` and `complete` above")


if __name__ == "__main__":
    main()
