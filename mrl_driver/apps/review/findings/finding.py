"""What went wrong in a drive, in words for newcomers."""

from typing import NamedTuple, Tuple

from mrl_driver.problems import PROBLEMS


class Finding(NamedTuple):
    """One thing that went wrong, and the frame that proves it."""

    kind: str  # code of the row in `problems`, such as `sonar_dead`; the same in all versions
    title: str  # what went wrong, in a few words
    text: str  # what was seen, with figures, and what it means
    time_s: float  # the moment [s since the recording began]
    direction: str  # direction of the frame: `>` to the board, `<` from it; empty without a frame
    data: bytes  # the frame, or the piece of data that is not one; empty if there is none
    weight: float  # how much it matters: findings are sorted by it, the heaviest first

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return PROBLEMS[self.kind].advice


def finding(
    kind: str, weight: float, text: str, frame: Tuple[float, str, bytes], part: str = "", title: str = ""
) -> Finding:
    """Return a finding; its title is the message of its row in `problems`, about this wheel or sonar, if none is given.

    `frame` is moment, direction and data of the frame that proves it.
    """
    title = title or PROBLEMS[kind].message.replace("SIDE", part).replace("NAME", part)
    return Finding(kind, title, text, *frame, weight)
