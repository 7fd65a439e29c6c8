"""Protection against forks: the robot stays with the parent process.

A forked child has copies of the parent's ports and locks, but none of its threads.  A lock held by a thread would stay
held for ever, and bytes sent by the child would go to the parent's robot.  So each owner of a port or a thread gives
up its copy in the child.
"""

import contextlib
import os
import weakref
from typing import Any, Callable

_owners: "weakref.WeakKeyDictionary[Any, Callable[[Any], None]]" = weakref.WeakKeyDictionary()


def leave_to_parent(abandon: Callable[[], None]) -> None:
    """Call the method `abandon` in each process forked from now on, as long as its object exists.

    `abandon` must close the object in the child, with new locks.  It must not send bytes to the parent's port or change
    its settings.
    """
    method: Any = abandon
    _owners[method.__self__] = method.__func__


def _in_child() -> None:
    owners = dict(_owners)
    _owners.clear()
    for owner, abandon in owners.items():
        with contextlib.suppress(OSError):
            abandon(owner)


os.register_at_fork(after_in_child=_in_child)
