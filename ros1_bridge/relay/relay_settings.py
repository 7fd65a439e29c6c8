"""Parameters of `topic_relay`: addresses, peers, and topics in both directions.  Pure."""

import re
from typing import Any, Dict, List, NamedTuple, Tuple

from mrl_driver.errors import ConfigError
from ros1_bridge.node.parameters import Row, read

PORT = 11411
PARAMETERS = (
    Row("name", str, None, "", "Name of this robot or computer among the relays, such as robot1"),
    Row("listen", str, f"127.0.0.1:{PORT}", "", "Address at which other relays fetch topics, HOST:PORT"),
    Row("send", str, "", "", "Topics that others may fetch, separated by commas"),
    Row("peers", str, "", "", "Relays to fetch topics from, NAME=HOST:PORT, separated by commas"),
    Row(
        "receive",
        str,
        "",
        "",
        "Topics to fetch, NAME/TOPIC, or NAME/TOPIC=HERE to choose the name they get here",
    ),
    Row("max_age", float, 0.3, "s", "Drop messages that are older than this when they arrive", 0.02, 60.0),
    Row("timeout", float, 1.0, "s", "A relay that is silent for this time is cut off", 0.5, 60.0),
)
"""The node's private parameters.  `send`, `peers` and `receive` may also be lists."""
_NAME = re.compile(r"[A-Za-z]\w*\Z")
_TOPIC = re.compile(r"/?[A-Za-z]\w*(/\w+)*\Z")


class Address(NamedTuple):
    """Where a relay listens."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class Settings(NamedTuple):
    """Parameters of one relay.

    Attributes:
        send: Topics by the name that other relays know; values are their names here.
        receive: For each peer, its topics; values are their names here.
    """

    name: str
    listen: Address
    send: Dict[str, str]
    peers: Dict[str, Address]
    receive: Dict[str, Dict[str, str]]
    max_age_s: float
    timeout_s: float


def read_settings(given: Any, namespace: str) -> Settings:
    """The settings in a node's private parameters.

    Raises:
        ConfigError: a value is missing, misspelt, out of range, or appears twice.
    """
    if isinstance(given, dict):
        given = {
            key: ", ".join(map(str, each)) if isinstance(each, list) else each for key, each in given.items()
        }
    values = read(PARAMETERS, given, namespace)
    if not _NAME.match(values["name"]):
        raise ConfigError(f"parameter {namespace}/name is {values['name']!r}, expected a name such as robot1")
    send = _unique(
        f"{namespace}/send", [(topic.lstrip("/"), topic) for topic in _topics(namespace, values["send"])]
    )
    peers = _unique(f"{namespace}/peers", [_peer(namespace, item) for item in _items(values["peers"])])
    receive: Dict[str, Dict[str, str]] = {peer: {} for peer in peers}
    for item in _items(values["receive"]):
        peer, topic, here = _received(namespace, item)
        if peer not in peers:
            raise ConfigError(
                f"parameter {namespace}/receive has {item!r}, expected a peer's name before the slash: one of "
                f"{', '.join(peers) or f'{namespace}/peers, which is empty'}"
            )
        if topic in receive[peer]:
            raise ConfigError(f"parameter {namespace}/receive has {peer}/{topic} twice, expected each once")
        receive[peer][topic] = here
    return Settings(
        values["name"],
        _address(f"{namespace}/listen", values["listen"]),
        send,
        peers,
        receive,
        values["max_age"],
        values["timeout"],
    )


def _items(text: str) -> List[str]:
    return [item.strip() for item in text.split(",") if item.strip()]


def _topics(namespace: str, text: str) -> List[str]:
    for topic in _items(text):
        if not _TOPIC.match(topic):
            raise ConfigError(f"parameter {namespace}/send has {topic!r}, expected the name of a topic")
    return _items(text)


def _peer(namespace: str, item: str) -> Tuple[str, Address]:
    name, equals, address = item.partition("=")
    if not equals or not _NAME.match(name):
        raise ConfigError(
            f"parameter {namespace}/peers has {item!r}, expected NAME=HOST:PORT, such as robot2=10.0.0.2:{PORT}"
        )
    return name, _address(f"{namespace}/peers", address)


def _received(namespace: str, item: str) -> Tuple[str, str, str]:
    there, _, here = item.partition("=")
    peer, slash, topic = there.partition("/")
    if not slash or not _NAME.match(peer) or not all(_TOPIC.match(name) for name in (topic, here or topic)):
        raise ConfigError(
            f"parameter {namespace}/receive has {item!r}, expected NAME/TOPIC or NAME/TOPIC=HERE, such as robot2/odom"
        )
    return peer, topic.lstrip("/"), here or f"{peer}/{topic.lstrip('/')}"


def _address(key: str, text: str) -> Address:
    host, _, port = text.strip().rpartition(":")
    if not host or not port.isdigit() or int(port) > 65535:
        raise ConfigError(f"parameter {key} has {text!r}, expected HOST:PORT, such as 10.0.0.2:{PORT}")
    return Address(host, int(port))


def _unique(key: str, pairs: List[Tuple[str, Any]]) -> Dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ConfigError(f"parameter {key} has a name twice, expected each once")
    return found
