"""Tables of the Python board by row name: what each request does, and what each reply holds.

A request without arguments only asks for its reply, unless its entry does more.
"""

from typing import Any, Callable, Dict, Optional, Tuple

from mrl_driver.protocol.table import COMMANDS, Command

Values = Optional[Tuple[int, ...]]


def _asking(row: Command) -> Callable[..., None]:
    return lambda board: board.ask(row.name)


REQUESTS: Dict[str, Callable[..., None]] = {
    row.name: _asking(row) for row in COMMANDS if row.reply and not row.request and row.name != "xbee_text"
}
"""Called with the board and the request's arguments.  `xbee_text` is only a reply."""
REPLIES: Dict[str, Callable[[Any, int], Values]] = {}
"""Called with the board and the value given to `ask`; None if there is nothing to send."""
NEEDS: Dict[str, str] = {row.name: row.capability for row in COMMANDS if row.capability}
"""Capability of the board without which a request is unavailable."""
