"""Compiles the model with spin and runs the checker: one compiled program serves all runs."""

import os
import pathlib
import re
import subprocess
import tempfile
from typing import Dict, List, NamedTuple, Tuple

from .constants import HEADER, TICK_MS

FOLDER = HEADER.parent
NAMES = ("line", "bus", "host", "port", "board", "holds", "bridge", "callback")
PARTS = {name: 1 << bit for bit, name in enumerate(NAMES)}
"""What may happen in a run; `stop.pml` says what each is."""
LINE, BUS, HOST, PORT, BOARD, HOLDS, BRIDGE, CALLBACK = PARTS.values()
(
    NO_WATCHDOG,
    NO_TIMEOUT,
    NO_FORGET,
    NO_REPEAT,
    NO_REASON,
    NO_BASELINE,
    NO_MOTOR_TIMEOUT,
    NO_REFUSAL,
    NO_RELEASE,
    NO_COMMAND_BEFORE,
) = range(31, 41)
"""Guards that a run can remove, besides the seeded bugs."""
ENDED, VIOLATED = "errors: 0", re.compile(r"^P(\d) violated$", re.M)


class Result(NamedTuple):
    """What one run has found."""

    broken: str  # The property that is violated, such as P1; empty if none is
    complete: bool  # All reachable states were visited
    states: int
    depth: int  # Ticks of the counterexample, or an upper bound of the steps of the search
    seconds: float
    memory_mb: float
    trace: Tuple[str, ...]  # The shortest sequence of events that violates the property, each with its time


def words(parts: int) -> str:
    return ", ".join(name for name, bit in PARTS.items() if parts & bit) or "commands alone"


def compile_model(folder: pathlib.Path, optimise: str = "-O2") -> pathlib.Path:
    """Return the checker, compiled in this folder; it searches breadth first, so traces are shortest."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("stop.pml", "constants.h"):
        (folder / name).write_bytes((FOLDER / name).read_bytes())
    subprocess.run(["spin", "-a", "stop.pml"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    flags = [optimise, "-w", "-DSAFETY", "-DBFS", "-DVECTORSZ=256"]
    subprocess.run(["gcc", *flags, "-o", "checker", "pan.c"], cwd=folder, check=True)
    return folder / "checker"


def run(checker: pathlib.Path, parts: int, limit_s: float = 3600.0, **settings: int) -> Result:
    """Search all states; `settings` are those of `stop.pml`: BUG, TICKS, PROPERTIES (bits), UDP, OLDER, BOTH."""
    given: Dict[str, str] = {name: str(value) for name, value in settings.items() if value}
    environment = {**os.environ, "PARTS": str(parts), **given}
    with tempfile.TemporaryDirectory() as folder:
        try:
            text = _run([str(checker), "-w20"], folder, environment, limit_s)
        except subprocess.TimeoutExpired:
            return Result("", False, 0, 0, limit_s, 0.0, ())
        depth, states = _number(r"depth reached (\d+)", text), _number(r"(\d+) states, stored", text)
        seconds, memory_mb = (
            _number(r"elapsed time ([\d.e+]+)", text),
            _number(r"([\d.]+)\s+total actual", text),
        )
        if ENDED in text:
            return Result("", True, int(states), int(depth), seconds, memory_mb, ())
        trace = _run([str(checker), "-r"], folder, environment, limit_s)
    found = VIOLATED.search(trace)
    assert found is not None, f"the checker failed without a property:\n{text}\n{trace}"
    events = _events(trace)
    return Result(
        f"P{found[1]}", False, int(states), 1 + trace.count("\n----"), seconds, memory_mb, tuple(events)
    )


def _run(command: List[str], folder: str, environment: Dict[str, str], limit_s: float) -> str:
    done = subprocess.run(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True, timeout=limit_s
    )
    return done.stdout


def _number(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    return float(found[1]) if found else 0.0


def _events(trace: str) -> List[str]:
    """Return the events of a replayed trace with the time of their tick."""
    time_ms, events = 0, []
    for line in trace.splitlines():
        if line == "----":
            time_ms += TICK_MS
        elif line and not re.match(r"\s*\d+:\s|spin:|pan:", line):
            events.append(f"{time_ms:5d} ms  {line}")
            if VIOLATED.match(line):
                return events
    return events
