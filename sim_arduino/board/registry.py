"""Registry of the Python board's handlers for the rows of the table, and code that the handlers share."""

from typing import TYPE_CHECKING, Callable, Dict, Optional, Tuple

from mrl_driver.protocol.table import BY_NAME

if TYPE_CHECKING:
    from .python_board import PythonBoard

Values = Optional[Tuple[int, ...]]
Builder = Callable[["PythonBoard", int], Values]
REQUESTS: Dict[str, Callable[..., None]] = {}
"""Request handlers by row name; called with the board and the request's arguments."""
REPLIES: Dict[int, Builder] = {}
"""Reply builders by code; called with the board and the value given to `ask`; None if there is nothing to send."""


def request(handler: Callable[..., None]) -> Callable[..., None]:
    """Registers a function as the handler of the row with its name."""
    REQUESTS[handler.__name__] = handler
    return handler


def reply(name: str) -> Callable[[Builder], Builder]:
    """Registers a function as the builder of the reply of row `name`."""

    def register(builder: Builder) -> Builder:
        REPLIES[BY_NAME[name].code] = builder
        return builder

    return register


def asks(*names: str) -> None:
    """Registers rows that only reply."""
    for name in names:
        code = BY_NAME[name].code
        REQUESTS[name] = lambda board, code=code: board.ask(code)


def with_motors(board: "PythonBoard") -> bool:
    """Whether the motor board answers; counts a refusal if not."""
    there = board.motor_there()
    if not there:
        board.refuse("unavailable")
    return there
