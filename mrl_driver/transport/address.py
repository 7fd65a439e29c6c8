"""Ports given as URLs: `tcp://HOST:PORT`, `udp://HOST:PORT?bind=HOST:PORT`, `tls://TOKEN@HOST:PORT?sha256=FINGERPRINT`,
and pyserial's.  No I/O.
"""

import re
from typing import Dict, List, NamedTuple, Tuple
from urllib.parse import SplitResult, parse_qs, urlsplit

from mrl_driver.errors import ConfigError

TCP, UDP = ("tcp", "socket"), ("udp",)
"""Schemes of connections and of datagrams.  pyserial's `socket` is a plain TCP connection."""
TLS = ("tls",)
"""Scheme of encrypted connections, which need a token."""
NETWORK = TCP + UDP + TLS
OF_PYSERIAL = ("rfc2217", "spy", "loop", "alt", "hwgrep")
"""Schemes that pyserial opens."""
_EXAMPLE = "expected {scheme}://HOST:PORT, such as {scheme}://192.168.4.1:3333"
_TLS_EXAMPLE = "expected the link that `mrl serve` printed: tls://TOKEN@HOST:PORT?sha256=FINGERPRINT"
_TOKEN = re.compile(r"(?<=://)[^?]*(?=@)")
_HIDDEN = "***"
_SHA256 = re.compile(r"[0-9a-f]{64}")


class Address(NamedTuple):
    """One end of a network connection."""

    scheme: str
    """One of `NETWORK`."""
    host: str
    """Host name, or numeric address without brackets."""
    port: int
    bind: Tuple[str, int] = ("", 0)
    """Local address and port, if they matter; 0 for any port."""
    token: str = ""
    """What the other end asks for, with `tls`.  It is not part of the text."""
    sha256: str = ""
    """Fingerprint of the other end's certificate, with `tls`: 64 hexadecimal digits."""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


class SecretPort(str):
    """A port with a token, as it may be shown: the text has `***` in its place.  `url` has the token."""

    url: str

    def __new__(cls, url: str) -> "SecretPort":
        """Hide the token and the fingerprint of a URL."""
        port = super().__new__(cls, _TOKEN.sub(_HIDDEN, url).partition("?")[0])
        port.url = url
        return port


def masked(port: str) -> str:
    """Return a port that can be shown, logged and opened: without its token in the text, if it has one."""
    return SecretPort(port) if not isinstance(port, SecretPort) and _TOKEN.search(port) else port


def _url_of(port: str) -> str:
    """Return the port with its token."""
    return port.url if isinstance(port, SecretPort) else port


def is_url(port: str) -> bool:
    """Return whether `port` is a URL and not the name of a device."""
    return "://" in port


def is_network(port: str) -> bool:
    """Return whether `port` is a URL for a TCP connection, encrypted or not, or for UDP datagrams."""
    return is_url(port) and scheme_of(port) in NETWORK


def require_port(port: str) -> None:
    """Raise ConfigError if `port` is a URL that does not parse; device names are not checked."""
    if not is_url(port):
        return
    scheme = scheme_of(port)
    if scheme in NETWORK:
        parse(port)
    elif scheme == "rfc2217":
        _split(port, scheme)
    elif scheme != "loop" and not port.partition("://")[2]:
        raise ConfigError(
            f"port {port!r} names nothing, expected a device behind it, such as {port}/dev/ttyACM0"
        )


def scheme_of(url: str) -> str:
    """Return the scheme: the part before the colon.

    Raises:
        ConfigError: the scheme is unknown.
    """
    scheme = url.partition("://")[0].lower()
    if scheme not in NETWORK + OF_PYSERIAL:
        known = ", ".join(f"{name}://" for name in NETWORK + OF_PYSERIAL)
        raise ConfigError(
            f"port {masked(url)!r}: {scheme!r} is unknown, expected a device name, or one of {known}"
        )
    return scheme


def parse(url: str, listening: bool = False) -> Address:
    """Return the address in a `tcp`, `socket`, `udp` or `tls` URL.

    With `listening` port 0 means any free port, and `tls` needs neither token nor fingerprint.

    Raises:
        ConfigError: the URL does not parse.
    """
    shown, url = masked(url), _url_of(url)
    scheme = url.partition("://")[0].lower()
    if scheme not in NETWORK:
        raise ConfigError(
            f"port {shown!r} is not a network address, expected tcp://HOST:PORT or udp://HOST:PORT"
        )
    parts, host, port = _split(url, scheme, listening)
    try:
        queries = parse_qs(parts.query, True, True) if parts.query else {}  # Python 3.8 refuses an empty one
    except ValueError as error:
        raise _no_address(shown, scheme, f" ({error})") from None
    if scheme in TLS and not listening:
        return _secret(shown, parts, Address(scheme, host, port), queries)
    if parts.path not in ("", "/") or parts.username is not None or parts.fragment:
        raise _no_address(shown, scheme)
    return Address(scheme, host, port, _bind(shown, scheme, queries))


def _secret(shown: str, parts: SplitResult, address: Address, queries: Dict[str, List[str]]) -> Address:
    """Return the address with the token and the fingerprint of a `tls` URL."""
    token, sha256 = parts.username or "", "".join(queries.pop("sha256", ())).replace(":", "").lower()
    if token == _HIDDEN:
        raise ConfigError(f"port {shown!r} has stars in place of its token, {_TLS_EXAMPLE}")
    if parts.path not in ("", "/") or parts.fragment or queries or parts.password is not None or not token:
        raise ConfigError(f"port {shown!r} does not parse, {_TLS_EXAMPLE}")
    if not _SHA256.fullmatch(sha256):
        raise ConfigError(f"port {shown!r} has no fingerprint of 64 hexadecimal digits, {_TLS_EXAMPLE}")
    return address._replace(token=token, sha256=sha256)


def _split(url: str, scheme: str, listening: bool = False) -> Tuple[SplitResult, str, int]:
    """Return the parts of a URL, its host and its port."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise _no_address(url, scheme, f" ({error})") from None
    if not host or port is None or not (port or listening):
        raise _no_address(url, scheme)
    return parts, host, port


def _no_address(url: str, scheme: str, why: str = "") -> ConfigError:
    example = _TLS_EXAMPLE if scheme in TLS else _EXAMPLE.format(scheme=scheme)
    why = "" if _TOKEN.search(url) else why  # the reason may quote the token
    return ConfigError(f"port {masked(url)!r} does not parse{why}, {example}")


def _bind(url: str, scheme: str, queries: Dict[str, List[str]]) -> Tuple[str, int]:
    """Return the local address from `?bind=HOST:PORT`; the port may be absent."""
    if not queries:
        return "", 0
    wanted = queries.pop("bind", [""])[0]
    try:
        end = urlsplit("//" + wanted)
        host, port = end.hostname, end.port or 0
    except ValueError:
        host, port = None, 0
    if queries or scheme not in UDP or not host:
        raise ConfigError(
            f"port {url!r} does not parse, expected nothing behind the port but ?bind=HOST:PORT with udp://"
        )
    return host, port
