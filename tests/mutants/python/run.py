"""Runs the mutants of Python sources, and keeps what is known from the run before."""

import ast
import contextlib
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
from typing import Any, Dict, Iterable, Iterator, List, Optional, Tuple

import yaml

from tests.mutants import results

from .mutations import mutants_of

SAVED_EACH = 50
"""Results are kept after this many mutants, so that a run that is broken off continues there."""


def run(
    source: str, tests: List[str], workers: int = 2, keys: Optional[List[str]] = None, keep: bool = True
) -> results.Result:
    """Run the mutants of a source that have no result for these tests yet; returns all results.

    With `keys` it runs only these.  Without `keep`, earlier results are not used, and these not kept.
    """
    if keys is None:
        keys = [each.key for each in mutants_of(ast.parse(pathlib.Path(source).read_text()))]
    known = (results.load(source) if keep else None) or {}
    hints = {each["key"]: each["by"] for each in known.get("mutants", ()) if each["by"]}
    result: results.Result = {
        "file": source,
        "file_hash": results.hash_of([source]),
        "tests_hash": results.hash_of(tests),
        "mutants": [],
    }
    if all(known.get(name) == result[name] for name in ("file_hash", "tests_hash")):
        result["mutants"] = known["mutants"]
    done = {each["key"] for each in result["mutants"]}
    missing = [key for key in keys if key not in done]
    for row in verdicts(source, tests, missing, hints, workers) if missing else ():
        result["mutants"].append(row)
        result["left"] = len(keys) - len(result["mutants"])
        if keep and len(result["mutants"]) % SAVED_EACH == 0:
            results.save(result)
    order = {key: place for place, key in enumerate(keys)}
    result["mutants"].sort(key=lambda each: order[each["key"]])
    if keep:
        results.save(result)
    return result


def verdicts(
    source: str, tests: List[str], keys: List[str], hints: Dict[str, str], workers: int
) -> Iterator[Dict[str, Any]]:
    """Yield the result of each mutant with one of these keys."""
    work: Dict[str, Any] = {
        "source": source,
        "tests": tests,
        "keys": keys,
        "hints": hints,
        "workers": workers,
    }
    end: Dict[str, Any] = {}
    for row in _worked({**work, "fresh": False}):
        if "key" in row:
            yield row
        else:
            end = row
    if end["fresh"]:
        yield from _worked({**work, **end, "keys": end["fresh"], "fresh": True})


def _worked(work: Dict[str, Any]) -> Iterator[Dict[str, Any]]:
    """Yield what a worker says."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, tempfile.TemporaryFile("w+") as log:
        worker = subprocess.Popen(
            [sys.executable, "-m", "tests.mutants.python.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            universal_newlines=True,
            env={**os.environ, "PYTEST_DEBUG_TEMPROOT": folder, "TMPDIR": folder, "PYTHONHASHSEED": "0"},
        )
        with contextlib.ExitStack() as stack:
            stack.callback(_end, worker)
            assert worker.stdin is not None and worker.stdout is not None
            worker.stdin.write(json.dumps(work))
            worker.stdin.close()
            yield from map(json.loads, worker.stdout)
            if worker.wait() != 0:
                log.seek(0)
                raise SystemExit(
                    f"{work['source']}: the worker has ended with {worker.returncode}:\n{log.read()[-2000:]}"
                )


def _end(worker: "subprocess.Popen[str]") -> None:
    if worker.poll() is None:
        worker.kill()
        worker.wait()
    if worker.stdout is not None:
        worker.stdout.close()


def sample(count: int, sources: Iterable[str], seed: int) -> Dict[str, List[str]]:
    """Return the keys of `count` mutants by source, chosen by the seed; code that did not change keeps its own."""
    rank: Dict[bytes, Tuple[str, str]] = {}
    for source in sources:
        for each in mutants_of(ast.parse(pathlib.Path(source).read_text())):
            if each.in_function:
                rank[hashlib.sha256(f"{seed} {source} {each.key}".encode()).digest()] = source, each.key
    chosen: Dict[str, List[str]] = {}
    for _, (source, key) in sorted(rank.items())[:count]:
        chosen.setdefault(source, []).append(key)
    return chosen


def targets() -> Dict[str, Dict[str, Any]]:
    """Return sources with their tests, from targets.yaml."""
    return yaml.safe_load((results.HERE / "targets.yaml").read_text())
