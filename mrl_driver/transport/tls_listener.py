"""The listening end of an encrypted connection to a board: one client at a time, which has shown its token.

Nothing here blocks: a handshake goes on in steps, between the bytes of the client, and has `ENTER_S`.  No byte of a
connection without a token leaves this module.
"""

import contextlib
import select
import socket
import ssl
import time
from typing import Callable, Dict, Optional

from .address import Address
from .listener import READ_SIZE, TLS_ONLY, bound, prompt, spell
from .teller import Teller
from .tls_stream import ACCEPTED, BUSY, GREETING, REFUSED, TlsStream

ENTER_S = 5.0
"""Time for handshake and token [s]."""
LEAVE_S = 1.0
"""Time for a refused client to read why [s]."""
MOST_CALLERS = 16
"""At most this many connections may be in their handshake; one more ends the oldest."""
MOST_STEPS = 4
"""At most this many steps of handshakes are made between two looks at the client's bytes; one takes 1 ms on a PC."""
MOST_UNSENT = 16384
"""While more bytes than these wait for the client, further ones from the board are dropped [byte]."""
_LONGEST_TOKEN = 256
TELL_S = 1.0
"""Least time between two lines about wrong tokens [s]."""
_HANDSHAKE = 0x16
"""First byte of a TLS connection."""
_TLS_ONLY = TLS_ONLY + b"only; use the link that mrl serve printed.\r\n"


class _Connection:
    """A connection, before and after it has shown its token.

    Attributes:
        plain: bytes that were received and not yet used.
        gone: the other end has left, or has sent what is not TLS.
        leaving: it was refused; what it sends is dropped.
        due_s: it is closed then, if it is not the client.
    """

    def __init__(self, end: socket.socket, name: str, context: ssl.SSLContext) -> None:
        self.end, self.name = end, name
        self._stream = TlsStream(context, server_side=True)
        self._heard = self.gone = self.leaving = False
        self._unsent = b""
        self.plain = b""
        self.due_s = time.monotonic() + ENTER_S

    def receive(self) -> None:
        """Read what has arrived, once."""
        try:
            data = self.end.recv(READ_SIZE)
            self.gone = self.gone or not data
        except BlockingIOError:
            return
        except OSError:
            self.gone = True
            return
        if self.leaving or not data:
            return
        if not self._heard and data[0] != _HANDSHAKE:
            self._leave(_TLS_ONLY)
            return
        self._heard = True
        try:
            self.plain += self._stream.receive(data)
            self.gone = self._stream.ended
        except ssl.SSLError:
            self._leave(b"")
        self.flush()

    def send(self, data: bytes) -> int:
        """Send plain bytes; return their number, or 0 if there is no room."""
        self.flush()
        if len(self._unsent) > MOST_UNSENT:
            return 0
        self._stream.send(data)
        self.flush()
        return len(data)

    def flush(self) -> None:
        """Send what waits, as far as there is room."""
        self._unsent += self._stream.take()
        try:
            while self._unsent:
                self._unsent = self._unsent[self.end.send(self._unsent) :]
        except BlockingIOError:
            return
        except OSError:
            self.gone = True

    def has_left(self) -> bool:
        """Return whether the other end has closed the connection, and all that it sent was read."""
        try:
            return not self.end.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def refuse(self, answer: bytes) -> None:
        """Send why; the connection is closed when the other end has read it, or after `LEAVE_S`."""
        self._stream.send(answer)
        self._leave(b"")

    def _leave(self, words: bytes) -> None:
        self._unsent += words
        self.flush()
        self.leaving, self.due_s = True, time.monotonic() + LEAVE_S
        with contextlib.suppress(OSError):
            self.end.shutdown(socket.SHUT_WR)


class TlsListener:
    """Accepts TLS connections that show a token; otherwise as `TcpListener`.

    Args:
        address: address of this computer.
        context: settings of the TLS server, with its certificate.
        admits: returns whether a token may drive the robot.
        tell: called by a `Teller` with a line of text if a token was wrong, at most once a second.

    Raises:
        ConfigError: the address does not belong to this computer.
        PortBusy, PortDenied, LinkError: listening on the address is not possible.
    """

    def __init__(
        self,
        address: Address,
        context: ssl.SSLContext,
        admits: Callable[[str], bool],
        tell: Callable[[str], None],
    ) -> None:
        self._context, self._admits = context, admits
        self._listening = bound(address, socket.SOCK_STREAM, waiting=4 * MOST_CALLERS)
        self._tell = Teller(tell)
        self._epoll = select.epoll()
        self._epoll.register(self._listening, select.EPOLLIN)
        self._callers: Dict[int, _Connection] = {}
        self._end: Optional[_Connection] = None
        self._told_s, self._untold = -TELL_S, 0
        self.address = address._replace(port=self._listening.getsockname()[1])
        self.client = ""

    @property
    def watch(self) -> Optional[int]:
        """As `Listener.watch`; also readable while a handshake goes on."""
        return self._epoll.fileno()

    @property
    def data(self) -> Optional[int]:
        """As `Listener.data`."""
        return self._end.end.fileno() if self._end is not None else None

    def attend(self) -> bool:
        """As `Listener.attend`: go on with some handshakes, one step each."""
        came = False
        for fd, _ in self._epoll.poll(0, MOST_STEPS):
            if fd == self._listening.fileno():
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    for _ in range(MOST_STEPS):
                        self._accept()
            elif fd in self._callers:  # or it made room for another one
                came = self._go_on(self._callers[fd]) or came
        now = time.monotonic()
        for caller in [caller for caller in self._callers.values() if now >= caller.due_s]:
            self._dismiss(caller).end.close()
        return came

    def _accept(self) -> None:
        end, name = self._listening.accept()
        end.setblocking(False)
        prompt(end)
        if len(self._callers) >= MOST_CALLERS:
            self._dismiss(next(iter(self._callers.values()))).end.close()
        self._callers[end.fileno()] = _Connection(end, spell(name), self._context)
        self._epoll.register(end, select.EPOLLIN)

    def _dismiss(self, caller: _Connection) -> _Connection:
        """Watch a connection no more; return it."""
        self._epoll.unregister(caller.end)
        return self._callers.pop(caller.end.fileno())

    def _go_on(self, caller: _Connection) -> bool:
        """Go on with one handshake; return True if the connection is now the client."""
        caller.receive()
        if caller.gone:
            self._dismiss(caller).end.close()
            return False
        line, ended, rest = caller.plain.partition(b"\n")
        if caller.leaving or not (ended or len(line) > _LONGEST_TOKEN):
            return False
        token = line[len(GREETING) :].decode("utf-8", "replace")
        if not ended or not line.startswith(GREETING) or not self._admits(token):
            caller.refuse(REFUSED)
            self._tell_of(caller)
            return False
        if self._end is not None and self._end.has_left():
            self.drop()
        if self._end is not None:
            caller.refuse(BUSY)
            return False
        self._end, self.client = self._dismiss(caller), caller.name
        caller.plain = rest
        caller.send(ACCEPTED)
        return True

    def _tell_of(self, caller: _Connection) -> None:
        now = time.monotonic()
        if now - self._told_s < TELL_S:
            self._untold += 1
            return
        more = f"; {self._untold} more since the last such line" if self._untold else ""
        self._tell(f"{caller.name} was refused: wrong token{more}")
        self._told_s, self._untold = now, 0

    def _drop_if_gone(self) -> None:
        if self._end is not None and (self._end.gone or self._end.leaving):
            self.drop()

    def read(self, limit: int = READ_SIZE) -> bytes:
        """As `Listener.read`; `limit` does not apply."""
        if self._end is None:
            return b""
        end = self._end
        end.receive()
        data, end.plain = end.plain, b""
        self._drop_if_gone()
        return data

    def write(self, data: bytes) -> int:
        """As `Listener.write`."""
        if self._end is None:
            return 0
        sent = self._end.send(data)
        self._drop_if_gone()
        return sent

    def drop(self) -> None:
        """As `Listener.drop`."""
        if self._end is not None:
            self._end.end.close()
        self._end, self.client = None, ""

    def close(self) -> None:
        """As `Listener.close`."""
        self.drop()
        for caller in list(self._callers.values()):
            self._dismiss(caller).end.close()
        self._epoll.close()
        self._listening.close()
        self._tell.close()
