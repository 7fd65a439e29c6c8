"""Turns a sequence of events of the model into one of the explorer."""

from typing import Dict, Iterable, List

from tests.long.verify.model.constants import TICK_MS

LETTERS: Dict[str, str] = {
    "the bytes to the board are lost": "l",
    "telemetry is lost": "m",
    "the bytes of both directions are lost": "lm",
    "the motor board refuses a transfer": "n",
    "drive": "d",
    "stop": "s",
    "emergency stop": "i",
    "release of the emergency stop": "u",
    "close": "x",
    "the port comes back": "c",
    "another board is on the port": "o",
    "the board resets": "r",
}
"""The explorer's port goes away and comes back in one event, and its board starts at once."""
WITH_NEXT = ("the port goes away", "the board has started")
TIMELESS = "lmn"


def path_of(trace: Iterable[str]) -> str:
    """Return the events of `Result.trace` by letter: faults of a tick come first, and a tick without events is a wait.

    Raises:
        ValueError: an event of the model has no counterpart here.
    """
    ticks: Dict[int, List[str]] = {}
    for line in trace:
        time_ms, event = line.strip().split(" ms  ")
        tick = int(time_ms) // TICK_MS
        ticks.setdefault(tick, [])
        if event.endswith("violated"):
            break
        if event in WITH_NEXT:
            continue
        if event not in LETTERS:
            raise ValueError(f"event {event!r} of the model has none here, expected one of {sorted(LETTERS)}")
        ticks[tick].append(LETTERS[event])
    path = ""
    for tick in range(max(ticks, default=-1) + 1):
        letters = "".join(sorted(ticks.get(tick, []), key=lambda letter: letter[0] not in TIMELESS))
        path += letters if letters.strip(TIMELESS) else letters + "w"
    return path
