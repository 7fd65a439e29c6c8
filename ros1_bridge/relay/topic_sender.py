"""The end of a relay that sends topics: serves all relays that connect to it.  No ROS.

Messages that wait for a slow link are replaced by newer ones of the same publisher.
"""

import contextlib
import math
import os
import selectors
import socket
import threading
import time
from collections import deque
from typing import Callable, Deque, Dict, List, NamedTuple, Optional, Set, Tuple

from mrl_driver.clocks import clock_s
from mrl_driver.errors import shortage

from . import relay_frames as frames
from .relay_frames import PROTOCOL, RelayError
from .relay_settings import Address, Settings

MOST_RECEIVERS = 32  # more relays than these are refused
SETTLE_S = 2.0
"""A latched command that comes within this time after the start may be one of before: it is not sent."""
MOST_BYTES = 16384
"""At most this many bytes are in transit: what waits in a network cannot be replaced by something newer."""
MOST_OF_ONE = 4  # at most this many messages of one publisher are in transit
MOST_MESSAGES = 64  # at most this many messages are in transit, and one if the link is slow
SLOWER_S = 0.05
"""A link is slow if an answer takes longer than the fastest one by this time: then messages wait in the network."""
_FORGETS = 1.001
"""The fastest time grows by this factor with each answer, so that a lasting change of the network is accepted."""
_READ_BYTES = 65536


class Outbox:
    """What leaves next on one connection.  Pure: times are arguments.

    A message replaces the one of the same publisher that still waits.  It leaves when enough of the messages before it
    have arrived.  How many may be in transit depends on how fast the answers come.
    """

    def __init__(self) -> None:
        self._waiting: Dict[int, frames.Message] = {}
        self._in_transit: Deque[Tuple[int, int, float]] = deque()
        self._bytes = self._arrived = 0
        self._messages: Dict[int, int] = {}
        self._fastest_s, self._most = math.inf, float(MOST_OF_ONE)

    def put(self, message: frames.Message) -> None:
        """Let a message wait; it takes the place of the one that it replaces."""
        self._waiting[message.number] = message

    def next(self, now_s: float) -> Optional[frames.Message]:
        """The message to send now; None if none waits or too much is in transit."""
        for number, message in self._waiting.items():
            if self._may_leave(message):
                del self._waiting[number]
                size = len(message.body)
                self._in_transit.append((number, size, now_s))
                self._bytes += size
                self._messages[number] = self._messages.get(number, 0) + 1
                return message
        return None

    def taken(self, count: int, now_s: float) -> None:
        """The receiver says that `count` messages have arrived since the beginning."""
        while self._arrived < count and self._in_transit:
            self._arrived += 1
            number, size, left_s = self._in_transit.popleft()
            self._bytes -= size
            self._messages[number] -= 1
            self._adapt(now_s - left_s)

    def _may_leave(self, message: frames.Message) -> bool:
        if not self._in_transit:
            return True
        if len(self._in_transit) >= int(self._most) or self._bytes + len(message.body) > MOST_BYTES:
            return False
        return self._messages.get(message.number, 0) < MOST_OF_ONE

    def _adapt(self, took_s: float) -> None:
        """One more in transit after a round of fast answers, half after a slow one."""
        self._fastest_s = min(took_s, self._fastest_s * _FORGETS)
        if took_s > self._fastest_s + SLOWER_S:
            self._most = max(1.0, self._most / 2)
        else:
            self._most = min(float(MOST_MESSAGES), self._most + 1 / self._most)


class MessageType(NamedTuple):
    """Type of a topic, as ROS describes it in the header of a connection."""

    type: str
    md5sum: str
    definition: str


class TopicSender:
    """Listens for other relays, and sends them the topics that they ask for, if they are among its own.

    `tell` gets a line about each receiver that comes or goes.  `publishes` says whether a publisher of a topic still
    exists; its latched message is not repeated if it does not.  OSError if the address cannot be used; port 0 takes a
    free one.
    """

    def __init__(
        self,
        settings: Settings,
        tell: Callable[[str], None],
        publishes: Callable[[str, str], bool] = lambda topic, publisher: True,
    ) -> None:
        self.settings, self.tell = settings, tell
        self.run = os.urandom(8).hex()
        self.too_long = 0  # messages that were longer than `LONGEST_BYTES`, and not sent
        self.began_s = clock_s()
        self._publishes = publishes
        self._sources: Dict[Tuple[str, str], frames.Source] = {}
        self._sequences: Dict[int, int] = {}
        self._latched: Dict[int, Tuple[frames.Source, frames.Message]] = {}
        self._receivers: List[_Receiver] = []
        self._lock = threading.Lock()
        self._listener = socket.create_server(tuple(settings.listen))
        self.address = Address(*self._listener.getsockname()[:2])
        self._closed = False
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def publish(self, topic: str, publisher: str, kind: MessageType, latched: bool, body: bytes) -> None:
        """Send a serialized message to all receivers that ask for the topic."""
        stamp_s = clock_s()
        if latched and frames.is_command(kind.type) and stamp_s < self.began_s + SETTLE_S:
            self.tell(
                f"{topic} of {publisher}: not sent: a latched command may be one of before this start; send it again"
            )
            return
        with self._lock:
            source = self._source(topic, publisher, kind, latched)
            self._sequences[source.number] += 1
            message = frames.Message(source.number, self._sequences[source.number], stamp_s, body)
            if len(body) > frames.LONGEST_BYTES - 64:
                self.too_long += 1
                return
            if source.latched:
                self._latched[source.number] = source, message
            receivers = list(self._receivers)
        for receiver in receivers:
            receiver.offer(source, message)

    def latched(self) -> List[Tuple[frames.Source, frames.Message]]:
        """The last messages of all latched publishers that still exist."""
        with self._lock:
            kept = list(self._latched.values())
        return [pair for pair in kept if self._publishes(pair[0].topic, pair[0].publisher)]

    def report(self) -> Dict[str, str]:
        """Which topics are sent, and which relays get them, as keys and values."""
        with self._lock:
            receivers = [each.words for each in self._receivers if each.words]
        return {
            "Address": str(self.address),
            "Topics": ", ".join(sorted(self.settings.send)),
            "Receivers": ", ".join(receivers),
            "Too Long": str(self.too_long),
        }

    def close(self) -> None:
        """End all connections."""
        with self._lock:
            self._closed = True
            receivers = list(self._receivers)
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()
        for receiver in receivers:
            receiver.close()

    def forget(self, receiver: "_Receiver") -> None:
        """A connection has ended."""
        with self._lock:
            self._receivers.remove(receiver)

    def _source(self, topic: str, publisher: str, kind: MessageType, latched: bool) -> frames.Source:
        known = self._sources.get((topic, publisher))
        latched = latched and not frames.is_command(kind.type)
        number = known.number if known else len(self._sequences) + 1
        source = frames.Source(number, topic, publisher, *kind, latched)
        if source != known:
            source = source._replace(number=len(self._sequences) + 1)
            self._sequences[source.number] = 0
            if known:
                self._latched.pop(known.number, None)
            self._sources[topic, publisher] = source
        return source

    def _accept(self) -> None:
        while not self._closed:
            try:
                connection, address = self._listener.accept()
            except OSError:
                if self._closed:
                    return
                time.sleep(0.1)  # no free file descriptor
                continue
            with self._lock:
                try:
                    if self._closed or len(self._receivers) >= MOST_RECEIVERS:
                        raise RelayError(f"{len(self._receivers)} relays are connected")
                    receiver = _Receiver(self, connection, Address(*address[:2]))
                    receiver.start()
                    self._receivers.append(receiver)
                # or there is no descriptor or thread, or the connection has ended
                except (OSError, RuntimeError, RelayError) as error:
                    connection.close()
                    self.tell(f"{Address(*address[:2])}: refused: {shortage(error) or error}")


class _Receiver:
    """One connection."""

    def __init__(self, sender: TopicSender, connection: socket.socket, address: Address) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.words = ""  # name and address, after the first frame
        self._sender, self._socket, self._address = sender, connection, address
        self._frames, self._outbox = frames.FrameReader(), Outbox()
        self._lock = threading.RLock()
        self._declared: Set[int] = set()
        self._sources: Dict[int, frames.Source] = {}
        self._topics: Optional[Set[str]] = None
        self._open = self._ended = False
        self._unsent = b""
        self._end, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def start(self) -> None:
        """Serve it in a thread of its own."""
        try:
            self._thread.start()
        except RuntimeError:
            os.close(self._end)
            os.close(self._wake)
            raise

    def offer(self, source: frames.Source, message: frames.Message) -> None:
        """Send a message as soon as the link allows, unless a newer one replaces it before."""
        with self._lock:
            if not self._open or self._ended or self._topics is None or source.topic not in self._topics:
                return
            self._sources[source.number] = source
            self._outbox.put(message)
            blocked = bool(self._unsent)
            with contextlib.suppress(OSError):  # the thread sees it too
                self._flush()
            if self._unsent and not blocked:
                os.write(self._wake, b"w")

    def close(self) -> None:
        """End the connection."""
        with self._lock:
            if not self._ended:
                self._ended = True
                os.write(self._wake, b"e")
        self._thread.join()

    def _serve(self) -> None:
        reason = ""
        try:
            self._exchange()
        except (OSError, RelayError) as error:
            reason = str(error)
        with self._lock:
            ended, self._ended = self._ended, True
            self._socket.close()
            os.close(self._end)
            os.close(self._wake)
        self._sender.forget(self)
        if not ended:
            self._sender.tell(f"{self.words or self._address}: disconnected: {reason}")

    def _exchange(self) -> None:
        heard_s = time.monotonic()
        with selectors.DefaultSelector() as selector:
            selector.register(self._end, selectors.EVENT_READ)
            selector.register(self._socket, selectors.EVENT_READ)
            while not self._ended:
                silent_s = time.monotonic() - heard_s
                if silent_s > self._sender.settings.timeout_s:
                    raise RelayError(f"silent for {silent_s:.1f} s, expected a heartbeat")
                with self._lock:
                    wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if self._unsent else 0)
                selector.modify(self._socket, wanted)
                for key, ready in selector.select(self._sender.settings.timeout_s - silent_s + 0.001):
                    if key.fd == self._end:
                        os.read(self._end, 100)
                    elif ready & selectors.EVENT_READ:
                        heard_s = time.monotonic()
                        self._read()
                with self._lock:
                    self._flush()

    def _read(self) -> None:
        data = self._socket.recv(_READ_BYTES)
        if not data:
            raise RelayError("closed by the other end")
        for event in self._frames.feed(data):
            self._take(event)

    def _take(self, event: frames.Event) -> None:
        if isinstance(event, frames.Hello) and self._topics is None:
            self._greet(event)
        elif self._topics is None:
            raise RelayError(f"got {type(event).__name__}, expected Hello first")
        elif isinstance(event, frames.Ping):
            with self._lock:
                self._unsent += frames.encode(frames.Pong(event.sent_s, clock_s()))
            if not self._open:
                self._begin()
        elif isinstance(event, frames.Taken):
            with self._lock:
                self._outbox.taken(event.messages, clock_s())
        else:
            raise RelayError(f"got {type(event).__name__}, expected Ping or Taken")

    def _greet(self, hello: frames.Hello) -> None:
        if hello.protocol != PROTOCOL:
            raise RelayError(f"got protocol {hello.protocol}, expected {PROTOCOL}: install the same version")
        topics = set(hello.topics).intersection(self._sender.settings.send)
        self._topics, self.words = topics, f"{hello.name} at {self._address}"
        self._unsent += frames.encode(
            frames.Hello(PROTOCOL, self._sender.settings.name, self._sender.run, sorted(topics))
        )
        self._sender.tell(f"{self.words}: connected, gets {', '.join(sorted(topics)) or 'no topic'}")

    def _begin(self) -> None:
        """Start the data, with what is latched: messages of the time without a connection are gone."""
        with self._lock:
            self._open = True
        for source, message in self._sender.latched():
            self.offer(source, message)

    def _flush(self) -> None:
        """Send what the socket and the window allow."""
        while True:
            if not self._unsent:
                message = self._outbox.next(clock_s())
                if message is None:
                    return
                if message.number not in self._declared:
                    self._declared.add(message.number)
                    self._unsent += frames.encode(self._sources[message.number])
                self._unsent += frames.encode(message)
            try:
                sent = self._socket.send(self._unsent)
            except BlockingIOError:
                return
            self._unsent = self._unsent[sent:]
