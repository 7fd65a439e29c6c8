"""What waits to be sent to one client of the page: the newest message of each kind, never a queue of old ones."""

import asyncio
import contextlib
import time
from typing import Any, Awaitable, Callable, Dict, Optional

from mrl_driver.clocks import clock_s

from .messages import closed

CONGESTED_BYTES = 16384
"""With more unsent bytes than this in the program, messages wait, and newer ones replace them."""
STALLED_S = 5.0  # a client that accepts nothing for this time is closed [s]
LOOK_S = 0.05  # time between two looks at a connection that is congested [s]
ENDED = (ConnectionError, AttributeError)
"""What a connection raises that has ended; the second is Python 3.11's TLS transport, if it has just ended."""
MOST_PER_S = 200  # more messages of one client in a second close it; the page sends at most 80

Send = Callable[[str], Awaitable[Any]]


class Client:
    """One page that is connected; `number` is never used again, `role` is `drive` or `watch`, and others see `name`."""

    def __init__(self, number: int, role: str, name: str) -> None:
        self.number, self.role, self.name = number, role, name
        self.heard_s = time.monotonic()  # when its last message arrived [s]
        self.refused = 0  # messages in a row that were refused
        self.last = ""  # why the server ends the connection; empty while it does not
        self.gone = asyncio.Event()  # the connection is to end, or has ended
        self._transport: Optional[asyncio.Transport] = None
        self._waiting: Dict[str, str] = {}
        self._ready = asyncio.Event()
        self._second, self._in_second = 0, 0

    def put(self, kind: str, text: str) -> None:
        """Send this as soon as possible, in place of the message of this kind that still waits."""
        self._waiting[kind] = text
        self._ready.set()

    def end(self, why: str) -> None:
        """End the connection: its page is shown why."""
        self.last = self.last or why
        self.gone.set()
        self._ready.set()

    def abort(self) -> None:
        """Close the connection at once."""
        if self._transport is not None and not self._transport.is_closing():
            with contextlib.suppress(*ENDED):
                self._transport.abort()

    def is_flooding(self, now_s: float) -> bool:
        """Count a message, ping or pong; return whether the client sends more than `MOST_PER_S`."""
        if int(now_s) != self._second:
            self._second, self._in_second = int(now_s), 0
        self._in_second += 1
        return self._in_second > MOST_PER_S

    async def pump(
        self, send: Send, transport: asyncio.Transport, close: Callable[[], Awaitable[Any]]
    ) -> None:
        """Send what waits, until the connection is to end; its last message says why.

        A connection that is gone, or on which the client accepts no data, is closed at once.
        """
        self._transport, free_s = transport, time.monotonic()
        with contextlib.suppress(*ENDED):
            while not self.gone.is_set():
                await self._ready.wait()
                self._ready.clear()
                while self._waiting and not self.gone.is_set():
                    if transport.is_closing():
                        raise ConnectionResetError
                    now_s = time.monotonic()
                    if transport.get_write_buffer_size() <= CONGESTED_BYTES:
                        free_s = now_s
                        await send(self._waiting.pop(next(iter(self._waiting))))
                    elif now_s - free_s > STALLED_S:
                        raise ConnectionResetError
                    else:
                        await asyncio.sleep(LOOK_S)
                free_s = time.monotonic()
            uncongested = transport.get_write_buffer_size() <= CONGESTED_BYTES
            if self.last and not transport.is_closing() and uncongested:
                await send(closed(clock_s(), self.last))
            await close()
            return
        self.abort()
