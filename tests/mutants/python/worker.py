"""Runs the mutants of one source with its nearest tests: `python -m tests.mutants.python.worker`, started by `run`.

The work comes as JSON on standard input: source, tests, keys, hints, workers, fresh.  Each result leaves as a line of
JSON.

pytest collects the tests once.  A fork runs them without a mutation, and notes which lines each test reaches.  Then
each mutant gets a fork: the code of its function is exchanged, and the tests that reach its statement run, the fastest
first, until one fails.  A mutant outside functions, or one in a function that was called while modules were
imported, cannot be made so: its fork imports everything afresh, with the mutated source in place of the module.
"""

import ast
import contextlib
import gc
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import pathlib
import resource
import select
import signal
import sys
import threading
import time
import types
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Set, Tuple

import pytest

from .mutations import Mutant, compiled, mutants_of

OPTIONS = ("-n0", "-p", "no:randomly", "-p", "no:cacheprovider", "--capture=no", "-q")
CPU_S = 3.0
"""A mutant may use this much CPU time [s], and `CPU_FACTOR` times what its tests use without a mutation."""
CPU_FACTOR = 4.0
LONGEST_S = 0.25
"""Tests that use more CPU time without a mutation are left out: the nearest tests are fast [s]."""
WALL_S = 240.0
"""A fork that lasts longer is a time-out, whatever it uses [s]."""
MEMORY_BYTES = 3 << 30
KILLED, SURVIVED, TIMEOUT, CRASH, UNREACHED, STALE = (
    "killed",
    "survived",
    "timeout",
    "crash",
    "unreached",
    "fresh",
)


class Verdict(NamedTuple):
    """What became of a mutant; `by` is the test that failed."""

    state: str
    by: str
    seconds: float


class Baseline(NamedTuple):
    """The tests without a mutation: the time [s] and the lines of the source that each reaches."""

    seconds: Dict[str, float]
    lines: Dict[str, Set[int]]


def forked(work: Callable[[Callable[[Any], None]], None], cpu_s: float) -> "Child":
    """Run `work(tell)` in a fork that has this much CPU time [s]; `tell` sends one JSON value."""
    read, write = os.pipe()
    pid = os.fork()
    if pid:
        os.close(write)
        return Child(pid, read, time.monotonic())
    try:
        os.setpgid(0, 0)
        os.close(read)
        null = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(null, number)
        resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s) + 1, int(cpu_s) + 2))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        work(lambda value: _write(write, json.dumps(value).encode()))
        os._exit(0)
    except BaseException as error:  # noqa: BLE001  # such as SystemExit in a mutated import
        _write(write, json.dumps({"by": f"{type(error).__name__}: {error}"[:200]}).encode())
        os._exit(1)
    raise AssertionError("not reached")


def _write(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


class Child:
    """A fork, and what it has sent."""

    def __init__(self, pid: int, read: int, start_s: float) -> None:
        self.pid, self.read, self.start_s, self.data = pid, read, start_s, b""

    def ended(self) -> Optional[int]:
        """Return the exit status if the fork has ended; one that lasts too long is killed."""
        if time.monotonic() - self.start_s > WALL_S:
            os.killpg(self.pid, signal.SIGKILL)
        while select.select([self.read], [], [], 0.0)[0]:
            part = os.read(self.read, 1 << 16)
            if not part:
                break
            self.data += part
        pid, status, usage = os.wait4(self.pid, os.WNOHANG)
        if not pid:
            return None
        while True:
            part = os.read(self.read, 1 << 16) if select.select([self.read], [], [], 0.0)[0] else b""
            if not part:
                break
            self.data += part
        os.close(self.read)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)  # what a test has started and the mutant has not ended
        self.seconds = usage.ru_utime + usage.ru_stime
        return status

    def verdict(self, status: int) -> Verdict:
        """Return what this end of the fork says."""
        said = json.loads(self.data) if self.data else {}
        if os.WIFSIGNALED(status):
            late = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
            return Verdict(TIMEOUT if late else CRASH, said.get("by", ""), self.seconds)
        by = said.get("by", "")
        return Verdict(said.get("state", KILLED if by else CRASH), by, self.seconds)


def in_turn(jobs: Iterator[Tuple[Any, "Child"]], workers: int) -> Iterator[Tuple[Any, Verdict]]:
    """Start the jobs, `workers` at a time, and yield their verdicts as they end."""
    running: List[Tuple[Any, Child]] = []
    more = True
    while more or running:
        while more and len(running) < workers:
            try:
                running.append(next(jobs))
            except StopIteration:
                more = False
        for job in list(running):
            status = job[1].ended()
            if status is not None:
                running.remove(job)
                yield job[0], job[1].verdict(status)
                break
        else:
            time.sleep(0.002)


def run_items(items: List[Any]) -> str:
    """Run tests until one fails; its name, or nothing."""
    from _pytest.runner import runtestprotocol

    for item, following in zip(items, [*items[1:], None]):
        if any(report.failed for report in runtestprotocol(item, nextitem=following, log=False)):
            return str(item.nodeid)
    return ""


class Warm:
    """The plugin whose run of the tests is the run of the mutants."""

    def __init__(self, work: Dict[str, Any], tell: Callable[[Mutant, Verdict], None]) -> None:
        self.source, self.hints, self.workers = (
            os.path.abspath(work["source"]),
            work["hints"],
            work["workers"],
        )
        self.tree = ast.parse(pathlib.Path(self.source).read_text())
        wanted = set(work["keys"])
        self.mutants = [each for each in mutants_of(self.tree) if each.key in wanted]
        self.tell = tell
        self.imported: Set[int] = set()
        """Lines that ran while the tests were imported."""
        self.fresh: List[str] = [each.key for each in self.mutants if not each.in_function]
        """Keys of the mutants that need a fresh import."""
        self.seconds = 0.0
        """CPU time of all tests without a mutation [s]."""
        self.slow: List[str] = []
        """Tests that take longer than `LONGEST_S`."""
        self.done = False

    @contextlib.contextmanager
    def traced(self, lines: Set[int]) -> Iterator[None]:
        """Note the lines of the source that run meanwhile."""

        def line(frame: types.FrameType, event: str, _: Any) -> Any:
            lines.add(frame.f_lineno)
            return line

        def call(frame: types.FrameType, event: str, _: Any) -> Any:
            if frame.f_code.co_filename != self.source:
                return None
            lines.add(frame.f_lineno)
            return line

        threading.settrace(call)
        sys.settrace(call)
        try:
            yield
        finally:
            sys.settrace(None)
            threading.settrace(None)  # type: ignore[arg-type]

    def pytest_runtestloop(self, session: Any) -> bool:
        """Run the mutants in place of the tests."""
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
        if session.testsfailed:
            raise session.Interrupted("the tests cannot be collected")
        items = {item.nodeid: item for item in session.items}
        if any(each.in_function for each in self.mutants):
            baseline = self._baseline(list(items.values()))
            self.slow = [name for name, seconds in baseline.seconds.items() if seconds > LONGEST_S]
            self.seconds = sum(seconds for seconds in baseline.seconds.values() if seconds <= LONGEST_S)
            for mutant, verdict in in_turn(self._jobs(items, baseline), self.workers):
                self._judge(mutant, verdict)
        self.done = True
        return True

    def _judge(self, mutant: Mutant, verdict: Verdict) -> None:
        """A survivor that was made too late, because its line ran during import, is tried again."""
        early = self.imported.intersection(range(mutant.first_line, mutant.last_line + 1))
        if verdict.state == STALE or (verdict.state in (SURVIVED, UNREACHED) and early):
            self.fresh.append(mutant.key)
        else:
            self.tell(mutant, verdict)

    def _baseline(self, items: List[Any]) -> Baseline:
        from _pytest.runner import runtestprotocol

        def work(tell: Callable[[Any], None]) -> None:
            found = {}
            for item, following in zip(items, [*items[1:], None]):
                lines: Set[int] = set()
                start_s = time.process_time()
                with self.traced(lines):
                    reports = runtestprotocol(item, nextitem=following, log=False)
                failed = [str(report.longrepr) for report in reports if report.failed]
                if failed:
                    return tell({"failed": f"{item.nodeid}: {failed[0][-600:]}"})
                found[item.nodeid] = (time.process_time() - start_s, sorted(lines))
            return tell({"found": found})

        child = forked(work, 600.0)
        while child.ended() is None:
            time.sleep(0.01)
        said = json.loads(child.data or b"{}")
        if "found" not in said:
            sys.exit(f"without a mutation: {said.get('failed', said)}")
        found = said["found"].items()
        return Baseline({name: each[0] for name, each in found}, {name: set(each[1]) for name, each in found})

    def _jobs(self, items: Dict[str, Any], baseline: Baseline) -> Iterator[Tuple[Mutant, Child]]:
        original = compile(self.tree, self.source, "exec", dont_inherit=True)
        functions = self._functions()
        order = sorted(set(items) - set(self.slow), key=lambda name: baseline.seconds[name])
        for mutant in self.mutants:
            if not mutant.in_function:
                continue
            span = range(mutant.first_line, mutant.last_line + 1)
            reach = [name for name in order if not baseline.lines[name].isdisjoint(span)]
            hint = self.hints.get(mutant.key)
            if hint in items:
                reach = [hint, *(name for name in reach if name != hint)]
            code = compiled(self.tree, mutant, self.source)
            cpu_s = CPU_S + CPU_FACTOR * sum(baseline.seconds[name] for name in reach)

            def work(tell: Callable[[Any], None], code: Any = code, reach: List[str] = reach) -> None:
                if not reach:
                    return tell({"state": UNREACHED})
                if not exchange(original, code, functions):
                    return tell({"state": STALE})
                by = run_items([items[name] for name in reach])
                return tell({"state": KILLED, "by": by} if by else {"state": SURVIVED})

            yield mutant, forked(work, cpu_s)

    def _functions(self) -> Dict[Tuple[str, int], List[types.FunctionType]]:
        """The functions of the source that live in this process, by name and first line."""
        found: Dict[Tuple[str, int], List[types.FunctionType]] = {}
        gc.unfreeze()
        for each in gc.get_objects():
            if type(each) is types.FunctionType and each.__code__.co_filename == self.source:
                found.setdefault((each.__code__.co_name, each.__code__.co_firstlineno), []).append(each)
        gc.freeze()
        return found


def exchange(original: types.CodeType, mutated: types.CodeType, functions: Dict[Any, List[Any]]) -> bool:
    """Give living functions their mutated code; False if there is none to exchange."""
    before, after = list(_nested(original)), list(_nested(mutated))
    if len(before) != len(after):
        return False
    changed = False
    for old, new in zip(before, after):
        key = (old.co_name, old.co_firstlineno)
        if old == new or key != (new.co_name, new.co_firstlineno):
            continue
        if sum((each.co_name, each.co_firstlineno) == key for each in before) > 1:
            return False
        for function in functions.get(key, ()):
            try:
                function.__code__ = new
            except ValueError:  # it has other free variables
                return False
            changed = True
    return changed


def _nested(code: types.CodeType) -> Iterator[types.CodeType]:
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            yield each
            yield from _nested(each)


class Mutated(importlib.machinery.SourceFileLoader):
    """Loads a module with a mutant."""

    code: types.CodeType

    def get_code(self, fullname: str) -> types.CodeType:
        """Return the mutated code in place of that of the file."""
        return self.code


class Finder(importlib.abc.MetaPathFinder):
    """Finds the mutated module before others find the file."""

    def __init__(self, name: str, path: str, code: types.CodeType) -> None:
        self.name, self.path, self.code = name, path, code

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> Any:
        """Return where the mutated module comes from; None for all others."""
        if fullname != self.name:
            return None
        loader = Mutated(fullname, self.path)
        loader.code = self.code
        return importlib.util.spec_from_file_location(fullname, self.path, loader=loader)


class First:
    """Notes the first test that fails."""

    by = ""

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Look at each phase of a test."""
        if report.failed and not self.by:
            self.by = report.nodeid

    def pytest_collectreport(self, report: Any) -> None:
        """Look at each file."""
        if report.failed and not self.by:
            self.by = report.nodeid


def run_fresh(work: Dict[str, Any], tell: Callable[[Mutant, Verdict], None]) -> None:
    """Run each mutant in a fork that imports all modules of the project itself."""
    source = os.path.abspath(work["source"])
    name = work["source"][: -len(".py")].replace("/", ".")
    tree = ast.parse(pathlib.Path(source).read_text())
    cpu_s = 10.0 + CPU_FACTOR * work["seconds"]
    left_out = [f"--deselect={name}" for name in work["slow"]]

    def jobs() -> Iterator[Tuple[Mutant, Child]]:
        for mutant in mutants_of(tree):
            if mutant.key in work["keys"]:
                code = compiled(tree, mutant, source)
                hint = work["hints"].get(mutant.key, "").split("::")[0]
                tests = sorted(work["tests"], key=lambda file, hint=hint: file != hint)  # type: ignore[misc]

                def start(tell: Callable[[Any], None], code: Any = code, tests: List[str] = tests) -> None:
                    sys.meta_path.insert(0, Finder(name, source, code))
                    importlib.import_module(name)  # before pytest, which has a finder of its own
                    first = First()
                    status = pytest.main([*OPTIONS, *left_out, "-x", *tests], plugins=[first])
                    passed = status == pytest.ExitCode.OK
                    tell(
                        {"state": SURVIVED}
                        if passed
                        else {"state": KILLED, "by": first.by or f"exit {status}"}
                    )

                yield mutant, forked(start, cpu_s)

    for mutant, verdict in in_turn(jobs(), work["workers"]):
        tell(mutant, verdict)


def main() -> None:
    """Do the work that standard input describes."""
    work = json.load(sys.stdin)
    out = os.fdopen(os.dup(1), "w")

    def tell(mutant: Mutant, verdict: Verdict) -> None:
        row = dict(zip(("key", "line", "kind", "before", "after"), mutant), **verdict._asdict())
        out.write(json.dumps(row) + "\n")
        out.flush()

    sys.stdout = sys.stderr
    if work["fresh"]:
        import hypothesis  # noqa: F401
        import numpy  # noqa: F401
        import yaml  # noqa: F401

        run_fresh(work, tell)
        return
    warm = Warm(work, tell)
    with warm.traced(warm.imported):
        pytest.main([*OPTIONS, *work["tests"]], plugins=[warm])
    if not warm.done:
        sys.exit(f"no run of {work['tests']}")
    out.write(json.dumps({"fresh": warm.fresh, "seconds": warm.seconds, "slow": warm.slow}) + "\n")
    out.flush()


if __name__ == "__main__":
    main()
