"""Claims by radio: which text goes to which address, and whose claim a received text is.  No I/O.

team = RadioTeam("1", {"1": 0x0013A20040000001, "2": 0x0013A20040000002})
for message in claim.messages(now_s): send_text(*team.text_to(message))
message = team.message_of(address, text)            # None for a text that is not a claim
if message is not None: claim.receive(message, now_s)
"""

from typing import Dict, Mapping, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.robot.radio import BROADCAST, TEXT_BYTES, format_address, parse_address

from .claims import ClaimMessage

LARGEST_CLAIM = 9999  # messages of a team fit into a text up to this number at least
LATE_S = 6.0
"""A text that was sent before a robot's start arrives within this time, or never [s]: it waits for the line for at most
1 s, and an XBee repeats it until 4.8 s have passed."""
MOST_ROBOTS = 6
"""Each robot sends a text to each other one twice a second.  Six robots send 60 in a second, which is assumed to be as
many as one channel carries with repetitions."""


class RadioTeam:
    """The radios of all robots that share a place.

    Args:
        name: Name of this robot.
        addresses: 64-bit address of each robot's radio, by name; this robot is among them.

    Raises:
        ConfigError: `name` is not among them, an address appears twice or is the one of all radios, there are too few
            or too many robots, or names are too long for a text.
    """

    def __init__(self, name: str, addresses: Mapping[str, int]) -> None:
        if name not in addresses or not 2 <= len(addresses) <= MOST_ROBOTS:
            raise ConfigError(
                f"radios are those of {', '.join(addresses) or 'no robots'}, expected 2 to {MOST_ROBOTS} robots, "
                f"{name or 'this one'} among them"
            )
        for address in addresses.values():
            if list(addresses.values()).count(address) > 1 or address in (0, BROADCAST):
                raise ConfigError(
                    f"radio address {format_address(address)} cannot be used, expected one of its own for each robot"
                )
        longest = sorted(addresses, key=len)[-2:]
        text = ClaimMessage(longest[0], LARGEST_CLAIM, longest[1], LARGEST_CLAIM).text
        if len(text) > TEXT_BYTES:
            room = sum(map(len, longest)) - (len(text) - TEXT_BYTES)
            raise ConfigError(
                f"names {' and '.join(longest)} are too long for texts by radio, expected two names with at most "
                f"{room} characters together, such as 1 and 2"
            )
        self._addresses = dict(addresses)

    @property
    def names(self) -> Tuple[str, ...]:
        """Names of all robots of the team."""
        return tuple(self._addresses)

    def text_to(self, message: ClaimMessage) -> Tuple[int, str]:
        """Address and text of a message."""
        return self._addresses[message.to], message.text

    def message_of(self, address: int, text: str) -> Optional[ClaimMessage]:
        """The message of a received text; None if it is another text, or one of a robot that is not in the team.

        Raises:
            ConfigError: the sender has the name of another radio's robot.
        """
        try:
            message = ClaimMessage.parse(text)
        except ValueError:
            return None
        known = self._addresses.get(message.sender)
        if known is None:
            return None
        if known != address:
            raise ConfigError(
                f"claim {text!r} comes from radio {format_address(address)}, expected {format_address(known)}, which "
                f"is that of {message.sender}; give all robots the same list of radios"
            )
        return message


def read_radios(text: str) -> Dict[str, int]:
    """Names and addresses of a text as `1=0013a20040000001,2=0013a20040000002`; ConfigError if it is something else."""
    found: Dict[str, int] = {}
    for part in text.split(","):
        name, _, address = part.strip().partition("=")
        try:
            number = parse_address(address)
        except ValueError:
            number = -1
        if not name or number < 0 or name in found:
            raise ConfigError(
                f"radios are {text!r}, expected NAME=ADDRESS of each robot, such as "
                "1=0013a20040000001,2=0013a20040000002"
            )
        found[name] = number
    return found
