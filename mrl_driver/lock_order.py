"""The threads of driver and ROS node, their locks, and the order in which locks are taken.

Threads:
    mrl-driver: reads the port, does what is due, calls the callbacks.  It is the only one that reads.
    mrl-close: closes a driver that the program has lost (`driver.connection`).
    mrl-url: copies bytes of pyserial's URLs into a pipe (`transport.pyserial_link`).
    mrl-look: looks for the lost port of `mrl serve` (`transport.relay`), while its loop goes on.
    recorder: writes the recording's file (`recording.recording`); bytes reach it through a queue.
    recorder-end: closes that file if a callback has ended the recording (`driver.driver_recorder`).
    probe: ask several ports at once for their boards (`driver.probe`).
    teller: writes the messages of `mrl serve` (`transport.relay`), so that a slow terminal delays no byte.
    later: offers the node's limits to `dynamic_reconfigure` some time after the start, and ends the node after its
    service `shutdown` has answered (`robot.robot_node`).
    planner: gives the planner the speed that the zones allow (`robot.zone_topics`).
    mrl-web-files: starts, ends and lists recordings for the page.  The page's event loop runs in the thread that calls
    `apps.web.server.serve`; it has no lock of its own.
    Any thread of the program may call the methods of `Driver`; in the ROS node these are the main thread (status and
    diagnostics) and one thread for each connection of a subscriber or service.

Locks, in the order in which a thread may take them (`ORDER`).  A thread that holds one takes only later ones:
    status: the state that the node published last.
    pose goal: the pose that the node drives to.
    limits: the node's operation mode and limits, its emergency stop and its motor switch.
    sources: which sources of commands may move the robot (`control.velocity_sources`).
    operators: how late the commands of each operator arrive (`robot.operators`).
    driver: the core with its session and state.  Callbacks run without it.
    links: the link that is being opened, so that `close` can interrupt it.
    zones: the readings of the protective zones; the core asks them for the speed that they allow.
    link read: one reader of a link at a time.  It is held while the reader waits for bytes.
    link write, link wake: the descriptors of a link; held for one call of the system that does not block.
    frame log: the lines of `mrl monitor --frames`, which the link's bytes come to (`terminal.frame_log`).

No lock but `limits` is held while a port may block a write, which is given up after 100 ms.  One thread writes at a
time, which a flag under the driver's lock ensures.  What another thread wants to send meanwhile is queued, and the
reading thread sends it next.

With the environment variable `MRL_CHECK_LOCKS` set, locks raise `RuntimeError` if they are taken in another order.
"""

import os
import threading
from typing import Any, List, Tuple

ORDER = (
    "status",
    "pose goal",
    "limits",
    "sources",
    "operators",
    "driver",
    "links",
    "zones",
    "link read",
    "link write",
    "link wake",
    "frame log",
)
VARIABLE = "MRL_CHECK_LOCKS"
_threads = threading.local()


def new_lock(name: str) -> Any:
    """Return a lock that its owner may take again; `name` is one of `ORDER`."""
    rank = ORDER.index(name)
    return _OrderedLock(rank) if os.environ.get(VARIABLE) else threading.RLock()


def held() -> Tuple[str, ...]:
    """Return the names of the locks that this thread holds; always empty unless locks are checked."""
    return tuple(ORDER[lock.rank] for lock in _stack())


def _stack() -> List["_OrderedLock"]:
    if not hasattr(_threads, "stack"):
        _threads.stack = []
    stack: List[_OrderedLock] = _threads.stack
    return stack


class _OrderedLock:
    """A lock that checks the order; a condition may be built on it."""

    def __init__(self, rank: int) -> None:
        self.rank = rank
        self._lock = threading.RLock()

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """As `RLock.acquire`; RuntimeError if this thread holds another lock that is not earlier in `ORDER`."""
        stack = _stack()
        wrong = [lock for lock in stack if lock.rank >= self.rank]
        if wrong and self not in stack:
            raise RuntimeError(
                f"lock {ORDER[self.rank]!r} is taken while {held()} are held, expected the order {ORDER}"
            )
        taken = self._lock.acquire(blocking, timeout)
        if taken:
            stack.append(self)
        return taken

    def release(self) -> None:
        """As `RLock.release`."""
        _stack().remove(self)
        self._lock.release()

    def __enter__(self) -> "_OrderedLock":
        self.acquire()
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def _is_owned(self) -> bool:
        """`threading.Condition` asks this; its own check would be wrong for a lock that may be taken again."""
        return self in _stack()
