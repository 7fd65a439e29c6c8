"""Latches and releases the emergency stop of the robot's node by its services, from threads of its own.  No rospy."""

import math
import threading
import time
from typing import Callable, Tuple

from mrl_driver.clocks import later

AGAIN_S = 0.5
"""A stop that the node did not confirm is asked for again after this time; with N calls under way, after N times as
much [s].
"""
MOST_CALLS = 100
"""At most this many calls may be under way; a stop reaches it when the node has not answered for 40 minutes."""
TOLD_S = 0.5  # the node answers, and its status says so, within this time, or something is wrong [s]
STOP, RELEASE = "stop", "release_stop"
WORDS = {STOP: "emergency stop", RELEASE: "release of the emergency stop"}
Call = Callable[[str], Tuple[bool, str]]
"""Calls a service of the robot's node by its name; returns whether it did it, and why not.  It may block for ever, and
may raise any exception.
"""


class EmergencyStop:
    """The emergency stop as this page wants it and as the robot's node has it; any thread may call it.

    A stop that the node did not confirm counts as latched, and is asked for again until it is released.  Each call has
    a thread of its own, so that one that hangs holds up no other.
    """

    def __init__(self, call: Call) -> None:
        self._call = call
        self._lock = threading.RLock()
        self._wanted = self._newest = self._why = ""
        self._wishes = self._calls = 0
        self._asked_s = self._done_s = -math.inf
        self._told = self._ended = False

    @property
    def latched(self) -> bool:
        """The node says so, or this page has asked for it."""
        return self._told or self._wanted == STOP or time.monotonic() - self._done_s < TOLD_S

    @property
    def trouble(self) -> str:
        """Why the node has not done what was asked last; empty if it has, or has had no time to."""
        wanted, why = self._wanted, self._why
        waits_s = time.monotonic() - self._asked_s
        if wanted and not why and waits_s > TOLD_S:
            why = f"its node has not answered for {waits_s:.0f} s"
        return f"the robot has not confirmed the {WORDS[wanted or RELEASE]}: {why}" if why else ""

    def latch(self) -> None:
        """Ask the node to stop, and to refuse all commands until the release."""
        if self._wanted != STOP or time.monotonic() - self._asked_s >= AGAIN_S:  # else it is under way
            self._want(STOP)

    def release(self) -> None:
        """Ask the node once to follow commands again."""
        self._want(RELEASE)

    def on_status(self, latched: bool) -> None:
        """Take what the node says: also of a stop that somebody else has latched or released."""
        self._told = latched

    def close(self) -> None:
        """Ask no more; a call that is under way is not waited for."""
        self._ended = True

    def _want(self, service: str) -> None:
        with self._lock:
            self._wanted = self._newest = service
            self._why, self._asked_s = "", time.monotonic()
            self._wishes += 1
            self._begin_call(service, self._wishes)

    def _begin_call(self, service: str, wish: int) -> None:
        """Begin a call, and later another one if a stop is not confirmed by then."""
        if self._ended:
            return
        if self._calls < MOST_CALLS:
            self._calls += 1
            threading.Thread(target=self._ask, args=(service, wish), name=service, daemon=True).start()
        if service == STOP:
            later(AGAIN_S * self._calls, self._ask_again, wish)

    def _ask_again(self, wish: int) -> None:
        with self._lock:
            if wish == self._wishes and self._wanted:
                self._begin_call(STOP, wish)

    def _ask(self, service: str, wish: int) -> None:
        """Call the service, and note the answer, unless something else has been wanted since."""
        try:
            done, why = self._call(service)
        except Exception as error:  # noqa: BLE001 - a service and rospy raise whatever they do
            done, why = False, str(error) or type(error).__name__
        with self._lock:
            self._calls -= 1
            if wish == self._wishes and self._wanted:
                self._why = "" if done else why
                if done:
                    self._done_s = time.monotonic() if service == STOP else -math.inf
                if done or service == RELEASE:
                    self._wanted = ""
            elif service == RELEASE and self._newest == STOP:
                self._want(STOP)  # the node may have done this release after the stop
