"""A page as the helm sees it: its clock, its presses, and what it has heard."""

from typing import Any, List, Optional

from mrl_driver.apps.web.helm import Control, Goal


class Page:
    """Makes the messages of one page; times given to it are the server's.

    Args:
        number: The client.
        ahead_s: The page's clock is so much ahead of the server's.
    """

    def __init__(self, number: int, ahead_s: float = 0.0) -> None:
        self.number, self.ahead_s = number, ahead_s
        self.seq = self.press = 0
        self.held = False
        self.goal: Optional[Goal] = None
        self.heard_s: Optional[float] = None
        self.heard_t_s: Optional[float] = None

    def hear(self, at_s: float, now_s: Optional[float] = None) -> None:
        """A message that was made at `at_s` arrives `now_s`."""
        if self.heard_s is None or at_s >= self.heard_s:
            self.heard_s = at_s
            self.heard_t_s = (at_s if now_s is None else now_s) + self.ahead_s

    def message(self, now_s: float, linear_m_s: float = 0.2, **changed: Any) -> Control:
        """The next message of its controls."""
        self.seq += 1
        speeds = (linear_m_s, 0.0, 0.0) if self.held and self.goal is None else (0.0, 0.0, 0.0)
        goal = self.goal if self.held else None
        made = Control(
            self.seq, now_s + self.ahead_s, self.heard_s, self.heard_t_s, self.press, self.held, *speeds, goal
        )
        return made._replace(**changed)

    def push(self, now_s: float, goal: Optional[Goal] = None) -> Control:
        """The person presses a control."""
        self.press, self.held, self.goal = self.press + 1, True, goal
        return self.message(now_s)

    def lift(self, now_s: float) -> Control:
        """The person lets go of it."""
        self.held = False
        return self.message(now_s)


def kinds(acts: List[Any]) -> List[str]:
    """The names of acts, without `Tell`."""
    return [type(act).__name__ for act in acts if type(act).__name__ != "Tell"]
