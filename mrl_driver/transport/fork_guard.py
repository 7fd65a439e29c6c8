"""What a fork leaves to the parent.

A forked child has copies of the parent's ports and locks, but none of its threads: a lock that a thread held stays held
for ever, and bytes that the child sends go to the parent's robot.  So what owns a port or a thread gives its copy in
the child up.
"""

import contextlib
import os
import weakref
from typing import Any, Callable

_owners: "weakref.WeakKeyDictionary[Any, Callable[[Any], None]]" = weakref.WeakKeyDictionary()


def leave_to_parent(abandon: Callable[[], None]) -> None:
    """Call the method `abandon` in each process that is forked from now on, as long as there is its object.

    It is to close the object in the child, with new locks, and without a byte or an order to what is the parent's.
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
