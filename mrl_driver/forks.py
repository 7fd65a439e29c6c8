"""What a fork leaves to the parent.

A forked child has copies of the parent's ports and locks, but none of its threads: a lock that a thread held stays held
for ever, and bytes that the child sends go to the parent's robot.  So what owns a port or a thread gives its copy in
the child up.
"""

import contextlib
import os
import weakref
from typing import Protocol


class Owner(Protocol):
    """Something that owns a port or a thread."""

    def abandon(self) -> None:
        """In the child: be closed, with new locks, and without a byte or an order to what is the parent's."""


_owners: "weakref.WeakSet[Owner]" = weakref.WeakSet()


def leave_to_parent(owner: Owner) -> None:
    """Have `owner` abandoned in each process that is forked from now on."""
    _owners.add(owner)


def _abandon_all() -> None:
    for owner in list(_owners):
        with contextlib.suppress(OSError):
            owner.abandon()
    _owners.clear()


os.register_at_fork(after_in_child=_abandon_all)
