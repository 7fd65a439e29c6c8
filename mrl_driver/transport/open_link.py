"""Opens a port of any kind (a device, a TCP connection, UDP datagrams, or a URL of pyserial), and raises its speed."""

import contextlib
import time
from typing import Callable, Optional, Tuple

from mrl_driver.errors import BoardError, BoardTimeout, LinkError, shortages
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, BAUDS, BY_NAME, CAPABILITIES

from .address import TCP, UDP, is_url, scheme_of
from .baud_rates import FAST_BAUD
from .link import Link, SerialLink

# Time for a host to accept a connection, at first and in a search [s].  The system repeats a lost first packet after 1
# s.
CONNECT_S, AGAIN_S = 3.0, 0.8
ANSWER_S, PATIENCE_S = 0.25, 3.0
"""A request is repeated after `ANSWER_S`.  A board that was reset by opening its port may need `PATIENCE_S` [s]."""
CHANGE_S = 0.02
"""Wait after the change [s]: the board changes 0.3 ms after its answer; a USB bridge delays bytes by up to 16 ms."""
BACK_S = 1.1  # after this time without a valid frame the board is at 115200 again [s]
PROOFS, PROOF_S = 20, 0.1
"""The test of the link: `PROOFS` replies in a row, each within `PROOF_S` [s]; one exchange takes 2 ms."""
_BAUD, _INFO, _PROTOCOL, _STOP, _STOP_STREAM = (
    BY_NAME[name].code for name in ("set_baud", "robot_info", "read_protocol", "stop", "stop_stream")
)
_QUIET = {
    wrapped: encode_request(_STOP, wrapped=wrapped) + encode_request(_STOP_STREAM, wrapped=wrapped)
    for wrapped in (False, True)
}
"""Sent first, so that a moving robot stops before the session begins; in the form for boards of 2013 until it is known
that this is not one."""
_BIT = 1 << [name for name, _ in CAPABILITIES].index("baud")


class Opening:
    """The first opening of a port: until `timeout_s` has passed [s], each error is one that may pass.

    A port that has just appeared may not have its rights yet, or be held by a program that looks at it or ends.

    Attributes:
        reason: why the last attempt failed.
    """

    reason: str

    def __init__(self, open_port: Callable[[], Link], timeout_s: float) -> None:
        self._open_port, self._until_s = open_port, time.monotonic() + timeout_s

    def attempt(self) -> Optional[Link]:
        """Open the port; None to try again soon.  Raise the last LinkError or BoardError when the time is over."""
        try:
            return self._open_port()
        except (LinkError, BoardError) as error:
            if time.monotonic() >= self._until_s:
                raise
            self.reason = str(error)
            return None


def open_link(port: str, baud: int = BAUD, patience_s: float = CONNECT_S) -> Link:
    """Open a port and return its link.  The modules for URLs are imported only when needed.

    Args:
        port: device name or URL.
        baud: baud rate of devices, and of URLs that pyserial opens [Bd].
        patience_s: time for a host to accept a TCP connection [s].

    Raises:
        ConfigError: the URL does not parse.
        LinkError: the port cannot be opened; each link's class lists the errors.
    """
    with shortages(f"{port} cannot be opened", LinkError):
        return _open(port, baud, patience_s)


def _open(port: str, baud: int, patience_s: float) -> Link:
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


def speed_up(link: Link) -> bool:
    """Set board and link to `FAST_BAUD`, before the session begins; return False, with both at 115200, if that fails.

    The board is asked for the rate, which is kept if a test of the link has no errors.  It returns to 115200 by itself
    after 1 s without a valid frame.

    Raises:
        LinkLost: the port went away.
    """
    if not _is_able(link):
        return False
    rate = BAUDS.index(FAST_BAUD)
    answer = _ask(link, ANSWER_S, _BAUD, rate)
    if answer != (rate,):
        time.sleep(BACK_S)
        return False
    link.set_baud(FAST_BAUD)
    time.sleep(CHANGE_S)
    if all(_ask(link, PROOF_S, _BAUD, rate) == (rate,) for _ in range(PROOFS)):
        return True
    link.set_baud(BAUD)
    time.sleep(BACK_S)
    return False


def _is_able(link: Link) -> bool:
    """Return whether the board knows the request."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        with contextlib.suppress(BoardTimeout):
            link.write(_QUIET[True])
        answer = _ask(link, ANSWER_S, _PROTOCOL)
        if answer is not None:
            with contextlib.suppress(BoardTimeout):
                link.write(_QUIET[False])
            return bool(answer[1] & _BIT)
        if _ask(link, ANSWER_S, _INFO, wrapped=True) is not None:
            return False
    return False


def _ask(
    link: Link, wait_s: float, code: int, *args: int, wrapped: bool = False
) -> Optional[Tuple[int, ...]]:
    """Send a request and return the arguments of its answer; None without an answer within `wait_s`."""
    decoder, end_s = FrameDecoder(REPLIES), time.monotonic() + wait_s
    try:
        link.write(encode_request(code, *args, wrapped=wrapped))
    except BoardTimeout:
        return None
    while time.monotonic() < end_s:
        for event in decoder.feed(link.read(end_s - time.monotonic())):
            if isinstance(event, Frame) and event.code == code:
                return event.args
    return None
