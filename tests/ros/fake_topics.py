"""A stand-in for rospy's publishers that keeps what it is sent."""

from types import SimpleNamespace


class Topics(dict):
    """Publishers by topic; those of `heard` have somebody who subscribes."""

    def __init__(self, *heard):
        super().__init__()
        self._heard = heard

    def __call__(self, topic, kind, **options):
        made = self[topic] = SimpleNamespace(kind=kind, options=options, sent=[])
        to = SimpleNamespace(
            socket=None, write_data=lambda data: made.sent.append(kind().deserialize(data[4:]))
        )
        connections = [to] if topic in self._heard else []
        made.impl = SimpleNamespace(connections=connections, add_subscriber_listener=lambda _: None)
        made.publish = made.sent.append
        return made
