"""An encrypted connection to `mrl serve`: `tls://TOKEN@HOST:PORT?sha256=FINGERPRINT`.

No authority vouches for the other end: its certificate must be the one with this fingerprint, before it gets the token.
"""

import hashlib
import hmac
import socket
import ssl
import time
from typing import Callable

from mrl_driver.errors import LinkError, LinkLost, PortBusy, PortDenied, PortMissing

from .address import Address, masked, parse
from .link import READ_SIZE, WRITE_TIMEOUT_S
from .sockets import SocketLink, connect, explain
from .tls_stream import ANSWERS, BUSY, GREETING, REFUSED, TlsStream

_LONGEST_ANSWER = 64


def _context() -> ssl.SSLContext:
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.check_hostname, made.verify_mode = False, ssl.CERT_NONE  # the fingerprint is compared instead
    return made


class TlsLink(SocketLink):
    """A connection that carries the board's bytes, after handshake and token.

    Raises:
        ConfigError: the URL does not parse.
        PortMissing: as `TcpLink`, or the other end does not speak TLS, or gives no answer within `patience_s`.
        PortDenied: the token is wrong.
        PortBusy: the other end serves another client.
        LinkError: the other end has another certificate.
    """

    def __init__(self, port: str, patience_s: float) -> None:
        deadline, address, shown = time.monotonic() + patience_s, parse(port), masked(port)
        self._stream = TlsStream(_context(), server_side=False)
        self._socket = connect(address, shown, patience_s)
        try:
            self._early = _enter(self._socket, self._stream, address, shown, deadline)
        except BaseException:
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self._begin(shown, self._socket.fileno())

    def read(self, timeout_s: float) -> bytes:
        """As `Link.read`; empty also if the bytes that arrived are only a part of what was encrypted together."""
        if self._early:
            plain, self._early = self._early, b""
            return plain
        data = super().read(timeout_s)
        if not data:
            return b""
        with self._writing:
            try:
                return self._stream.receive(data)
            except ssl.SSLError:
                raise LinkLost(
                    f"{self.port} went away (its data arrived damaged): check the network, then connect again"
                ) from None

    def _send(self, data: bytes, deadline: float = 0.0) -> None:
        """As that of the other links; what is encrypted must go out before anything else, so wait for room first."""
        deadline = deadline or time.monotonic() + WRITE_TIMEOUT_S
        super()._send(self._unsent, deadline)
        self._await_room(deadline)
        with self._writing:
            if self.closed:
                raise LinkLost(f"{self.port} is closed")
            self._stream.send(data)
            encrypted = self._stream.take()
        super()._send(encrypted, deadline)


def _enter(end: socket.socket, stream: TlsStream, address: Address, port: str, deadline: float) -> bytes:
    """Make the handshake, compare the certificate, show the token; return the board's first bytes."""
    plain = _exchange(end, stream, lambda plain: stream.open, port, deadline)
    found = hashlib.sha256(stream.certificate()).hexdigest()
    if not hmac.compare_digest(found, address.sha256):
        raise LinkError(
            f"{port} has another certificate (SHA-256 {found[:16]}...) than this link ({address.sha256[:16]}...): use "
            "the link that `mrl serve` prints now; if it is the same, another computer answers at this address"
        )
    stream.send(GREETING + address.token.encode() + b"\n")
    plain += _exchange(
        end, stream, lambda more: b"\n" in plain + more or len(more) > _LONGEST_ANSWER, port, deadline
    )
    answer, ended, rest = plain.partition(b"\n")
    if answer + ended == REFUSED:
        raise PortDenied(
            f"{port} refuses the token: use the link that `mrl serve` prints now; a watch-only token does not drive"
        )
    if answer + ended == BUSY:
        raise PortBusy(f"{port} is in use by another program; end that program, or choose another port")
    if answer + ended not in ANSWERS:
        raise PortMissing(f"{port} answers {plain[:24]!r}, expected `mrl serve`: check the port number")
    return rest


def _exchange(
    end: socket.socket, stream: TlsStream, done: Callable[[bytes], bool], port: str, deadline: float
) -> bytes:
    """Send and receive until `done(plain)`; return the plain bytes that came.

    Raises:
        PortMissing, LinkError: the other end is silent, has closed the connection, or does not speak TLS.
    """
    plain = data = b""
    try:
        while True:
            plain += stream.receive(data)
            end.settimeout(max(0.001, deadline - time.monotonic()))
            end.sendall(stream.take())
            if done(plain):
                return plain
            data = end.recv(READ_SIZE)
            if not data:
                raise PortMissing(
                    f"{port} cannot be opened (the other end closed the connection): {_NOT_TLS}"
                )
    except ssl.SSLError as error:
        raise PortMissing(
            f"{port} cannot be opened (no TLS: {(error.reason or 'damaged').lower().replace('_', ' ')}): {_NOT_TLS}"
        ) from None
    except socket.timeout:
        raise PortMissing(f"{port} cannot be opened (no answer by TLS in time): {_NOT_TLS}") from None
    except OSError as error:
        raise explain(port, error) from None


_NOT_TLS = "if the bridge there does not encrypt, use tcp://HOST:PORT; otherwise check the port number"
