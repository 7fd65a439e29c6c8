"""Holds other robots by radio while this one is in a place for one robot, such as a crossing.  No I/O, no clock.

A text holds the other robot's board, whatever its host does; the parameter `radio_hold` of that board allows it.

    holder = RadioHolder([0x0013A20040000002])
    holder.hold()                                        # before the robot drives to the place
    for address, data in holder.texts(now_s): send_text(address, data)
    holder.receive(text, now_s)                          # each text that the radio receives
    if holder.holds_all(now_s): ...                      # the robot may drive to the place
    holder.free()                                        # after the robot has left it; send texts until all_freed

A robot must not drive to the place before `holds_all`: a board that has not answered may let its robot drive there.
While it is in the place, it goes on to send the texts.  The board counts the holder as silent otherwise, and a board
that starts again learns of the hold by them.

Two robots that hold each other both stand still.  Decide first which one goes: see `claims`.
"""

import math
from typing import Dict, List, Optional, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.hold_text import HoldText, is_newer
from mrl_driver.robot.radio import BROADCAST, RadioText, format_address

REPEAT_S = 0.5  # each text is repeated after this time [s]
FRESH_S = 1.5  # an answer counts for this time [s]: two in a row may be lost
MOST_ROBOTS = 8  # texts to eight robots take 0.2 s on the line to the radio


class RadioHolder:
    """One robot's hold of the robots with these 64-bit radio addresses.

    ConfigError if an address appears twice or is the one of all radios, or there are none or too many.
    """

    def __init__(self, addresses: Sequence[int]) -> None:
        if not 1 <= len(addresses) <= MOST_ROBOTS or len(set(addresses)) < len(addresses):
            texts = ", ".join(map(format_address, addresses)) or "none"
            raise ConfigError(
                f"robots to hold are {texts}, expected 1 to {MOST_ROBOTS} addresses, each one once"
            )
        if BROADCAST in addresses:
            raise ConfigError("the address of all radios cannot be held, because nobody would answer for all")
        self._kind, self._number = "", 1
        self._answers: Dict[int, Optional[HoldText]] = dict.fromkeys(addresses)
        """The last answer of each board; one of an earlier hold has another number than the one expected."""
        self._heard_s = dict.fromkeys(addresses, -math.inf)
        self._due_s = -math.inf

    def hold(self) -> None:
        """Hold the robots, unless they are being held."""
        if self._kind != "hold":
            self._number += self._kind == "free"
            self._begin("hold")

    def free(self) -> None:
        """End the hold, also one from before the start of this program.

        The other robots stay where they are until their own hosts move them.
        """
        if self._kind != "free":
            self._begin("free")

    def holds_all(self, now_s: float) -> bool:
        """Whether each robot has answered within `FRESH_S` that it is held."""
        return self._kind == "hold" and not self.unanswered(now_s)

    @property
    def all_freed(self) -> bool:
        """Whether each robot has answered that this one does not hold it any more."""
        return self._kind == "free" and not self.unfreed

    @property
    def unfreed(self) -> Tuple[int, ...]:
        """Addresses of the robots that have not answered yet that they are freed."""
        return tuple(address for address, answer in self._answers.items() if answer != self._expected)

    def unanswered(self, now_s: float) -> Tuple[int, ...]:
        """Addresses of the robots without the expected answer within `FRESH_S`."""
        return tuple(
            address
            for address, answer in self._answers.items()
            if answer != self._expected or now_s - self._heard_s[address] > FRESH_S
        )

    def texts(self, now_s: float) -> List[Tuple[int, bytes]]:
        """Address and data of the texts to send now; none if they are not due."""
        if not self._kind or now_s < self._due_s:
            return []
        self._due_s = now_s + REPEAT_S
        data = HoldText(self._kind, self._number & 0xFFFF).data
        return [
            (address, data)
            for address, answer in self._answers.items()
            if self._kind == "hold" or answer != self._expected
        ]

    def receive(self, text: RadioText, now_s: float) -> None:
        """Take a received text; those that are not answers of one of the robots are ignored."""
        answer = HoldText.parse(text.data)
        if answer is None or answer.kind not in ("held", "freed") or text.address not in self._answers:
            return
        ended = self._kind == "hold" and answer.kind == "freed" and answer.number == self._number & 0xFFFF
        if ended or is_newer(answer.number, self._number):  # a later hold, from before this program's start
            self._number = answer.number + (self._kind == "hold")
            self._begin(self._kind)
            return
        self._answers[text.address], self._heard_s[text.address] = answer, now_s

    @property
    def _expected(self) -> HoldText:
        return HoldText("held" if self._kind == "hold" else "freed", self._number & 0xFFFF)

    def _begin(self, kind: str) -> None:
        self._kind, self._due_s = kind, -math.inf
