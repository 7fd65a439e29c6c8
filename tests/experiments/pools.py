"""Pools for experiments that are not worth a process."""

from concurrent.futures import Future
from contextlib import contextmanager

from mrl_driver.errors import MrlError


@contextmanager
def at_once(_count):
    """A pool without processes: each piece of work is done when it is submitted."""

    def submit(function, *args):
        future = Future()
        try:
            future.set_result(function(*args))
        except MrlError as error:
            future.set_exception(error)
        return future

    yield submit
