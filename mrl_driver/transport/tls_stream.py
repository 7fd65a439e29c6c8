"""TLS without I/O: bytes of the network and plain bytes go in and out.  Both ends use it.

After the handshake the client sends `GREETING`, its token and a line end.  The listening end answers with one line of
`ANSWERS`; then the board's bytes pass in both directions.
"""

import ssl

GREETING = b"MRL1 "
ACCEPTED, BUSY, REFUSED = b"accepted\n", b"busy\n", b"refused\n"
ANSWERS = (ACCEPTED, BUSY, REFUSED)
_RECORD = 16384
"""Most plain bytes in one record of TLS."""


class TlsStream:
    """One end of a TLS connection.  Not for several threads at once.

    Attributes:
        open: the handshake is done.
        ended: the other end has said that it sends no more.
    """

    def __init__(self, context: ssl.SSLContext, server_side: bool) -> None:
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._incoming, self._outgoing, server_side)
        self.open = self.ended = False

    def receive(self, data: bytes) -> bytes:
        """Take bytes of the network; return the plain bytes that they complete.

        Raises:
            ssl.SSLError: the bytes are not TLS, or were changed in between, or the handshake failed.
        """
        self._incoming.write(data)
        plain = b""
        try:
            if not self.open:
                self._tls.do_handshake()
                self.open = True
            more = self._tls.read(_RECORD)
            while more:
                plain += more
                more = self._tls.read(_RECORD)
            self.ended = True
        except ssl.SSLWantReadError:
            pass
        except ssl.SSLZeroReturnError:
            self.ended = True
        return plain

    def send(self, data: bytes) -> None:
        """Encrypt plain bytes, for `take`; only while `open`."""
        self._tls.write(data)

    def take(self) -> bytes:
        """Return the bytes for the network."""
        return self._outgoing.read()

    def certificate(self) -> bytes:
        """Return the certificate of the other end, in DER; empty if it has none."""
        return self._tls.getpeercert(True) or b""
