"""Raising the baud rate: the board is asked for a higher rate, which is kept if a test of the link has no errors.

This happens before the session begins.  If the board does not know the request, or the link does not work at the new
rate, both stay at 115200 baud.  The board returns to 115200 by itself after 1 s without a valid frame.
"""

import contextlib
import time
from typing import Optional, Tuple

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, BAUDS, BY_NAME, CAPABILITIES

from .baud_rates import FAST_BAUD
from .link import Link

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


def speed_up(link: Link) -> bool:
    """Set board and link to `FAST_BAUD`; return False, with both at 115200, if that does not work.

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
