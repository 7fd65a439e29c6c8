"""Ports given as URLs: `tcp://HOST:PORT`, `udp://HOST:PORT?bind=HOST:PORT`, and pyserial's.  No I/O."""

import contextlib
from typing import Dict, List, NamedTuple, Optional, Tuple
from urllib.parse import SplitResult, parse_qs, urlsplit

from mrl_driver.errors import ConfigError

TCP, UDP = ("tcp", "socket"), ("udp",)
"""Schemes of connections and of datagrams.  pyserial's `socket` is a plain TCP connection."""
NETWORK = TCP + UDP
OF_PYSERIAL = ("rfc2217", "spy", "loop", "alt", "hwgrep")  # schemes that pyserial opens
_EXAMPLE = "expected {scheme}://HOST:PORT, such as {scheme}://192.168.4.1:3333"


class Address(NamedTuple):
    """One end of a network connection."""

    scheme: str  # one of `NETWORK`
    host: str  # host name, or numeric address without brackets
    port: int
    bind: Optional[Tuple[str, int]] = None  # local address and port, if they matter; 0 for any port

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


def is_url(port: str) -> bool:
    """Return whether `port` is a URL and not the name of a device."""
    return "://" in port


def is_network(port: str) -> bool:
    """Return whether `port` is a URL for a TCP connection or for UDP datagrams."""
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
    """Return the scheme, the part before the colon; raise ConfigError if it is unknown."""
    scheme = url.partition("://")[0].lower()
    if scheme not in NETWORK + OF_PYSERIAL:
        raise ConfigError(
            f"port {url!r}: {scheme!r} is unknown, expected a device name, or one of "
            f"{', '.join(f'{name}://' for name in NETWORK + OF_PYSERIAL)}"
        )
    return scheme


def parse(url: str, listening: bool = False) -> Address:
    """Return the address in a URL, with `listening` port 0 for any free one; raise ConfigError if it does not parse."""
    scheme = url.partition("://")[0].lower()
    if scheme not in NETWORK:
        raise ConfigError(
            f"port {url!r} is not a network address, expected tcp://HOST:PORT or udp://HOST:PORT"
        )
    parts, host, port = _split(url, scheme, listening)
    if parts.path not in ("", "/") or parts.username is not None or parts.fragment:
        raise _no_address(url, scheme)
    queries = parse_qs(parts.query, keep_blank_values=True)
    return Address(scheme, host, port, _bind(url, scheme, queries) if queries else None)


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
    return ConfigError(f"port {url!r} does not parse{why}, {_EXAMPLE.format(scheme=scheme)}")


def _bind(url: str, scheme: str, queries: Dict[str, List[str]]) -> Tuple[str, int]:
    """Return the local address from `?bind=HOST:PORT`; the port may be absent."""
    with contextlib.suppress(KeyError, ValueError):
        end = urlsplit("//" + queries.pop("bind")[0])
        host, port = end.hostname, end.port or 0
        if host and scheme in UDP and not queries:
            return host, port
    raise ConfigError(
        f"port {url!r} does not parse, expected nothing behind the port but ?bind=HOST:PORT with udp://"
    )
