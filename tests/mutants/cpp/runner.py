"""Runs tests against mutants: one pytest session is collected once, and each mutant gets a fork of it.

The mutant's library marks which mutants change a value while a test runs.  A mutant is only tried with the tests that
reach it: those that killed its neighbours first, then the shortest, until one fails.
"""

import json
import os
import select
import signal
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set

import pytest

from tests.mutants.cpp.build import BUILD, ROOT
from tests.mutants.cpp.schemata import Mutant

WORKERS = 2
MOST_MUTANTS = 1 << 16
TESTS = ("tests/firmware", "tests/conformance", "tests/calibration/test_bridge_wiring.py")
LEFT_OUT = ("test_image", "test_build", "test_fuzz", "test_generate", "test_outside", "test_baud")
"""Files that do not run the firmware's PC build in this process."""
WITHOUT = ("cacheprovider", "randomly", "rerunfailures", "xdist", "timeout", "faulthandler")
"""Plugins of pytest that have no place in a fork, or would print what a crash of a mutant looks like."""
NEAREST = {
    "bridge": ("test_wheel", "test_bridge", "test_motion_rows"),
    "bus": ("test_bus_limits", "test_failsafe", "test_streams"),
    "ceiling": ("test_ceiling_limits", "test_commands", "test_motion_rows", "test_omni3md_rows"),
    "commands": ("test_command_limits", "test_commands", "test_failsafe"),
    "config": ("test_config", "test_service_rows"),
    "encoder": ("test_wheel", "test_wheel_limits", "test_bridge"),
    "failsafe": ("test_failsafe", "test_service_rows"),
    "frame": (
        "test_writer_limits",
        "test_decoder",
        "test_writer",
        "test_vectors",
        "test_commands",
        "test_streams",
    ),
    "hold": ("test_hold_limits", "test_hold_rows", "test_xbee"),
    "motion": ("test_motion_rows", "test_commands", "test_bridge"),
    "motor_bridge": (
        "test_motor_bridge_limits",
        "test_bridge",
        "test_bridge_rows",
        "test_motion_rows",
        "test_service_rows",
    ),
    "motor_omni3md": ("test_omni3md_limits", "test_failsafe", "test_commands", "test_omni3md_rows"),
    "omni3md": ("test_omni3md_limits", "test_commands", "test_config", "test_failsafe"),
    "speed_estimate": ("test_wheel", "test_wheel_limits", "test_bridge"),
    "status": ("test_failsafe", "test_service_rows"),
    "wheel": ("test_wheel", "test_wheel_limits", "test_bridge"),
}
"""By the beginning of a source's name, the files whose tests are tried first."""
LEAST_LIMIT_S, LIMIT_FACTOR = 2.0, 10.0
"""CPU time that a test may take against a mutant: a multiple of its usual time, and at least this [s]."""
HUNG_S = 600.0
"""Wall-clock time after which a mutant counts as timed out even though it takes no CPU time [s]."""


class Verdict(NamedTuple):
    """What became of a mutant: its state, the test that killed it, and the time it took [s]."""

    state: str
    by: str
    seconds: float


@dataclass
class Reach:
    """What each test reaches, and its CPU time [s]."""

    seconds: Dict[str, float] = field(default_factory=dict)
    mutants: Dict[str, Set[int]] = field(default_factory=dict)

    def tests_of(self, numbers: Sequence[int]) -> List[str]:
        """The tests that reach one of these mutants, shortest first."""
        found = [test for test, reached in self.mutants.items() if reached.intersection(numbers)]
        return sorted(found, key=lambda test: self.seconds[test])


class Session:
    """Plugin: collects the tests and hands them to `work` instead of running them."""

    def __init__(self, work: Callable[["Session"], None]) -> None:
        self._work = work
        self.items: Dict[str, Any] = {}

    def pytest_runtestloop(self, session: Any) -> bool:
        """Takes the place of pytest's own loop."""
        if session.testsfailed:
            raise session.Interrupted("tests cannot be collected")
        for item in session.items:
            if _runs_firmware(item):
                self.items[item.nodeid] = item
        self._work(self)
        return True


def _runs_firmware(item: Any) -> bool:
    if any(word in item.nodeid for word in LEFT_OUT):
        return False
    if "tests/conformance" in item.nodeid:
        return getattr(item, "callspec", None) is not None and item.callspec.params.get("engine") == "pc"
    return True


def with_tests(work: Callable[[Session], None], paths: Sequence[str] = TESTS) -> None:
    """Collects the tests with the mutated libraries in place of the usual ones and calls `work`.

    Raises:
        RuntimeError: the tests cannot be collected.
    """
    from tests.firmware import pc_board

    usual = pc_board.load
    pc_board.load = lambda library: usual(BUILD / library.name)
    os.chdir(ROOT)
    plugins = [f"-pno:{name}" for name in WITHOUT]
    code = pytest.main([*plugins, "-q", "--no-header", "--no-summary", *paths], plugins=[Session(work)])
    if code not in (0, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise RuntimeError(f"the tests cannot be collected: pytest ends with {code!r}")


# ---- in a fork


def _failed(item: Any) -> bool:
    from _pytest.runner import runtestprotocol

    return any(report.failed for report in runtestprotocol(item, log=False, nextitem=None))


def _try_mutant(session: Session, tests: Sequence[str], seconds: Dict[str, float], out: int) -> None:
    for test in tests:
        os.write(out, f"{test}\n".encode())
        signal.setitimer(signal.ITIMER_PROF, max(LEAST_LIMIT_S, LIMIT_FACTOR * seconds[test]))
        if _failed(session.items[test]):
            os._exit(1)
    os._exit(0)


def _measure(session: Session, tests: Sequence[str], marks: Path, out: int) -> None:
    with open(marks, "r+b", buffering=0) as file:
        for test in tests:
            file.seek(0)
            file.write(bytes(MOST_MUTANTS))
            begun_s = time.process_time()
            failed = _failed(session.items[test])
            seconds = time.process_time() - begun_s
            file.seek(0)
            reached = [number for number, mark in enumerate(file.read()) if mark]
            os.write(out, (json.dumps([test, failed, seconds, reached]) + "\n").encode())
    os._exit(0)


class Fork:
    """A child process and what it says."""

    def __init__(self, about: Any, environment: Dict[str, str], run: Callable[[int], None]) -> None:
        self.about, self.said, self.begun_s = about, b"", time.monotonic()
        self.out, into = os.pipe()
        sys.stdout.flush()
        self.process = os.fork()
        if not self.process:
            try:
                os.environ.update(environment)
                os.nice(max(0, 10 - os.nice(0)))
                run(into)
            finally:
                os._exit(3)
        os.close(into)

    def read(self) -> bool:
        """Takes what has been said; False at the end."""
        data = os.read(self.out, 1 << 16)
        self.said += data
        return bool(data)

    def end(self) -> int:
        """Waits for the end; the exit code, or minus the signal."""
        os.close(self.out)
        _, status = os.waitpid(self.process, 0)
        return -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)

    def kill(self) -> None:
        """Ends it at once."""
        os.kill(self.process, signal.SIGKILL)


def run_forks(starts: Iterator[Callable[[], Fork]], ended: Callable[[Fork, int], None]) -> None:
    """Keeps WORKERS forks running until no more are to be started."""
    running: Dict[int, Fork] = {}
    more = True
    try:
        while more or running:
            while more and len(running) < WORKERS:
                start = next(starts, None)
                more = start is not None
                if start is not None:
                    fork = start()
                    running[fork.out] = fork
            ready, _, _ = select.select(list(running), [], [], 1.0)
            for out in ready:
                if not running[out].read():
                    fork = running.pop(out)
                    ended(fork, fork.end())
            for fork in running.values():
                if time.monotonic() - fork.begun_s > HUNG_S and fork.about != "reach":
                    fork.kill()
    finally:
        for fork in running.values():
            fork.kill()
            fork.end()


# ---- what the caller asks for


def measure_reach(session: Session, libraries: str, hashes: Dict[str, str]) -> Reach:
    """Runs each test once without a mutant, unless it has run with these libraries and its file is the same.

    Args:
        session: Has the tests.
        libraries: What the libraries are made of.
        hashes: Of the files of the tests.

    Raises:
        RuntimeError: a test fails.
    """
    kept = BUILD / "reach.json"
    old = json.loads(kept.read_text()) if kept.exists() else {}
    known = old.get("tests", {}) if old.get("libraries") == libraries else {}
    hash_of = {test: hashes[test.split("::")[0]] for test in session.items}
    same = {test: row for test, row in known.items() if hash_of.get(test) == row[0]}
    reach = _measure_all(session, [test for test in session.items if test not in same])
    for test, (_, seconds, numbers) in same.items():
        reach.seconds[test], reach.mutants[test] = seconds, set(numbers)
    rows = {
        test: (hash_of[test], reach.seconds[test], sorted(numbers)) for test, numbers in reach.mutants.items()
    }
    kept.write_text(json.dumps({"libraries": libraries, "tests": rows}))
    return reach


def _measure_all(session: Session, tests: List[str]) -> Reach:
    reach = Reach()

    def start(worker: int) -> Fork:
        marks = BUILD / f"reached{worker}"
        marks.write_bytes(bytes(MOST_MUTANTS))
        environment = {"MRL_MUTANTS_REACHED": str(marks)}
        return Fork("reach", environment, lambda out: _measure(session, tests[worker::WORKERS], marks, out))

    def ended(fork: Fork, code: int) -> None:
        for line in fork.said.decode().splitlines():
            test, failed, seconds, reached = json.loads(line)
            if failed:
                raise RuntimeError(f"{test} fails without a mutant")
            reach.seconds[test], reach.mutants[test] = seconds, set(reached)
        if code:
            raise RuntimeError(f"the tests end with {code} without a mutant")

    run_forks(iter([partial(start, worker) for worker in range(WORKERS)]), ended)
    return reach


def _is_near(mutant: Mutant, test: str) -> bool:
    names = [name for name in NEAREST if Path(mutant.file).name.startswith(name)]
    return any(f"/{file}.py" in test for file in NEAREST[max(names, key=len)]) if names else False


def run_mutants(
    session: Session,
    mutants: Sequence[Mutant],
    reach: Reach,
    ended: Callable[[Mutant, Verdict], None],
    most_tests: Optional[int] = None,
) -> None:
    """Tries each mutant and calls `ended` with its verdict."""
    near: Dict[str, List[str]] = {}  # the last killers of a function's mutants
    good: Dict[str, Counter] = {}  # how many mutants of a file each test has killed

    def start(mutant: Mutant) -> Fork:
        tests = reach.tests_of(mutant.numbers)
        of_file = [test for test, _ in good.get(mutant.file, Counter()).most_common()]
        first = [test for test in near.get(mutant.function, []) + of_file if test in tests]
        nearest = sorted(tests, key=lambda test: _is_near(mutant, test), reverse=True)
        order = list(dict.fromkeys(first + nearest))[:most_tests]
        environment = {"MRL_MUTANT": str(mutant.numbers[0])}
        return Fork(mutant, environment, lambda out: _try_mutant(session, order, reach.seconds, out))

    def finish(fork: Fork, code: int) -> None:
        said = fork.said.decode().splitlines()
        last = said[-1] if said else ""
        state = {0: "survived", 1: "killed", -signal.SIGPROF: "timeout", -signal.SIGKILL: "timeout"}.get(
            code, "crash"
        )
        if state == "killed":
            known = near.get(fork.about.function, [])
            near[fork.about.function] = [last] + [test for test in known if test != last][:5]
            good.setdefault(fork.about.file, Counter())[last] += 1
        by = "" if state == "survived" else last
        ended(fork.about, Verdict(state, by, round(time.monotonic() - fork.begun_s, 3)))

    def starts() -> Iterator[Callable[[], Fork]]:
        for mutant in mutants:
            if reach.tests_of(mutant.numbers):
                yield partial(start, mutant)
            else:
                ended(mutant, Verdict("unreached", "", 0.0))

    run_forks(starts(), finish)
