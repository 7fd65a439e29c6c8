"""The end of a relay that receives topics: keeps a connection to one other relay.  No ROS."""

import contextlib
import select
import socket
import threading
import time
from dataclasses import dataclass
from typing import Callable, Dict, List, Optional, Tuple

from mrl_driver.clocks import clock_s, wait_until
from mrl_driver.safety.message_age import MessageAge

from . import relay_frames as frames
from .relay_frames import PROTOCOL, RelayError
from .relay_settings import Settings

PING_S = 0.1  # time between heartbeats; less than the shortest time after which either end counts as silent
RETRY_S = 0.25
WINDOW_S = 60.0  # heartbeats older than this are forgotten: clocks drift, by less than 0.01 % of it [s]
AHEAD_S = 0.1  # a message that seems to be from so far in the future shows that a clock was set [s]
OK, WARN, ERROR = 0, 1, 2  # levels of diagnostic_msgs/DiagnosticStatus
_READ_BYTES = 65536


@dataclass
class TopicCounts:
    """What has become of the messages of one topic."""

    taken: int = 0  # messages that arrived in time
    lost: int = 0  # messages that newer ones replaced, or that were sent while there was no connection
    late: int = 0  # messages that were older than the limit, and dropped
    age_s: float = 0.0  # age of the last message that was taken [s]
    oldest_s: float = 0.0  # the largest such age since the last report [s]


class TopicReceiver:
    """Connects to a relay, again and again, and takes its topics.

    Args:
        settings: Of this relay; messages older than its limit are dropped, unless their publisher is latched.
        peer: Name of the other relay; one with another name is refused.
        take: Gets each message, with its source.
        tell: Called with True after a connection and False after its end, and a line that says why.
    """

    def __init__(
        self,
        settings: Settings,
        peer: str,
        take: Callable[[frames.Source, bytes], None],
        tell: Callable[[bool, str], None],
    ) -> None:
        self.peer, self.address = peer, settings.peers[peer]
        self.counts = {topic: TopicCounts() for topic in settings.receive[peer]}
        self.is_connected, self.reason = False, "not tried yet"
        self.missing: List[str] = []  # topics that the other relay does not send
        self._settings, self._take, self._tell = settings, take, tell
        self._known: Dict[Tuple[str, int], int] = {}
        self._ends = threading.Event()
        self._connection: Optional[socket.socket] = None
        self._told = ""
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin, in a thread of its own."""
        self._thread.start()

    def close(self) -> None:
        """End the connection."""
        self._ends.set()
        connection = self._connection
        if connection is not None:
            with contextlib.suppress(OSError):  # it has ended by itself
                connection.shutdown(socket.SHUT_RDWR)
        self._thread.join()

    @property
    def health(self) -> Tuple[int, str]:
        """Level and message about the connection."""
        if not self.is_connected:
            return ERROR, f"not connected: {self.reason}"
        return (WARN, f"does not send {', '.join(self.missing)}") if self.missing else (OK, "connected")

    def report(self) -> Dict[str, str]:
        """What has become of each topic, as keys and values; ages are those since the last report."""
        values = {"Address": str(self.address)}
        for topic, counts in self.counts.items():
            values[f"{topic} Received"] = str(counts.taken)
            values[f"{topic} Lost"] = str(counts.lost)
            values[f"{topic} Late"] = str(counts.late)
            values[f"{topic} Age [ms]"] = f"{1e3 * counts.age_s:.1f}"
            values[f"{topic} Oldest [ms]"] = f"{1e3 * counts.oldest_s:.1f}"
            counts.oldest_s = 0.0
        return values

    def _run(self) -> None:
        while not self._ends.is_set():
            try:
                with socket.create_connection(self.address, timeout=self._settings.timeout_s) as connection:
                    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    self._connection = connection
                    self._exchange(connection)
            except (OSError, RelayError) as error:
                self._lose(str(error))
            wait_until(self._ends.is_set, RETRY_S)

    def _lose(self, reason: str) -> None:
        was, self.is_connected, self.reason = self.is_connected, False, reason
        if was or reason != self._told:
            self._told = reason
            self._tell(False, f"{self.peer} at {self.address}: not connected: {reason}")

    def _exchange(self, connection: socket.socket) -> None:
        """Take what comes until the end; OSError if the connection breaks, RelayError if it is silent or another's."""
        self._frames, self._age = frames.FrameReader(), MessageAge(WINDOW_S, AHEAD_S)
        self._peer_run, self._count = "", 0
        self._sources: Dict[int, frames.Source] = {}
        self._last: Dict[int, int] = {}
        connection.sendall(frames.encode(frames.Hello(PROTOCOL, self._settings.name, "", list(self.counts))))
        heard_s, ping_s = time.monotonic(), 0.0
        while not self._ends.is_set():
            now_s = time.monotonic()
            if now_s >= ping_s:
                connection.sendall(frames.encode(frames.Ping(clock_s())))
                ping_s = now_s + PING_S
            if select.select([connection], [], [], max(0.0, ping_s - now_s))[0]:
                heard_s = time.monotonic()
                self._read(connection)
            elif time.monotonic() - heard_s > self._settings.timeout_s:
                raise RelayError(f"silent for {self._settings.timeout_s:g} s")

    def _read(self, connection: socket.socket) -> None:
        data = connection.recv(_READ_BYTES)
        if not data:
            raise RelayError("closed by the other end")
        newest: Dict[int, frames.Message] = {}
        for event in self._frames.feed(data):
            if isinstance(event, frames.Message):
                self._count += 1
                newest[event.number] = event
            elif isinstance(event, frames.Hello):
                self._greet(event)
            elif isinstance(event, frames.Pong):
                self._age.heard(*event)
                self._connected()
            elif isinstance(event, frames.Source):
                self._sources[event.number] = event._replace(
                    latched=event.latched and not frames.is_command(event.type)
                )
            else:
                raise RelayError(f"got {type(event).__name__}, expected the frames of a sender")
        for message in newest.values():
            self._message(message)
        if newest:
            connection.sendall(frames.encode(frames.Taken(self._count)))

    def _greet(self, hello: frames.Hello) -> None:
        if hello.protocol != PROTOCOL:
            raise RelayError(f"got protocol {hello.protocol}, expected {PROTOCOL}: install the same version")
        if hello.name != self.peer:
            raise RelayError(
                f"the relay there is {hello.name!r}, expected {self.peer!r}: see ~peers and ~name"
            )
        self._peer_run = hello.run  # after another start of the sender, its numbers mean other messages
        self._known = {key: last for key, last in self._known.items() if key[0] == hello.run}
        self.missing = [topic for topic in self.counts if topic not in hello.topics]

    def _connected(self) -> None:
        if self.is_connected or not self._peer_run:
            return
        self.is_connected, self.reason, self._told = True, "", ""
        words = f"{self.peer} at {self.address}: connected"
        if self.missing:
            words += f", but it does not send {', '.join(self.missing)}: see its ~send"
        self._tell(True, words)

    def _message(self, message: frames.Message) -> None:
        source = self._sources.get(message.number)
        counts = self.counts.get(source.topic) if source else None
        if source is None or counts is None:
            raise RelayError(
                f"got a message of source {message.number}, expected one of a topic that was asked for"
            )
        if message.sequence <= self._last.get(message.number, 0):
            return  # a latched message that was also sent as a new one
        self._last[message.number] = message.sequence
        before = self._known.get((self._peer_run, message.number), message.sequence - 1)
        counts.lost += max(0, message.sequence - before - 1)
        self._known[self._peer_run, message.number] = max(before, message.sequence)
        age_s = self._age.age_s(message.stamp_s, clock_s())
        if not source.latched and not age_s <= self._settings.max_age_s:
            counts.late += 1
            return
        counts.taken += 1
        counts.age_s = age_s
        counts.oldest_s = max(counts.oldest_s, age_s)
        self._take(source, message.body)
