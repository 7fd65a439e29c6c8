"""Registry of the Python board's handlers: one request handler for each row of the table, one builder for each reply.

A request without arguments only asks for its reply, unless a handler with the row's name does more.
"""

from typing import Any, Callable, Dict, Optional, Tuple

from mrl_driver.protocol.table import BY_NAME, COMMANDS, SENSORS, Command

Values = Optional[Tuple[int, ...]]
Builder = Callable[[Any, int], Values]


def _asking(row: Command) -> Callable[..., None]:
    return lambda board: board.ask(row.code)


REQUESTS: Dict[str, Callable[..., None]] = {
    row.name: _asking(row) for row in COMMANDS if row.reply and not row.request and row.name != "xbee_text"
}
"""Request handlers by row name; called with the board and the request's arguments.  `xbee_text` is only a reply."""
REPLIES: Dict[int, Builder] = {}
"""Reply builders by code; called with the board and the value given to `ask`; None if there is nothing to send."""
NEEDS: Dict[str, str] = {
    **{row.command.name: row.capability for row in SENSORS if row.capability},
    **dict.fromkeys(
        ("start_sensor_stream", "start_sensor_ldr_stream", "start_compass_stream"), "environment"
    ),
    **dict.fromkeys(("read_imu", "start_imu_stream"), "imu"),
    **dict.fromkeys(("read_radio", "release_hold"), "hold"),
}
"""Capability of the board without which a request is unavailable, by row name."""


def request(handler: Callable[..., None]) -> Callable[..., None]:
    """Register a function as the handler of the row with its name."""
    REQUESTS[handler.__name__] = handler
    return handler


def reply(*names: str) -> Callable[[Builder], Builder]:
    """Register a function as the builder of the replies of these rows."""

    def register(builder: Builder) -> Builder:
        REPLIES.update({BY_NAME[name].code: builder for name in names})
        return builder

    return register
