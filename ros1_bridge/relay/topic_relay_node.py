"""ROS node `topic_relay`: named topics cross between masters, each with such a node.

A relay sends only what its `~send` names, only to relays that connect to it, and publishes only what its own
`~receive` names, fetched from addresses in its own `~peers`.  Messages are passed on as bytes, so their types need not
be installed.
"""

import contextlib
import threading
from typing import Any, Dict, Tuple

import diagnostic_updater
import rospy
from std_msgs.msg import Bool

from mrl_driver.errors import ConfigError
from ros1_bridge.node.run_node import node
from ros1_bridge.topics.fast_publisher import direct_publisher

from .relay_frames import Source
from .relay_settings import PARAMETERS, Settings, read_settings
from .topic_receiver import TopicReceiver
from .topic_sender import MessageType, TopicSender

REPORT_S = 1.0
WARN_EVERY_S = 5.0


class ReceivedTopic:
    """A topic that is published here, with the latched message of each of its publishers there.

    A publisher of rospy keeps one latched message; `/tf_static` has one from each of its publishers.  So rospy keeps
    none here, and each new subscriber gets them all.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._latched: Dict[Tuple[str, int], Any] = {}
        self._publisher: Any = None
        self._of: Tuple[str, str, bool] = ("", "", False)
        self._kind: Any = rospy.AnyMsg

    def publish(self, peer: str, source: Source, body: bytes) -> None:
        """Publish a message of a peer."""
        with self._lock:
            if not self._advertise(peer, source):
                rospy.logerr_throttle(
                    WARN_EVERY_S,
                    f"{peer}/{source.topic} is a {source.type}, expected {self._kind._type}, which "
                    f"{self._name} already is: receive it under another name",
                )
                return
            message = self._kind()
            message._buff = body
            if source.latched:
                self._latched.pop((peer, source.number), None)
                self._latched[peer, source.number] = message
            with contextlib.suppress(rospy.ROSException):  # the node ends meanwhile
                self._publisher.publish(message)
            self._publisher.impl.latch = None

    def forget(self, peer: str) -> None:
        """The peer is gone: what it had latched is no longer known to be true."""
        with self._lock:
            for key in [key for key in self._latched if key[0] == peer]:
                del self._latched[key]

    def peer_subscribe(self, _topic: str, _publish: Any, publish_to_peer: Any) -> None:
        """A subscriber has connected.  The lock keeps messages that arrive meanwhile behind those that were latched."""
        with self._lock:
            for message in self._latched.values():
                publish_to_peer(message)
            self._publisher.impl.latch = None

    def peer_unsubscribe(self, _topic: str, _peers: int) -> None:
        """A subscriber has gone."""

    def _advertise(self, peer: str, source: Source) -> bool:
        """Have a publisher of the source's type; False if the topic is of another type already."""
        former, md5sum, latched = self._of
        if md5sum == source.md5sum and (latched or not source.latched):
            return True
        if md5sum not in ("", source.md5sum):
            if former != peer:
                return False
            self._latched.clear()
        if self._publisher is not None:
            self._publisher.unregister()
        fields = {"_type": source.type, "_md5sum": source.md5sum, "_full_text": source.definition}
        self._kind = type("Relayed", (rospy.AnyMsg,), {**fields, "__slots__": []})
        self._publisher = direct_publisher(rospy.Publisher, self._name, self._kind, latch=source.latched)
        self._publisher.impl.add_subscriber_listener(self)
        self._of = peer, source.md5sum, source.latched
        return True


class TopicRelay:
    """One relay."""

    def __init__(self, settings: Settings) -> None:
        """Starts to listen and to connect; ConfigError if the address to listen at cannot be used."""
        self._settings = settings
        self._sender = self._listen()
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        for there, here in self._settings.send.items():
            self._subscribers[there] = rospy.Subscriber(
                here, rospy.AnyMsg, self._on_message, there, tcp_nodelay=True
            )
        self._topics: Dict[str, ReceivedTopic] = {}
        self._receivers = [self._receiver(peer) for peer in self._settings.peers]
        self._updater = diagnostic_updater.Updater()
        self._updater.setHardwareID(self._settings.name)
        where = 0, f"listens at {self._sender.address}"
        self._updater.add("Sends", lambda status: _filled(status, where, self._sender.report()))
        for receiver in self._receivers:
            self._updater.add(
                receiver.peer, lambda status, of=receiver: _filled(status, of.health, of.report())
            )
            receiver.start()

    def run(self) -> None:
        """Report until the shutdown."""
        while not rospy.is_shutdown():
            if self._updater.publisher.get_num_connections():
                self._updater.force_update()
            rospy.rostime.wallsleep(REPORT_S)

    def close(self) -> None:
        """End all connections."""
        for receiver in self._receivers:
            receiver.close()
        self._sender.close()

    def _listen(self) -> TopicSender:
        settings = self._settings
        try:
            return TopicSender(settings, rospy.loginfo, self._publishes)
        except OSError as error:
            raise ConfigError(
                f"parameter {rospy.get_name()}/listen is {settings.listen}, which cannot be used ({error}), expected "
                "a free port at an address of this computer"
            ) from None

    def _receiver(self, peer: str) -> TopicReceiver:
        here = self._settings.receive[peer]
        for name in here.values():
            self._topics.setdefault(rospy.resolve_name(name), ReceivedTopic(name))
        shown = rospy.Publisher(f"~{peer}/connected", Bool, queue_size=1, latch=True)
        shown.publish(False)

        def take(source: Source, body: bytes) -> None:
            self._topics[rospy.resolve_name(here[source.topic])].publish(peer, source, body)

        def connected(yes: bool, words: str) -> None:
            (rospy.loginfo if yes else rospy.logwarn)(words)
            if not yes:
                for topic in self._topics.values():
                    topic.forget(peer)
            with contextlib.suppress(rospy.ROSException):  # the node ends meanwhile
                shown.publish(yes)

        return TopicReceiver(self._settings, peer, take, connected)

    def _on_message(self, message: rospy.AnyMsg, topic: str) -> None:
        header = message._connection_header
        if header["callerid"] == rospy.get_name():
            return  # what comes from other relays does not go back
        kind = MessageType(header["type"], header["md5sum"], header.get("message_definition", ""))
        latched = header.get("latching") == "1"
        self._sender.publish(topic, header["callerid"], kind, latched, message._buff)

    def _publishes(self, topic: str, publisher: str) -> bool:
        subscriber = self._subscribers.get(topic)  # None while the node still starts
        connections = subscriber.impl.connections if subscriber else []
        return publisher in {connection.callerid_pub for connection in connections}


def _filled(status: Any, summary: Tuple[int, str], values: Dict[str, str]) -> Any:
    status.summary(*summary)
    for key, value in values.items():
        status.add(key, value)
    return status


def _run(settings: Settings) -> None:
    with contextlib.closing(TopicRelay(settings)) as relay:
        relay.run()


main = node("topic_relay", read_settings, _run, PARAMETERS)
