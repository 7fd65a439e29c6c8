"""Parameters of `topic_relay`: addresses, peers, and topics in both directions.  Pure."""

import re
from typing import Any, Dict, List, NamedTuple, Tuple

from mrl_driver.errors import ConfigError
from ros1_bridge.node.parameters import Row, read

PORT = 11411
_RECEIVE = "Topics to fetch, NAME/TOPIC, or NAME/TOPIC=HERE to choose the name they get here"
PARAMETERS = (
    Row("name", str, None, "", "Name of this robot or computer among the relays, such as robot1"),
    Row("listen", str, f"127.0.0.1:{PORT}", "", "Address at which other relays fetch topics, HOST:PORT"),
    Row("send", str, "", "", "Topics that others may fetch, separated by commas"),
    Row("peers", str, "", "", "Relays to fetch topics from, NAME=HOST:PORT, separated by commas"),
    Row("receive", str, "", "", _RECEIVE),
    Row("max_age", float, 0.3, "s", "Drop messages that are older than this when they arrive", 0.02, 60.0),
    Row("timeout", float, 1.0, "s", "A relay that is silent for this time is cut off", 0.5, 60.0),
)
"""The node's private parameters.  `send`, `peers` and `receive` may also be lists."""
_NAME, _TOPIC = r"[A-Za-z]\w*", r"/?[A-Za-z]\w*(?:/\w+)*"
_FORMS = {
    "send": (rf"({_TOPIC})", "the name of a topic"),
    "peers": (rf"({_NAME})=(.*)", f"NAME=HOST:PORT, such as robot2=10.0.0.2:{PORT}"),
    "receive": (
        rf"({_NAME})/({_TOPIC})(?:=({_TOPIC})?)?",
        "NAME/TOPIC or NAME/TOPIC=HERE, such as robot2/odom",
    ),
}
"""What the items of a list are like, as a regular expression and in words."""


class Address(NamedTuple):
    """Where a relay listens."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class Settings(NamedTuple):
    """Parameters of one relay."""

    name: str
    listen: Address
    send: Dict[str, str]  # topics by the name that other relays know; values are their names here
    peers: Dict[str, Address]
    receive: Dict[str, Dict[str, str]]  # for each peer, its topics; values are their names here
    max_age_s: float
    timeout_s: float


def read_settings(given: Dict[str, Any], namespace: str) -> Settings:
    """The settings in private parameters; ConfigError if one is missing, misspelt, out of range, or appears twice."""
    texts = {
        key: ", ".join(map(str, each)) if isinstance(each, list) else each for key, each in given.items()
    }
    values = read(PARAMETERS, texts, namespace)
    if not re.fullmatch(_NAME, values["name"]):
        raise ConfigError(f"parameter {namespace}/name is {values['name']!r}, expected a name such as robot1")
    send, peers, received = (
        _items(f"{namespace}/{key}", values[key], *_FORMS[key]) for key in ("send", "peers", "receive")
    )
    receive: Dict[str, Dict[str, str]] = {peer: {} for peer, _ in peers}
    for peer, topic, here in received:
        topic = topic.lstrip("/")
        if peer not in receive:
            raise ConfigError(
                f"parameter {namespace}/receive has '{peer}/{topic}', expected a peer's name before the slash: one of "
                f"{', '.join(receive) or f'{namespace}/peers, which is empty'}"
            )
        if topic in receive[peer]:
            raise ConfigError(f"parameter {namespace}/receive has {peer}/{topic} twice, expected each once")
        receive[peer][topic] = here or f"{peer}/{topic}"
    key = f"{namespace}/peers"
    addresses = _unique(key, [(peer, _address(key, there)) for peer, there in peers])
    topics = _unique(f"{namespace}/send", [(topic.lstrip("/"), topic) for (topic,) in send])
    listen = _address(f"{namespace}/listen", values["listen"])
    return Settings(values["name"], listen, topics, addresses, receive, values["max_age"], values["timeout"])


def _items(key: str, text: str, form: str, expected: str) -> List[Tuple[str, ...]]:
    """Return the parts of each item of a list with commas."""
    found = []
    for item in filter(None, map(str.strip, text.split(","))):
        parts = re.fullmatch(form, item)
        if parts is None:
            raise ConfigError(f"parameter {key} has {item!r}, expected {expected}")
        found.append(parts.groups())
    return found


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
