"""Private parameters as data: one row each, checked before a node starts to work.  Pure, no ROS.

Each node has its rows in its own module; those of robot_node are in `robot_parameters`.
"""

import dataclasses
import math
from typing import Any, Dict, Mapping, NamedTuple, Optional, Sequence, Tuple, get_type_hints

from mrl_driver.errors import ConfigError

FRAMES = ("odom_frame", "base_frame", "map_frame")  # Parameters that hold the name of a frame
_SLOWEST, _FASTEST_M_S, _FASTEST_RAD_S = 0.01, 10.0, 100.0


class Row(NamedTuple):
    """One parameter; a `default` of None means that the parameter is required.

    `kind` is str, bool, int or float.  `low` and `high` bound numbers in `unit`; `choices` replaces both bounds.  A
    string may be empty if the default is empty.
    """

    name: str
    kind: type
    default: Any
    unit: str
    text: str
    low: float = -math.inf
    high: float = math.inf
    choices: Tuple[Any, ...] = ()


def parameter(
    default: Any,
    text: str,
    bounds: Tuple[float, float] = (-math.inf, math.inf),
    unit: str = "",
    choices: Tuple[Any, ...] = (),
) -> Any:
    """A field of a dataclass that holds a node's parameters; its name and type complete the `Row`."""
    return dataclasses.field(
        default=default, metadata={"row": (default, unit, text, *map(float, bounds), choices)}
    )


def rows_of(parameters: type) -> Tuple[Row, ...]:
    """The rows of a dataclass, of those fields that `parameter` made."""
    kinds, declared = get_type_hints(parameters), dataclasses.fields(parameters)
    return tuple(
        Row(each.name, kinds[each.name], *each.metadata["row"]) for each in declared if each.metadata
    )


def speed_rows(
    linear: str, angular: str, linear_m_s: float = 0.25, angular_rad_s: float = 0.9
) -> Tuple[Row, Row]:
    """The two speed parameters of a node that drives; `linear` and `angular` describe them."""
    return (
        Row("linear_speed", float, linear_m_s, "m/s", linear, _SLOWEST, _FASTEST_M_S),
        Row("angular_speed", float, angular_rad_s, "rad/s", angular, _SLOWEST, _FASTEST_RAD_S),
    )


def read(
    rows: Sequence[Row], given: Mapping[str, Any], namespace: str, lists: Sequence[str] = ()
) -> Dict[str, Any]:
    """Name to value of a node's parameters; `given` holds the contents of its private namespace.

    `lists` names parameters that the node reads by itself; they are left out.  ConfigError if a value is missing, of
    the wrong type or out of range, or a name is unknown.
    """
    names = [*lists, *(row.name for row in rows)]
    for name in given:
        if name not in names:
            raise ConfigError(
                f"parameter {namespace}/{name} is unknown, expected {', '.join(names)}; "
                f"`rosparam delete {namespace}/{name}` removes one that an earlier run has left"
            )
    return {row.name: _value(row, given.get(row.name), namespace) for row in rows}


def expected(row: Row) -> str:
    """The values that a row allows, as text: `a number from 0.05 to 10 s`."""
    unit = f" {row.unit}" if row.unit else ""
    if row.kind is bool:
        return "true or false"
    if row.choices:
        return f"one of {', '.join(str(each) or 'empty' for each in row.choices)}{unit}"
    if row.kind is float:
        return f"a number from {row.low:g} to {row.high:g}{unit}"
    if row.name in FRAMES:
        return "a frame name without a leading slash or blanks"
    return f"the {row.text[0].lower()}{row.text[1:]}"


def default_text(row: Row) -> str:
    """The default as launch files have it: `0.5`, `true`."""
    if row.kind is bool:
        return str(row.default).lower()
    return f"{row.default:g}" if row.kind is float else str(row.default)


def usage(name: str, about: str, rows: Sequence[Row]) -> str:
    """The answer of a node to `--help`; `about` is the docstring of its module."""
    lines = [
        f"usage: rosrun mrl_robots {name} [_PARAMETER:=VALUE ...] [NAME:=OTHER_NAME ...]",
        "",
        about.strip(),
        "",
    ]
    for row in rows:
        default = "" if row.default is None else f"; default {default_text(row) or 'empty'}"
        allowed = "text" if row.kind is str and not row.choices else expected(row)
        lines += [f"  _{row.name}:=VALUE  ({allowed}{default})", f"        {row.text}"]
    return "\n".join(lines).rstrip() + "\n"


def _value(row: Row, got: Any, namespace: str) -> Any:
    if got is None:
        if row.default is None:
            raise ConfigError(f"parameter {namespace}/{row.name} is missing, expected {expected(row)}")
        return row.default
    value = _typed(row, got)
    if value is None:
        raise ConfigError(f"parameter {namespace}/{row.name} is {got!r}, expected {expected(row)}")
    return value


def _typed(row: Row, got: Any) -> Optional[Any]:
    """The value in the row's type, or None if the row does not allow it."""
    if row.kind is bool:
        return got if isinstance(got, bool) else None
    if row.kind is str:
        good = isinstance(got, str) and (got in row.choices if row.choices else _is_text(row, got))
        return got if good else None
    if isinstance(got, bool) or not isinstance(got, (int, float)):
        return None
    if row.choices:
        return int(got) if got in row.choices else None
    return float(got) if row.low <= got <= row.high else None


def _is_text(row: Row, got: str) -> bool:
    if row.name in FRAMES:
        return bool(got) and not got.startswith("/") and not any(c.isspace() for c in got)
    return (bool(got.strip()) or got == row.default) and got.isprintable()
