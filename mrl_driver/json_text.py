"""JSON text of values that may contain numbers which JSON does not have."""

import json
import math
from numbers import Integral, Real
from typing import Any


def json_text(value: Any, compact: bool = False) -> str:
    """Return a value as JSON: NaN becomes null, and the infinities become the strings "inf" and "-inf".

    `compact` leaves out the spaces.
    """
    separators = (",", ":") if compact else None
    try:
        return json.dumps(value, separators=separators, allow_nan=False)
    except ValueError:
        return json.dumps(_plain(value), separators=separators)


def exact_json(value: Any) -> str:
    """Return a value as JSON with NaN and Infinity, from which `json.loads` gives the same numbers.

    Numbers of numpy and sets are taken as well, and anything else as its text: a program's own robot model may hold
    them, and the driver that records it must not end for that.
    """
    return json.dumps(value, default=_usual)


def _usual(value: Any) -> Any:
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value)
    return list(value) if isinstance(value, (set, frozenset)) else str(value)


def _plain(value: Any) -> Any:
    """Return a value without numbers that JSON does not have."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value
