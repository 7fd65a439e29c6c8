"""The page of `mrl web` in a tab, by the names of its controls and what it says of itself.

The page writes its state into attributes of its root: `link` open or closed, `helm` mine, other or free, `held` while a
control is held, `spent` after a stop until it is released, `latched` while the emergency stop is.
"""

import itertools
from typing import Any, Callable, Dict, Tuple

from tests.waiting import wait_until

from .browser import DESK, Browser, Size, Tab

MISSED = 50  # A control that is not held after so many looks was missed
REACH_PX = 40.0  # How far the joystick is moved from its rest


class RobotPage:
    """A client: somebody who looks at the page."""

    def __init__(self, browser: Browser, link: str, size: Size = DESK, before: str = "") -> None:
        self.tab: Tab = browser.open(link, size, before)

    def wait(self, **state: str) -> None:
        """Waits until the page says this of itself."""
        self.tab.wait(" && ".join(f"{_SAYS}.{key} === '{value}'" for key, value in state.items()))

    @property
    def state(self) -> Dict[str, Any]:
        """What the page says of itself."""
        found: Dict[str, Any] = self.tab.run(f"return {{...{_SAYS}}}")
        return found

    def arrive(self) -> "RobotPage":
        """Waits until the page has its link to the server, `slow` on a busy machine."""
        self.tab.wait(f"['open', 'slow'].includes({_SAYS}.link)")
        return self

    def take(self) -> "RobotPage":
        """Takes the helm, if it is free, and releases an emergency stop."""
        self.arrive()
        if self.state["helm"] != "mine":
            self.tab.press("take")
            self.wait(helm="mine")
        if self.state["latched"] == "yes":
            self.tab.press("release")
            self.wait(latched="no")
        return self

    def stick(self, forward: float, left: float = 0.0) -> Tuple[float, float]:
        """Where a finger on the joystick is, -1 to 1 in both directions [px of the window]."""
        x, y = self.tab.centre("joystick")
        return x - left * REACH_PX, y - forward * REACH_PX

    def push(self, forward: float = 1.0, left: float = 0.0) -> None:
        """A finger is put on the joystick and moves it."""
        self.tab.touch(self.stick(0.0), self.stick(forward, left))

    def hold_until(
        self, moves: Callable[[], bool], begin: Callable[[], None], end: Callable[[], None]
    ) -> None:
        """Holds a control until the robot moves.

        On a busy machine a command may be late, which ends the press, or the control may move away from the finger:
        then it is released and held again.
        """
        looks = itertools.count(1)

        def moved() -> bool:
            state = self.state
            missed = state["held"] == "no" and next(looks) % MISSED == 0
            if not moves() and (state["spent"] == "yes" or missed):
                end()
                self.wait(held="no", spent="no")
                begin()
            return moves()

        begin()
        try:
            wait_until(moved, step_s=0.01, what="motion")
        except AssertionError as error:
            words = [self.text(element) for element in ("link", "state", "notice", "why")]
            raise AssertionError(f"{error}; the page says {self.state} and {words}") from None

    def push_until(self, moves: Callable[[], bool]) -> None:
        """Pushes the joystick until the robot moves."""
        self.hold_until(moves, self.push, self.tab.lift)

    def shows(self, element: str) -> bool:
        """An element with this id is there and in sight."""
        script = "const e = document.getElementById(arguments[0]); return !!e && e.checkVisibility();"
        return bool(self.tab.run(script, element))

    def usable(self, element: str) -> bool:
        """It is shown, and not disabled."""
        return self.shows(element) and not self.tab.run(
            "return document.getElementById(arguments[0]).disabled", element
        )

    def box(self, element: str) -> Tuple[float, float, float, float]:
        """Left, top, right and bottom of an element in the window [px]."""
        script = "const b = document.getElementById(arguments[0]).getBoundingClientRect();"
        left, top, right, bottom = self.tab.run(
            f"{script} return [b.left, b.top, b.right, b.bottom];", element
        )
        return left, top, right, bottom

    def set(self, **values: Any) -> None:
        """Types values into fields, by their ids."""
        script = "const e = document.getElementById(arguments[0]); e.value = arguments[1];"
        script += "for (const kind of ['input', 'change']) e.dispatchEvent(new Event(kind, {bubbles: true}));"
        for name, value in values.items():
            self.tab.run(script, name, f"{value:.2f}")

    def text(self, element: str) -> str:
        """The text of the element with this id."""
        return str(self.tab.run("return document.getElementById(arguments[0]).innerText", element))


_SAYS = "document.documentElement.dataset"
