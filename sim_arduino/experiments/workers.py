"""Worker processes that always end with their parent."""

import concurrent.futures
import multiprocessing
import os
import signal
import sys
import threading
import time
from contextlib import contextmanager
from typing import Any, Callable, Iterator

TERMINATED = 143
POLL_S = 0.1
Submit = Callable[..., "concurrent.futures.Future[Any]"]

_ending, _idle = threading.Event(), threading.Event()
"""Flags of a worker: no new work may start; no work is running."""


@contextmanager
def pool(count: int) -> Iterator[Submit]:
    """Start `count` workers; yields a function that submits a function and its arguments to them.

    An exception in the block, also one raised by a signal, ends the work that is running.
    """
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(count, context, _watch_parent) as executor:
        try:
            yield lambda function, *args: executor.submit(_work, function, *args)
        except BaseException:
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise


def _work(function: Callable[..., Any], *args: Any) -> Any:
    if _ending.is_set():
        sys.exit(TERMINATED)
    _idle.clear()
    try:
        return function(*args)
    finally:
        _idle.set()


def _watch_parent() -> None:
    """Runs in a worker: SIGTERM or the end of the parent process ends the work in order."""
    _idle.set()
    signal.signal(signal.SIGTERM, _end)
    threading.Thread(target=_follow_parent, daemon=True).start()


def _end(*_: object) -> None:
    _ending.set()
    sys.exit(TERMINATED)


def _follow_parent() -> None:
    """Waits for the parent's end, then sends signals: one ends the work, another one the wait for more work."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    while True:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(POLL_S)
        _idle.wait()
