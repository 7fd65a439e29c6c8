"""Registry of what each row of the table does on the Python board, and what its handlers share."""

from typing import TYPE_CHECKING, Callable, Dict, Optional, Tuple

from mrl_driver.protocol.table import BY_NAME

if TYPE_CHECKING:
    from .python_board import PythonBoard

Values = Optional[Tuple[int, ...]]
Builder = Callable[["PythonBoard", int], Values]
REQUESTS: Dict[str, Callable[..., None]] = {}
"""By row name: called with the board and the request's arguments."""
REPLIES: Dict[int, Builder] = {}
"""By reply code: called with the board and a reminder; None if there is nothing valid to send."""


def request(handler: Callable[..., None]) -> Callable[..., None]:
    """Registers the handler of the row of that name."""
    REQUESTS[handler.__name__] = handler
    return handler


def reply(name: str) -> Callable[[Builder], Builder]:
    """Registers what builds the reply of row `name`."""

    def register(builder: Builder) -> Builder:
        REPLIES[BY_NAME[name].code] = builder
        return builder

    return register


def asks(*names: str) -> None:
    """Registers rows that do nothing but answer."""
    for name in names:
        code = BY_NAME[name].code
        REQUESTS[name] = lambda board, code=code: board.ask(code)


def with_motors(board: "PythonBoard") -> bool:
    """Whether the motor board answers; counts a refusal if not."""
    there = board.motor_there()
    if not there:
        board.refuse("unavailable")
    return there
