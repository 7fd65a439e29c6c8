"""Opens a port, whatever wire it names: a device, a TCP connection, datagrams, or an URL of pyserial's."""

from .address import TCP, UDP, is_url, scheme_of
from .link import BAUD, Link, SerialLink

CONNECT_S, AGAIN_S = 3.0, 0.8
"""How long a host may take to take a connection, at first and in a search [s]; the system repeats a lost first packet
after 1 s.
"""


def open_link(port: str, baud: int = BAUD, patience_s: float = CONNECT_S) -> Link:
    """The open link.  The modules for URLs are loaded when one is asked for.

    Args:
        baud: of devices, and of what pyserial opens.
        patience_s: for a host to take a connection.

    Raises:
        ConfigError: the URL does not parse.
        LinkError: it cannot be opened, see the links themselves.
    """
    if not is_url(port):
        return SerialLink(port, baud)
    scheme = scheme_of(port)
    if scheme in TCP:
        from .sockets import TcpLink

        return TcpLink(port, patience_s)
    if scheme in UDP:
        from .sockets import UdpLink

        return UdpLink(port)
    from .pyserial_link import UrlLink

    return UrlLink(port, baud)
