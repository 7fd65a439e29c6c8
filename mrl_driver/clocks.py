"""A clock that goes on while the computer is suspended, and waits that end in time whatever is done to the wall clock.

Before Python 3.11 the time-outs of `threading` follow it (What's New In Python 3.11): if the clock is set back by an
hour meanwhile, such a wait lasts an hour longer.  That of a `Condition` which is notified before its time-out may stay.
"""

import threading
import time
from typing import Any, Callable

LOOK_S = 0.1
BOOT_CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


def clock_s() -> float:
    """A clock [s] that, unlike `time.monotonic()`, goes on while the computer is suspended."""
    return time.clock_gettime(BOOT_CLOCK)


def slept_s() -> float:
    """Return for how long the computer was suspended since its start [s]."""
    return clock_s() - time.monotonic()


def wait_until(done: Callable[[], bool], timeout_s: float) -> bool:
    """Wait until `done` is true, which is seen 0.1 s late, or for `timeout_s` [s]; whether it is true."""
    end_s = time.monotonic() + timeout_s
    while not done():
        left_s = end_s - time.monotonic()
        if left_s <= 0:
            return False
        time.sleep(min(left_s, LOOK_S))
    return True


def later(delay_s: float, call: Callable[..., Any], *args: Any) -> None:
    """Call this after `delay_s` [s], on a thread of its own; the end of the program does not wait for it."""

    def run() -> None:
        time.sleep(delay_s)
        call(*args)

    threading.Thread(target=run, name="later", daemon=True).start()
