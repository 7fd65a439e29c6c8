"""Where the page is served, and what is needed to see it: address, certificate, tokens, links."""

import contextlib
import io
import socket
import ssl
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple
from urllib.parse import urlsplit

from mrl_driver.errors import ConfigError, PortBusy
from mrl_driver.host import access, certificate
from mrl_driver.transport.address import Address
from mrl_driver.transport.listener import bound

HOST, PORT = "127.0.0.1", 8642
SEND_BUFFER = 65536
"""The system keeps about this much for a client that does not read [byte]; what waits longer is replaced."""
DRIVE, WATCH = "drive", "watch"


class Settings(NamedTuple):
    """Where the page is served, and what is needed to see it."""

    host: str = HOST
    port: int = PORT  # 0 for any free port
    tokens: Optional[access.Tokens] = None  # None: everybody that reaches the address may drive
    context: Optional[ssl.SSLContext] = None  # certificate and key for TLS; None without
    names: Sequence[str] = ()  # what this computer is called besides localhost and its numeric addresses
    renewed: Callable[[], Optional[access.Tokens]] = lambda: None  # returns other tokens once they are stored

    def role(self, token: str) -> str:
        """Return what a token permits: `drive`, `watch`, or nothing (empty)."""
        return DRIVE if self.tokens is None else self.tokens.role(token)


def settings_for(
    listen: str, new_tokens: bool = False, tell: Callable[[str], None] = lambda line: None
) -> Settings:
    """Return the settings for ADDRESS or ADDRESS:PORT: beyond this computer with TLS and tokens.

    `new_tokens` makes other tokens, so that the links of before are no longer valid.  `tell` gets a line if the
    certificate had to be made again.  ConfigError if the address is wrong, or certificate or tokens cannot be stored.
    """
    host, port = address(listen)
    if access.is_loopback(host):
        if new_tokens:
            raise ConfigError(
                f"--new-tokens is given, but {host} needs no token; give an address of this computer with --listen"
            )
        return Settings(host, port)
    reachable = access.reachable(host)
    names = [*access.own_names(), *reachable]  # the links are to these, and they may be names
    context = certificate.context(names, tell)
    tokens = access.tokens(new_tokens)
    return Settings(host, port, tokens, context, names, access.TokenWatch(tokens).look)


def address(listen: str) -> Tuple[str, int]:
    """Return host and port of ADDRESS or ADDRESS:PORT; ConfigError if it is wrong."""
    with contextlib.suppress(ValueError):
        parts = urlsplit(f"//{listen.strip()}")
        if parts.hostname and parts.netloc == listen.strip() and "@" not in listen:
            return parts.hostname, PORT if parts.port is None else parts.port
    raise ConfigError(
        f"--listen is {listen!r}, expected ADDRESS or ADDRESS:PORT, such as 0.0.0.0 or 10.0.0.7:{PORT}"
    )


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def lines_for(settings: Settings, port: int, picture: bool = False) -> List[str]:
    """Return the links, and how to recognise the certificate, as lines for people.

    With `picture`, the first link to drive follows as a QR code for a terminal, if segno is installed.
    """

    def url(host: str) -> str:
        return f"{'https' if settings.context else 'http'}://{_bracketed(host)}:{port}/"

    if settings.tokens is None:
        return [url(settings.host)]
    urls = [url(host) for host in access.reachable(settings.host)]
    drive = [f"{url}#{DRIVE}={settings.tokens.drive}" for url in urls]
    return [
        *(f"to drive: {link}" for link in drive),
        *(f"to watch: {url}#{WATCH}={settings.tokens.watch}" for url in urls),
        "The browser warns about the certificate once; accept it if its SHA-256 fingerprint is this one:",
        certificate.fingerprint(),
        *(_qr_code(drive[0]) if picture else []),
    ]


def _qr_code(link: str) -> List[str]:
    try:
        import segno
    except ImportError:
        return []
    out = io.StringIO()
    segno.make(link, error="l", micro=False).terminal(out, compact=True, border=2)
    return out.getvalue().splitlines()


def listening_socket(host: str, port: int) -> socket.socket:
    """Return a socket that listens on an address of this computer; raise ConfigError or LinkError if it cannot."""
    try:
        end = bound(Address("tcp", host, port), socket.SOCK_STREAM, waiting=64)
    except PortBusy:
        again = f"{_bracketed(host)}:{port + 1 if port < 65535 else PORT}"
        raise PortBusy(
            f"{_bracketed(host)}:{port} is in use by another program; end that, or give another: --listen {again}"
        ) from None
    end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)  # connections have the same
    return end
