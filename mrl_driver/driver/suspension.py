"""Ctrl-Z stops the robot before it suspends the program: 2013 boards have no watchdog, and would drive on."""

import contextlib
import os
import signal
import threading
import time
from typing import TYPE_CHECKING, Any, Iterator

from mrl_driver.errors import MrlError

if TYPE_CHECKING:
    from .driver import Driver

CONFIRM_S, LOOK_S = 0.5, 0.01
"""The program is suspended when telemetry has confirmed the stop, at the latest after this time; time between looks."""


@contextlib.contextmanager
def stopped_while_suspended(driver: "Driver") -> Iterator[None]:
    """In this block, SIGTSTP stops the driver's robot and then suspends the program."""

    def suspend(_number: int, _frame: Any) -> None:
        with contextlib.suppress(MrlError):
            driver.stop()
        end_s = time.monotonic() + CONFIRM_S
        while driver.ready and not driver.stopped and time.monotonic() < end_s:
            time.sleep(LOOK_S)
        os.kill(os.getpid(), signal.SIGSTOP)

    with on_suspend(suspend):
        yield


@contextlib.contextmanager
def on_suspend(handler: Any) -> Iterator[None]:
    """In this block, SIGTSTP has this handler; it may be `signal.SIG_IGN`.

    Nothing changes if SIGTSTP is ignored already, or outside the main thread, which alone may set handlers.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGTSTP) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTSTP, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
