"""Few descriptors, no thread: a computer at its limits, for a block of a test."""

import contextlib
import os
import resource
import threading

import pytest

MOST = 30  # More descriptors and threads than anything here needs


def opened():
    """The descriptors of this process, with what they lead to."""
    found = {}
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):  # that of this look
            found[int(name)] = os.readlink(f"/proc/self/fd/{name}")
    return found


@contextlib.contextmanager
def descriptors_left(count):
    """In this block only so many descriptors can be opened."""
    taken, limits = sorted(opened()), resource.getrlimit(resource.RLIMIT_NOFILE)
    holes = [os.open(os.devnull, os.O_RDONLY) for number in range(taken[-1] + 1) if number not in taken]
    resource.setrlimit(resource.RLIMIT_NOFILE, (taken[-1] + 1 + count, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
        for hole in holes:
            os.close(hole)


@contextlib.contextmanager
def threads_left(count):
    """In this block only so many threads can be started."""
    start, left = threading.Thread.start, [count]

    def begin(self):
        left[0] -= 1
        if left[0] < 0:
            raise RuntimeError("can't start new thread")
        start(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(threading.Thread, "start", begin)
        yield


def errors_of_each_step(open_it, left, *kinds):
    """Open something with none left, one, two and so on, until it opens; the errors before, of these kinds.

    None of them leaves a descriptor or a thread.
    """
    open_it().close()  # what it imports is imported
    before, threads, errors = opened(), threading.active_count(), []
    for count in range(MOST):
        with left(count):
            try:
                open_it().close()
                break
            except kinds as error:
                errors.append(error)  # it keeps what the collector would close
        assert opened() == before and threading.active_count() == threads
    assert opened() == before and count < MOST - 1
    return errors
