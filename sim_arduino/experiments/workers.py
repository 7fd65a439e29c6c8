"""Worker processes that always end with their parent, and when it tells them to."""

import concurrent.futures
import contextlib
import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
import traceback
from multiprocessing.connection import Connection
from typing import Any, Callable, Iterator, List, Optional, Tuple

from mrl_driver.errors import MrlError

TERMINATED = 143
GRACE_S = 20.0
"""A worker that has not ended after this time is killed: nodes and boards that it started need up to 15 s to end."""
TWICE_S = 1.0
"""`timeout` sends its signal twice; the second one within this time is not that of an impatient user."""
Submit = Callable[..., "concurrent.futures.Future[Any]"]


class WorkerTraceback(Exception):
    """The traceback of an exception in a worker, as its cause."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


class _Worker:
    """A process, and a thread that gives it work and waits for the results.

    An executor of `concurrent.futures` would not do: its workers take the exception that ends them for a result and
    wait for more work, and it joins them without a limit.
    """

    def __init__(self, work: "queue.SimpleQueue[Any]") -> None:
        context = multiprocessing.get_context("spawn")
        self._work = work
        self._connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs,))
        self.process.start()
        theirs.close()  # so that the end of the process is the end of the pipe
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        while True:
            job = self._work.get()
            if job is None:
                self._connection.close()  # the process sees it, and ends
                return
            future, task = job
            if future.set_running_or_notify_cancel():
                self._do(future, task)

    def _do(self, future: "concurrent.futures.Future[Any]", task: Tuple[Any, ...]) -> None:
        try:
            self._connection.send(task)
            result, error, where = self._connection.recv()
        except (EOFError, OSError):
            error, where = MrlError("a worker process has ended early, expected it to finish its work"), ""
        except Exception as unsent:  # noqa: BLE001 - such as work that cannot be pickled
            error, where = unsent, ""
        if error is None:
            future.set_result(result)
        else:
            error.__cause__ = WorkerTraceback(where) if where else error.__cause__
            future.set_exception(error)


@contextlib.contextmanager
def pool(count: int) -> Iterator[Submit]:
    """Start `count` workers; yields a function that submits a function and its arguments to them.

    The end of the block waits for all work.  An exception in the block, also one raised by a signal, ends the work that
    is running: each worker gets SIGTERM, and after `GRACE_S` SIGKILL.  A signal during that time kills them at once.
    """
    work: queue.SimpleQueue[Any] = queue.SimpleQueue()
    workers: List[_Worker] = []

    def submit(function: Callable[..., Any], *args: Any) -> "concurrent.futures.Future[Any]":
        future: concurrent.futures.Future[Any] = concurrent.futures.Future()
        work.put((future, (function, args)))
        return future

    try:
        for _ in range(count):
            workers.append(_Worker(work))
        yield submit
        for _ in workers:
            work.put(None)
        for worker in workers:
            worker.thread.join()
    finally:
        _end(work, workers)


def _end(work: "queue.SimpleQueue[Any]", workers: List[_Worker]) -> None:
    """End all workers, those that are waiting for work and those that are working."""
    began_s = time.monotonic()
    late: Optional[BaseException] = None
    while True:
        try:
            _tell(work, workers)
            for worker in workers:
                worker.process.join(max(0.0, began_s + GRACE_S - time.monotonic()))
            break
        except BaseException as error:  # noqa: BLE001 - raised again below
            late = error
            if time.monotonic() - began_s > TWICE_S:
                break
    for worker in workers:
        worker.process.kill()
    for worker in workers:
        worker.process.join(GRACE_S)
        worker.thread.join(GRACE_S)
    if late is not None:
        raise late


def _tell(work: "queue.SimpleQueue[Any]", workers: List[_Worker]) -> None:
    """Take back the work that has not begun, and end what has."""
    with contextlib.suppress(queue.Empty):
        while True:
            work.get_nowait()
    for worker in workers:
        work.put(None)
        worker.process.terminate()


# -- in the worker


def _serve(connection: Connection) -> None:
    """Work for the parent until the pipe ends, or a signal arrives."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _leave)
    threading.Thread(target=_follow_parent, daemon=True).start()
    while True:
        task = _received(connection)
        if task is None:
            _ignore_signals()  # one that comes while the interpreter ends would print a traceback
            return
        function, args = task
        try:
            connection.send((function(*args), None, ""))
        except Exception as error:  # noqa: BLE001 - the parent gets every error of the work
            connection.send((None, error, traceback.format_exc()))


def _received(connection: Connection) -> Optional[Tuple[Callable[..., Any], Tuple[Any, ...]]]:
    try:
        task: Tuple[Callable[..., Any], Tuple[Any, ...]] = connection.recv()
        return task
    except (EOFError, OSError):
        return None


def _leave(*_: object) -> None:
    """End the work in order; further signals must not interrupt that."""
    _ignore_signals()
    sys.exit(TERMINATED)


def _ignore_signals() -> None:
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)


def _follow_parent() -> None:
    """Wait for the end of the parent, and end the worker as the parent would."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE_S)
    os.kill(os.getpid(), signal.SIGKILL)
