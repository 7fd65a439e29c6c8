"""Which requests the server of the page answers: those of its own page, under a name of this computer.  No I/O.

A page of another site could otherwise use the browser of the driving person: by a request of its own
(`Origin`), or under a name of its own that leads to this computer (`Host`, DNS rebinding).
"""

import ipaddress
from typing import Dict, Mapping, Sequence
from urllib.parse import SplitResult, urlsplit

from mrl_driver.yaml_file import short

SAME = ("same-origin", "none")
"""Values of `Sec-Fetch-Site` for requests of the page itself, and of an address that a person has typed."""


def why_not(headers: Mapping[str, str], names: Sequence[str], opens_page: bool) -> str:
    """Return why a request with these headers is refused; empty if it is not.

    `names` are the computer's names besides localhost and numeric addresses.  `opens_page` says that the request is for
    the page itself, which a link on another site may lead to.
    """
    host, origin = headers.get("Host", ""), headers.get("Origin")
    name = (_split(f"//{host}").hostname or "").lower()
    if not (name == "localhost" or name in [each.lower() for each in names] or _is_numeric(name)):
        return f"this server is not called {short(name or 'so')}; use its numeric address, or localhost"
    scheme, netloc, *_ = _split(origin or "")
    if origin is not None and not (scheme in ("http", "https") and netloc.lower() == host.lower()):
        return f"the request comes from a page of {short(origin)}, expected a page of this server"
    if headers.get("Sec-Fetch-Site", "none") not in SAME and not opens_page:
        return "the request comes from another site, expected a page of this server"
    return ""


def _split(url: str) -> SplitResult:
    """Return the parts of a URL; all are empty if it does not parse."""
    try:
        return urlsplit(url)
    except ValueError:
        return urlsplit("")


def _is_numeric(name: str) -> bool:
    try:
        return bool(ipaddress.ip_address(name))
    except ValueError:
        return False


def headers_of(host: str) -> Dict[str, str]:
    """Return the headers of every answer: the page loads nothing from elsewhere, and no other site may show it.

    Some browsers do not take `'self'` for WebSockets, so the address is named; `host` has passed `why_not`.
    """
    policy = (
        "default-src 'self'; "
        f"connect-src 'self' ws://{host} wss://{host}; "
        "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return {
        "Content-Security-Policy": policy,
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Permissions-Policy": "accelerometer=(self), gyroscope=(self), magnetometer=(self), gamepad=(self), "
        "camera=(), geolocation=(), microphone=()",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
    }
