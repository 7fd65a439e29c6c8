"""Random changes of the inputs of everything that reads: part of `make fuzz`.

Each input is a process of its own, with limits of CPU time and memory.  An input that gets an answer in new words is
changed further.  What breaks the rule is kept in build/fuzz, as a file for the corpus.  The figures go to
build/bench/readers.json.
"""

import hashlib
import multiprocessing
import os
import random
import re
import resource
import signal
import tempfile
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Tuple

import click

from tests.long.bench import report
from tests.long.fuzz.judge import Input, corpus, judge
from tests.long.fuzz.mutation import mutate
from tests.long.fuzz.readers import BY_INPUT, INPUTS, require_input

BUILD = Path(__file__).resolve().parents[3] / "build" / "fuzz"
MEMORY_BYTES = 1 << 30  # Address space that a process may use beyond what it has at first [byte]
HUNG_S = 20.0  # CPU time for one input after which its process is ended [s]
WAITS_S = 60.0  # Time for one input after which its process is ended [s]
KEPT = 400  # At most this many inputs are changed further


class Findings(NamedTuple):
    """What one process tried."""

    name: str
    tried: int
    shapes: int  # Number of different answers
    problems: Dict[str, str]  # Why an input breaks the rule, by the file that has it; one of each kind


def search(name: str, seconds: float, seed: int) -> Findings:
    input_, rng = BY_INPUT[name], random.Random(f"{name} {seed}")
    pool, seeds = list(corpus(input_).values()), list(corpus(input_).values())
    shapes, problems, kinds, tried = set(), {}, set(), 0
    end_s = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(dir=BUILD) as folder, open(_current(name), "wb", buffering=0) as current:
        while not tried or time.monotonic() < end_s:
            data = mutate(rng.choice(pool), seeds, input_.tokens, rng)
            current.seek(0)
            current.truncate()
            current.write(data)
            _limit()
            verdict = judge(input_, data, Path(folder))
            tried += 1
            kind = (
                verdict.problem.rstrip().rpartition("\n")[0][-300:]
                or re.sub(r"\d+", "", verdict.problem)[:30]
            )
            if verdict.problem and kind not in kinds:
                kinds.add(kind)
                problems[_keep(name, data)] = verdict.problem
            if verdict.shape not in shapes and len(pool) < KEPT:
                shapes.add(verdict.shape)
                pool.append(data)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    signal.setitimer(signal.ITIMER_REAL, 0)
    return Findings(name, tried, len(shapes), problems)


def _limit() -> None:
    """End this process if one input takes too long, by the signals' own action."""
    signal.setitimer(signal.ITIMER_VIRTUAL, HUNG_S)
    signal.setitimer(signal.ITIMER_REAL, WAITS_S)


def _current(name: str) -> Path:
    return BUILD / f"{name}.current"


def _keep(name: str, data: bytes) -> str:
    path = BUILD / f"{name}-{hashlib.sha256(data).hexdigest()[:8]}"
    path.write_bytes(data)
    return str(path)


def limit_memory() -> None:
    """Let this process use `MEMORY_BYTES` more than it does."""
    in_use = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (in_use + MEMORY_BYTES, in_use + MEMORY_BYTES))


def _work(name: str, seconds: float, seed: int, results: Any) -> None:
    limit_memory()
    for each in (signal.SIGALRM, signal.SIGVTALRM):
        signal.signal(each, signal.SIG_DFL)
    results.put(search(name, seconds, seed))


def run(names: List[str], seconds: float, seed: int, processes: int) -> List[Findings]:
    """The findings of all rows, each searched for this time, some processes at a time."""
    waiting, running, found = list(names), {}, []
    context = multiprocessing.get_context("fork")
    results: Any = context.SimpleQueue()
    while waiting or running:
        while waiting and len(running) < processes:
            name = waiting.pop(0)
            running[name] = context.Process(target=_work, args=(name, seconds, seed, results))
            running[name].start()
        time.sleep(0.05)
        while not results.empty():
            found.append(results.get())
        for name, process in list(running.items()):
            if process.exitcode is not None:
                del running[name]
                if process.exitcode:
                    why = {-signal.SIGVTALRM: "hangs", -signal.SIGALRM: "waits for ever"}
                    kept = _keep(name, _current(name).read_bytes())
                    words = why.get(process.exitcode, f"ends its process ({process.exitcode})")
                    found.append(Findings(name, 0, 0, {kept: words}))
    while not results.empty():
        found.append(results.get())
    return found


def show(found: List[Findings]) -> bool:
    """Print what was found; return whether the rule was broken."""
    for each in sorted(found):
        click.echo(
            f"{each.name:20}{each.tried:10} inputs {each.shapes:5} answers {len(each.problems):4} problems"
        )
        for path, problem in each.problems.items():
            click.echo(f"  {path}\n    " + "\n    ".join(problem.rstrip().splitlines()[-12:]))
    return any(each.problems for each in found)


def again(paths: Tuple[str, ...], input_: Input) -> bool:
    """Judge the inputs in these files; return whether one breaks the rule."""
    broken = False
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            verdict = judge(input_, Path(path).read_bytes(), Path(folder))
            click.echo(f"{path}: {verdict.problem or verdict.shape or 'is valid'}")
            broken = broken or bool(verdict.problem)
    return broken


@click.command()
@click.option(
    "--seconds", type=click.FloatRange(0.01), default=60.0, show_default=True, help="For each reader."
)
@click.option("--seed", type=int, default=1, show_default=True)
@click.option("--only", multiple=True, help="Name of a reader.")
@click.argument("paths", nargs=-1)
def main(seconds: float, seed: int, only: Tuple[str, ...], paths: Tuple[str, ...]) -> None:
    """Change inputs at random and judge what comes of them; exit code 1 if the rule is broken.

    With PATHS, judge these files, as inputs of the reader --only.
    """
    names = [require_input(name).name for name in only] or [each.name for each in INPUTS]
    if paths:
        raise SystemExit(int(again(paths, BY_INPUT[names[0]])))
    BUILD.mkdir(parents=True, exist_ok=True)
    found = run(names, seconds, seed, os.cpu_count() or 1)
    broken = show(found)
    figures = {
        "readers": len(found),
        "inputs": sum(each.tried for each in found),
        "problems": sum(len(each.problems) for each in found),
        "least_inputs": min(each.tried for each in found),
    }
    report.conclude("readers", figures)
    raise SystemExit(int(broken))


if __name__ == "__main__":
    main()
