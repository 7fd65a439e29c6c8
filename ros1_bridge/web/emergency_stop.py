"""Latches and releases the emergency stop of the robot's node by its services, from a thread of its own.  No rospy."""

import math
import threading
import time
from typing import Callable, Tuple

AGAIN_S = 0.5
"""A stop that the node did not confirm is asked for again after this time [s]."""
TOLD_S = 0.5
"""The node answers, and its status says so, within this time, or something is wrong [s]."""
STOP, RELEASE = "stop", "release_stop"
WORDS = {STOP: "emergency stop", RELEASE: "release of the emergency stop"}
Call = Callable[[str], Tuple[bool, str]]
"""Calls a service of the robot's node by its name; returns whether it did it, and why not.  It may block."""


class EmergencyStop:
    """The emergency stop as this page wants it and as the robot's node has it; any thread may call it.

    A stop that the node did not confirm counts as latched, and is asked for again until it is released.
    """

    def __init__(self, call: Call) -> None:
        self._call = call
        self._changed = threading.Condition()
        self._wanted = self._why = ""
        self._asked_s = self._done_s = -math.inf
        self._told = self._ended = False
        threading.Thread(target=self._serve, name="emergency stop", daemon=True).start()

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
        self._want(STOP)

    def release(self) -> None:
        """Ask the node once to follow commands again."""
        self._want(RELEASE)

    def on_status(self, latched: bool) -> None:
        """Take what the node says: also of a stop that somebody else has latched or released."""
        self._told = latched

    def close(self) -> None:
        """End the thread; a call that is under way is not waited for."""
        with self._changed:
            self._ended = True
            self._changed.notify()

    def _want(self, service: str) -> None:
        with self._changed:
            self._wanted, self._why, self._asked_s = service, "", time.monotonic()
            self._changed.notify()

    def _serve(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._wanted or self._ended)
                if self._ended:
                    return
                service = self._wanted
            done, why = self._call(service)
            with self._changed:
                if service != self._wanted:
                    continue  # the opposite was asked for meanwhile
                self._why = "" if done else why
                if done:
                    self._done_s = time.monotonic() if service == STOP else -math.inf
                if done or service == RELEASE:
                    self._wanted = ""
                else:
                    self._changed.wait(AGAIN_S)
