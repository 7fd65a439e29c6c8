"""Claims of a place that one robot of a team may use at a time: a waypoint, a crossing, a door.  No I/O, no clock.

Each robot has one `Claim`.  Messages of the others go into `receive`, and `messages` returns those to send to them:

    claim = Claim("robot1", ["robot2", "robot3"], now_s)
    claim.want()                                        # before the robot drives to the place
    for message in claim.messages(now_s): send(message.text)
    claim.receive(ClaimMessage.parse(text), now_s)
    if claim.held: ...                                  # the robot may drive to the place
    claim.release()                                     # after the robot has left it

A robot holds the place when all others have granted its claim.  A claim has a number that is larger than all numbers
the robot has received, so the claim that the others receive first wins.  If two robots claim before they receive each
other's message, the smaller number wins, then the smaller name.  A robot that holds the place, or has the better claim,
grants other claims after it has released its own (Ricart and Agrawala 1981).

Messages may be late, lost, repeated, or overtake each other, because each one holds the whole state between two robots
and is sent again every `REPEAT_S`.  No time-out gives the place to another robot: a robot that vanished may stand
there.  A robot without an answer from each of the others does not hold the place; `silent` names those robots, so that
it can do something else meanwhile.

A robot that starts again has forgotten what it granted, and learns it from the others' messages.  It claims only after
`LATE_S`, because a message from before its start may be from before the grant, too.  A robot that starts again at the
place must be taken away from it first, because it no longer knows that it held the place.

Two robots with the same name would both hold the place, because one grant counts for both.  `hear_namesake` reports a
message that has this robot's name and comes from another one.  Neither of the two then holds the place or grants it.  A
robot grants claims only after `LATE_S`, so that it has heard a robot that had its name before.
"""

import math
import re
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.robot.radio import BROADCAST, TEXT_BYTES, format_address, parse_address

REPEAT_S = 0.5  # each message is repeated after this time [s]
SILENT_S = 3.0
"""A robot that was not heard for this time counts as silent [s]: five repetitions in a row were lost."""
LATE_S = 3.0
"""A message by topic that was sent before a robot's start arrives within this time after the start, or never [s]."""
LARGEST_CLAIM = 9999  # messages of a team fit into a text up to this number at least
RADIO_LATE_S = 6.0
"""A text that was sent before a robot's start arrives within this time, or never [s]: it waits for the line for at most
1 s, and an XBee repeats it until 4.8 s have passed."""
MOST_ROBOTS = 6
"""Each robot sends a text to each other one twice a second.  Six robots send 60 in a second, which is assumed to be as
many as one channel carries with repetitions."""
NAMESAKE = "another robot of the team is called {}, too: give each robot a name of its own"
_TEXT = re.compile(r"([!-~]+) ([0-9]{1,9}) ([!-~]+) ([0-9]{1,9})")


class ClaimMessage(NamedTuple):
    """A message from one robot to another."""

    sender: str  # name of the robot that sends it
    claim: int  # number of the sender's claim; 0 if it has none
    to: str  # name of the robot that it is for
    granted: int  # number of the receiver's claim that the sender has granted; 0 if none

    @property
    def text(self) -> str:
        """The message as ASCII text, such as `1 12 2 11`.  It fits into the 16 characters of a radio text up to claim
        9999 if names are single characters."""
        return f"{self.sender} {self.claim} {self.to} {self.granted}"

    @classmethod
    def parse(cls, text: str) -> "ClaimMessage":
        """The message of a text; ValueError if that is not a message of a claim."""
        found = _TEXT.fullmatch(text)
        if found is None:
            raise ValueError(f"claim message is {text[:40]!r}, expected SENDER CLAIM RECEIVER GRANTED")
        sender, claim, to, granted = found.groups()
        return cls(sender, int(claim), to, int(granted))


def write_messages(messages: Sequence[ClaimMessage]) -> str:
    """One text with a line for each message: a relay of topics keeps only the newest of several texts of one robot."""
    return "\n".join(message.text for message in messages)


def read_messages(text: str) -> List[ClaimMessage]:
    """The messages of such a text; ValueError if a line is not a message of a claim."""
    return [ClaimMessage.parse(line) for line in text.split("\n")]


class Claim:
    """One robot's side of the claims of a place; ConfigError if a name is not valid, or appears twice.

    Names are printable ASCII without spaces, and `now_s` is on any clock that does not jump.  A message that was sent
    before this robot's start arrives within `late_s`, or never.
    """

    def __init__(self, name: str, others: Sequence[str], now_s: float, late_s: float = LATE_S) -> None:
        names = [name, *others]
        for each in names:
            if not re.fullmatch("[!-~]+", each):
                raise ConfigError(f"name of a robot is {each!r}, expected printable ASCII without spaces")
        if len(set(names)) < len(names):
            raise ConfigError(f"names of the team are {', '.join(names)}, expected each one once")
        self.name = name
        self.has_namesake = False  # whether another robot with this name was heard in the last `SILENT_S`
        self._namesake_s = -math.inf
        self._wanted = False
        self._number = self._largest = 0
        self._claims: Dict[str, int] = dict.fromkeys(others, 0)
        self._granted: Dict[str, int] = dict.fromkeys(others, 0)
        self._answers: Dict[str, int] = dict.fromkeys(others, 0)
        self._unheard = set(others)
        self._settled_s = now_s + late_s
        self._heard_s = dict.fromkeys(others, now_s)
        self._due_s = -math.inf

    @property
    def held(self) -> bool:
        """Whether the place belongs to this robot; never while another robot has its name."""
        answered = all(answer == self._number for answer in self._answers.values())
        return self._number > 0 and answered and not self.has_namesake

    def silent(self, now_s: float) -> Tuple[str, ...]:
        """Names of the robots that were not heard for `SILENT_S`."""
        return tuple(name for name, at_s in self._heard_s.items() if now_s - at_s > SILENT_S)

    def want(self) -> None:
        """Claims the place, unless it is claimed already.

        The claim gets its number when each of the others was heard once, `LATE_S` after the start or later: a robot
        that has started again would otherwise use a number of its earlier claims, or one below a claim that it granted.
        """
        self._wanted = True
        self._draw_number()

    def release(self) -> None:
        """Gives the place, or the claim, back."""
        if self._wanted:
            self._wanted, self._number = False, 0
            self._due_s = -math.inf
            for name in self._claims:
                self._consider(name)

    def receive(self, message: ClaimMessage, now_s: float) -> None:
        """Takes a message; those for other robots, and of robots that are not in the team, are ignored."""
        sender = message.sender
        if message.to != self.name or sender not in self._claims:
            return
        if now_s > self._settled_s:
            self._unheard.discard(sender)
        self._heard_s[sender] = now_s
        self._largest = max(self._largest, message.claim, message.granted)
        self._claims[sender] = message.claim
        self._answers[sender] = max(self._answers[sender], message.granted)
        self._consider(sender)
        self._draw_number()

    def hear_namesake(self, now_s: float) -> None:
        """A message came whose sender has the name of this robot, and which this robot has not sent."""
        self.has_namesake, self._namesake_s = True, now_s

    def messages(self, now_s: float) -> List[ClaimMessage]:
        """The messages to send now, one for each of the others; none if they are not due."""
        self.has_namesake = now_s - self._namesake_s <= SILENT_S
        if now_s < self._due_s:
            return []
        self._due_s = now_s + REPEAT_S
        grants = now_s > self._settled_s and not self.has_namesake
        return [ClaimMessage(self.name, self._number, to, self._granted[to] * grants) for to in self._claims]

    def _draw_number(self) -> None:
        if self._wanted and not self._number and not self._unheard:
            self._number = self._largest = self._largest + 1
            self._due_s = -math.inf

    def _consider(self, name: str) -> None:
        """Grants a robot's claim, unless the own claim is better."""
        claim = self._claims[name]
        better = self._number and (self._number, self.name) < (claim, name)
        if not better and claim > self._granted[name]:
            self._granted[name] = claim
            self._due_s = -math.inf


class RadioTeam:
    """The radios of all robots that share a place: which text goes to which address, and whose claim a text is.

        team = RadioTeam("1", {"1": 0x0013A20040000001, "2": 0x0013A20040000002})
        for message in claim.messages(now_s): send_text(*team.text_to(message))
        message = team.message_of(address, text)            # None for a text that is not a claim
        if message is not None: claim.receive(message, now_s)

    `addresses` are the 64-bit ones of all robots' radios, this one's too.  ConfigError if `name` is not among them, an
    address appears twice or is the one of all radios, or there are too few or too many robots, or too long names.
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

        ConfigError if the sender has the name of another radio's robot.
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
