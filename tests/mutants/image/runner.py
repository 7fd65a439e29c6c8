"""Runs the tests of the images against mutants: pytest collects them once, and each mutant gets a fork."""

import json
import os
import shutil
import signal
import time
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Sequence, Set, Tuple

import pytest

from sim_arduino.avr import machine
from tests.mutants.cpp.runner import LEAST_LIMIT_S, LIMIT_FACTOR, WITHOUT, WORKERS, Fork, run_forks
from tests.mutants.cpp.schemata import Mutant
from tests.mutants.image.build import BUILD, IMAGES, ROOT, DoesNotCompile, Images, flash_of
from tests.verify import interrupts

TESTS = ("tests/avr/test_image.py", "tests/avr/test_sleep.py", "tests/conformance")
NEAREST: Dict[str, Tuple[str, ...]] = {
    "hal_avr.cpp": (
        "test_image.py",
        "test_image_hal",
        "test_image_hbridge",
        "test_sleep",
        "test_service_rows",
    ),
    "hal_bridge_avr.cpp": ("test_image_hbridge", "test_image_hal", "test_bridge_rows"),
    "hal_bus_avr.cpp": ("test_image_bus", "test_image.py", "test_image_hal"),
    "hal_dust_avr.cpp": ("test_image_environment", "test_image_hal"),
    "hal_radio_avr.cpp": ("test_image_xbee", "test_image_radio", "test_image_hal"),
}
"""The files whose tests are tried first."""
CHECKS: Dict[str, Sequence[str]] = {
    "hal_avr.cpp": ("", "bridge", "xbee"),
    "hal_bridge_avr.cpp": ("bridge",),
    "hal_bus_avr.cpp": (),
    "hal_dust_avr.cpp": ("environment",),
    "hal_radio_avr.cpp": ("xbee",),
}
"""The builds of `tests.verify.interrupts` whose checks a source can fail."""
CHECK = "tests/verify/interrupts.py::"
MOST_OF_OTHERS_S = 3.0
"""CPU time of the tests of a second image that the source is in [s]."""
FAILED, INVALID, IDENTICAL = 1, 4, 5
STATES = {
    0: "survived",
    FAILED: "killed",
    INVALID: "invalid",
    IDENTICAL: "identical",
    -signal.SIGPROF: "timeout",
}


class Verdict(NamedTuple):
    """What became of a mutant, and the test that has noticed it."""

    state: str
    by: str
    seconds: float


class Usual(NamedTuple):
    """What a test does without a mutant: its CPU time [s], and the images that it runs."""

    seconds: float
    images: Set[str]


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
            engine = getattr(item, "callspec", None) and item.callspec.params.get("engine", "avr")
            if "conformance" not in item.nodeid or engine == "avr":
                self.items[item.nodeid] = item
        self._work(self)
        return True

    def fails(self, test: str) -> bool:
        """Runs a test."""
        from _pytest.runner import runtestprotocol

        return any(each.failed for each in runtestprotocol(self.items[test], log=False, nextitem=None))


class Redirected:
    """Takes the place of `read_image` of a machine, and notes which of make's images were asked for."""

    def __init__(self, images: Images) -> None:
        self._usual, self._images = machine.read_image, images
        self.changed: Dict[str, Path] = {}
        self.asked: Set[str] = set()

    def __call__(self, path: Path) -> Any:
        """Reads the changed image, if there is one."""
        if path.parent != ROOT / "build" / "firmware":
            return self._usual(path)
        self.asked.add(path.stem)
        return self._usual(self.changed.get(path.stem, self._images.path(path.stem)))


def with_tests(work: Callable[[Session, Redirected], None], images: Images) -> None:
    """Collects the tests and calls `work`.

    Raises:
        RuntimeError: the tests cannot be collected.
    """
    redirected = Redirected(images)
    machine.read_image = redirected  # type: ignore[assignment]
    os.chdir(str(ROOT))
    paths = [
        *TESTS,
        *(str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("tests/firmware/test_image_*.py"))),
    ]
    plugins = [f"-pno:{name}" for name in WITHOUT]
    session = Session(lambda each: work(each, redirected))
    code = pytest.main([*plugins, "-q", "--no-header", "--no-summary", *paths], plugins=[session])
    if code not in (0, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise RuntimeError(f"the tests cannot be collected: pytest ends with {code!r}")


def measure(session: Session, redirected: Redirected, hashes: Dict[str, str]) -> Dict[str, Usual]:
    """Runs each test once without a mutant, unless it has run before and its file is the same.

    Raises:
        RuntimeError: a test fails.
    """
    kept = BUILD / "usual.json"
    old = json.loads(kept.read_text()) if kept.exists() else {}
    tests = list(session.items)
    hash_of = {test: hashes[test.split("::")[0]] for test in tests}
    rows = {test: row for test, row in old.items() if hash_of.get(test) == row[0]}
    todo = [test for test in tests if test not in rows]
    wrong: List[str] = []

    def ended(fork: Fork, code: int) -> None:
        for line in fork.said.decode().splitlines():
            test, failed, seconds, images = json.loads(line)
            if failed:
                wrong.append(test)
            else:
                rows[test] = (hash_of[test], seconds, images)
        kept.write_text(json.dumps(rows))
        if code:
            raise RuntimeError(f"the tests end with {code} without a mutant")

    def start(worker: int) -> Fork:
        return Fork("reach", {}, lambda out: _measure(session, redirected, todo[worker::WORKERS], out))

    run_forks(iter([partial(start, worker) for worker in range(WORKERS)] if todo else []), ended)
    if wrong:
        raise RuntimeError(f"tests fail without a mutant: {', '.join(wrong)}")
    return {test: Usual(seconds, set(images)) for test, (_, seconds, images) in rows.items()}


def _measure(session: Session, redirected: Redirected, tests: Sequence[str], out: int) -> None:
    for test in tests:
        redirected.asked.clear()
        begun_s = time.process_time()
        failed = session.fails(test)
        row = [test, failed, time.process_time() - begun_s, sorted(redirected.asked)]
        os.write(out, (json.dumps(row) + "\n").encode())
    os._exit(0)


def run_mutants(
    session: Session,
    redirected: Redirected,
    images: Images,
    usual: Dict[str, Usual],
    mutants: Sequence[Tuple[Mutant, str]],
    ended: Callable[[Mutant, Verdict], None],
    most_s: float,
) -> None:
    """Tries each mutant, given with its text, and calls `ended` with its verdict.

    The tests of the first image in which it changes something take at most `most_s` of their usual CPU time [s].
    """
    killers: Dict[str, List[str]] = {}  # of a function, the last one first
    good: Dict[str, Counter] = {}  # how many mutants of a source each test has killed

    def order(mutant: Mutant, image: str) -> List[str]:
        tests = [test for test, row in usual.items() if image in row.images]
        first = killers.get(mutant.function, []) + [
            t for t, _ in good.get(mutant.file, Counter()).most_common()
        ]
        near = NEAREST[Path(mutant.file).name]
        tests.sort(key=lambda test: (not any(f"/{name}" in test for name in near), usual[test].seconds))
        return list(dict.fromkeys([test for test in first if test in tests] + tests))

    def start(mutant: Mutant, text: str) -> Fork:
        name = Path(mutant.file).name
        orders = {image: order(mutant, image) for image in IMAGES[name]}
        return Fork(
            mutant, {}, lambda out: _try(session, redirected, images, usual, name, text, orders, most_s, out)
        )

    def finish(fork: Fork, code: int) -> None:
        last = (fork.said.decode().splitlines() or [""])[-1]
        if code > 0 and code not in STATES:
            raise RuntimeError(f"{fork.about.key}: the fork ends with {code} in {last}")
        state = STATES.get(code, "crash")
        if state == "killed":
            known = killers.get(fork.about.function, [])
            killers[fork.about.function] = [last] + [test for test in known if test != last][:5]
            good.setdefault(fork.about.file, Counter())[last] += 1
        by = last if state in ("killed", "timeout", "crash") else ""
        ended(fork.about, Verdict(state, by, round(time.monotonic() - fork.begun_s, 1)))
        shutil.rmtree(BUILD / f"work{fork.process}", ignore_errors=True)

    run_forks((partial(start, mutant, text) for mutant, text in mutants), finish)


def _try(
    session: Session,
    redirected: Redirected,
    images: Images,
    usual: Dict[str, Usual],
    source: str,
    text: str,
    orders: Dict[str, List[str]],
    most_s: float,
    out: int,
) -> None:
    folder = BUILD / f"work{os.getpid()}"
    differs = False
    for image, order in orders.items():
        try:
            changed = images.with_source(image, source, text, folder)
        except DoesNotCompile:
            os._exit(INVALID)
        if flash_of(changed) == images.flash[image]:
            continue
        differs = True
        redirected.changed = {image: changed}
        _run_tests(session, usual, _within(order, usual, most_s), out)
        most_s = min(most_s, MOST_OF_OTHERS_S)
    os._exit(0 if differs else IDENTICAL)


def run_checks(mutants: Sequence[Tuple[Mutant, str]], ended: Callable[[Mutant, Verdict], None]) -> None:
    """Tries mutants with the checks of `tests.verify.interrupts` that are named after their functions."""

    def start(mutant: Mutant, text: str) -> Fork:
        return Fork(mutant, {}, lambda out: _check(mutant, text, out))

    def finish(fork: Fork, code: int) -> None:
        if code == FAILED:
            ended(
                fork.about, Verdict("killed", fork.said.decode(), round(time.monotonic() - fork.begun_s, 1))
            )
        shutil.rmtree(BUILD / f"work{fork.process}", ignore_errors=True)

    run_forks((partial(start, mutant, text) for mutant, text in mutants if _checks_of(mutant)), finish)


def _checks_of(mutant: Mutant) -> List[interrupts.Check]:
    kinds = CHECKS[Path(mutant.file).name]
    return [
        each
        for each in interrupts.CHECKS.values()
        if each.build in kinds and mutant.function in each.name.split(", ")[0]
    ]


def _check(mutant: Mutant, text: str, out: int) -> None:
    """Ends the process at the first check that fails with the mutant, but not without it."""
    interrupts.BUILD = BUILD / f"work{os.getpid()}"
    source = Path(mutant.file).name
    usual = (interrupts.SOURCE / source).read_text()
    for check in _checks_of(mutant):
        elf = interrupts.build(check.build, (source, usual, text), "changed")
        if not _passes(check, elf) and _passes(check, interrupts.build(check.build)):
            os.write(out, f"{CHECK}{check.name}".encode())
            os._exit(FAILED)
    os._exit(0)


def _passes(check: interrupts.Check, elf: Path) -> bool:
    chip = interrupts.Chip(elf)
    try:
        check.run(chip)
    except Exception:  # noqa: BLE001 - whatever a mutant makes of it
        return False
    finally:
        chip.machine.close()
    return True


def _within(order: Sequence[str], usual: Dict[str, Usual], most_s: float) -> Iterator[str]:
    for test in order:
        most_s -= usual[test].seconds
        if most_s < 0:
            return
        yield test


def _run_tests(session: Session, usual: Dict[str, Usual], tests: Iterator[str], out: int) -> None:
    """Ends the process at the first test that fails."""
    for test in tests:
        os.write(out, f"{test}\n".encode())
        signal.setitimer(signal.ITIMER_PROF, max(LEAST_LIMIT_S, LIMIT_FACTOR * usual[test].seconds))
        if session.fails(test):
            os._exit(FAILED)
    signal.setitimer(signal.ITIMER_PROF, 0)
