"""Whether other robots hold this one by radio: replies to `read_radio` to values.  Pure."""

from typing import NamedTuple, Optional

from mrl_driver.protocol.frames import Frame
from mrl_driver.protocol.table import BY_NAME, HOLD_STATES

from .radio import address_of, format_address

CAPABILITY = "hold"
READ_RADIO, RELEASE = BY_NAME["read_radio"].code, BY_NAME["release_hold"].code


class Hold(NamedTuple):
    """The state of the holds, as the board reports it."""

    state: str  # one of `table.HOLD_STATES`: off, free, listening, held or silent
    holders: int  # number of robots that hold this one
    ignored: int  # number of hold texts that had no effect
    undelivered: int  # number of texts that reached no radio
    holder: int  # 64-bit address of the holder, the silent one if one is silent; 0 without holders

    @property
    def held(self) -> bool:
        """Whether the board refuses to move."""
        return self.state in ("listening", "held", "silent")

    def __str__(self) -> str:
        """One line for people."""
        others = f", as do {self.holders - 1} others" if self.holders > 1 else ""
        who = f"radio {format_address(self.holder)} holds the robot{others}"
        return {
            "listening": "the board has started and waits for the radios that may hold the robot",
            "held": f"{who}; it waits to be freed",
            "silent": f"{who}, and is silent: look whether the place is free, then release the hold",
        }.get(self.state, "no radio holds the robot")


def hold_of(frame: Frame) -> Optional[Hold]:
    """The hold that a frame reports; None for other frames."""
    if frame.code != READ_RADIO:
        return None
    state, holders, ignored, undelivered, *words = frame.args
    return Hold(HOLD_STATES[state][0], holders, ignored, undelivered, address_of(words))
