"""Registry of the Python board's handlers: one request handler for each row of the table, one builder for each reply.

Each handler has the name of its row; a test fails if a row has no handler.
"""

from typing import Any, Callable, Dict, Optional, Tuple

from mrl_driver.protocol.table import BY_NAME

Values = Optional[Tuple[int, ...]]
Builder = Callable[[Any, int], Values]
REQUESTS: Dict[str, Callable[..., None]] = {}
"""Request handlers by row name; called with the board and the request's arguments."""
REPLIES: Dict[int, Builder] = {}
"""Reply builders by code; called with the board and the value given to `ask`; None if there is nothing to send."""


def request(handler: Callable[..., None]) -> Callable[..., None]:
    """Register a function as the handler of the row with its name."""
    REQUESTS[handler.__name__] = handler
    return handler


def reply(name: str) -> Callable[[Builder], Builder]:
    """Register a function as the builder of the reply of row `name`."""

    def register(builder: Builder) -> Builder:
        REPLIES[BY_NAME[name].code] = builder
        return builder

    return register


def asks(*names: str) -> None:
    """Register rows that only reply."""
    for name in names:
        code = BY_NAME[name].code
        REQUESTS[name] = lambda board, code=code: board.ask(code)
