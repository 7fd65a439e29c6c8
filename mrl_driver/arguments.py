"""Arguments of public calls: checked, and converted to Python's own types.

Each error is one line that names the argument, what was got, and what was expected.
"""

import math
import reprlib
from collections.abc import Callable
from decimal import Decimal
from numbers import Integral, Real
from typing import Any, Sequence, Tuple, Type, TypeVar

from .errors import ConfigError, MrlError

Value = TypeVar("Value")


def shown(value: Any) -> str:
    """Return a value as errors show it, in a few words."""
    try:
        return reprlib.repr(value)
    except ValueError:
        return "a whole number of more digits than Python shows"


def number_of(value: Any) -> float:
    """Return a number as float: an int, float, Fraction, Decimal, or scalar of numpy.  NaN for all else, also for truth
    values and whole numbers beyond the largest float.
    """
    if type(value) is float:
        return value
    if isinstance(value, bool) or not isinstance(value, (Real, Decimal)):
        return math.nan
    try:
        return float(value)
    except (ArithmeticError, TypeError, ValueError):
        return math.nan


def require_number(name: str, value: Any, error: Type[MrlError] = ConfigError) -> float:
    """Return a finite number as float; raise `error` if it is something else."""
    number = number_of(value)
    if not math.isfinite(number):
        raise error(f"{name} is {shown(value)}, expected a finite number")
    return number


def require_numbers(name: str, values: Any, parts: Sequence[str]) -> Tuple[float, ...]:
    """Return these finite numbers as floats; raise ConfigError if they are something else."""
    try:
        given = tuple(values)
    except TypeError:
        given = ()
    if len(given) != len(parts):
        raise ConfigError(f"{name} is {shown(values)}, expected {' '.join(parts)}")
    return tuple(require_number(f"{part} of the {name}", value) for part, value in zip(parts, given))


def require_whole(name: str, value: Any, error: Type[MrlError] = ConfigError) -> int:
    """Return a whole number as int, also one of another type, such as 3.0; raise `error` if it is something else."""
    number = number_of(value)
    if not number.is_integer():
        raise error(f"{name} is {shown(value)}, expected a whole number")
    return int(value if isinstance(value, Integral) else number)


def require_function(name: str, value: Any) -> Any:
    """Return a function, or another object that can be called; raise ConfigError if it is something else."""
    return require_kind(name, value, Callable, "a function")


def require_text(name: str, value: Any, expected: str = "a text") -> None:
    """Raise ConfigError unless it is a text that is not empty."""
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{name} is {shown(value)}, expected {expected}")


def require_kind(
    name: str, value: Value, kind: Any, expected: str, error: Type[MrlError] = ConfigError
) -> Value:
    """Return a value of this type, or of one of these; raise `error` if it is something else."""
    if not isinstance(value, kind):
        raise error(f"{name} is {shown(value)}, expected {expected}")
    return value
