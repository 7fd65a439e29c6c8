"""A kind of fault, and the decorator that makes one of a function or class."""

from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple, TypeVar

from .key_values import Key

FOREVER_S = 1e9
_Made = TypeVar("_Made", bound=Callable[..., Any])


class FaultKind(NamedTuple):
    """A kind of fault.

    `make` of a fault of the serial link is called with a random generator and the parameters.  `switch` of a fault of
    the hardware is called with the plant, whether the fault is on, and the parameters; it needs the hardware `needs`, a
    key of `hardware_faults.NEEDS`, or "" for that of all robots.
    """

    name: str
    text: str
    parameters: Tuple[Key, ...] = ()
    make: Optional[Callable[..., Any]] = None
    at_s: float = 0.0
    lasts_s: float = FOREVER_S
    switch: Optional[Callable[..., None]] = None
    needs: str = ""


KINDS: Dict[str, FaultKind] = {}  # all kinds by name


def fault(*parameters: Key, **others: Any) -> Callable[[_Made], _Made]:
    """Makes a fault of a function that switches it, or of a class for one on the serial link.

    Its name and the first line of its docstring are the fault's name and text, if `others` have none.
    """

    def keep(made: _Made) -> _Made:
        text = (made.__doc__ or "").split("\n")[0].rstrip(".")
        use = "make" if isinstance(made, type) else "switch"
        row = {
            "name": made.__name__.lower().strip("_"),
            "text": text[:1].lower() + text[1:],
            use: made,
            **others,
        }
        KINDS[row["name"]] = FaultKind(parameters=parameters, **row)
        return made

    return keep
