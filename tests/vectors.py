"""Reads the golden wire vectors of `vectors.yaml`."""

import os
from functools import lru_cache
from typing import Any, Dict, List, NamedTuple

from mrl_driver import yaml_file
from mrl_driver.protocol import Event, Frame, Garbage, Stamp

_FILE = os.path.join(os.path.dirname(__file__), "vectors.yaml")


class Vector(NamedTuple):
    """Bytes on the wire, and the events they make.

    `events_at_line_end` adds the noise that only a line end, or the next frame, completes.
    """

    name: str
    checked: bool
    wire: bytes
    events: List[Event]
    events_at_line_end: List[Event]


def load(direction: str) -> List[Vector]:
    """The vectors of one direction, `requests` or `replies`."""
    return [_vector(row) for row in _rows()[direction]]


@lru_cache(maxsize=None)
def _rows() -> Any:
    return yaml_file.read(_FILE)


def _vector(row: Dict[str, Any]) -> Vector:
    stamps = [Stamp(*stamp) for stamp in row.get("stamps", [])]
    events = [_event(entry, stamps) for entry in row["events"]]
    pending = [Garbage(row["pending"].encode("latin-1"), "noise")] if "pending" in row else []
    return Vector(
        row["name"], row.get("checked", False), row["wire"].encode("latin-1"), events, events + pending
    )


def _event(entry: Any, stamps: List[Stamp]) -> Event:
    if isinstance(entry, dict):
        ((reason, data),) = entry.items()
        return Garbage(data.encode("latin-1"), reason)
    return Frame(entry[0], tuple(entry[1:]), stamps.pop(0) if stamps else None)
