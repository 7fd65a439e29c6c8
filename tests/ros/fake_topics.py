"""A stand-in for rospy's publishers that keeps what it is sent, and refuses what is not a message of its topic."""

import io
from functools import partial
from types import SimpleNamespace

from rospy.msg import args_kwds_to_message


class Topics(dict):
    """Publishers by topic; those of `heard` have somebody who subscribes."""

    def __init__(self, *heard):
        super().__init__()
        self.heard = heard

    def __call__(self, topic, kind, **options):
        assert topic not in self, f"{topic} has a publisher already"
        made = self[topic] = SimpleNamespace(kind=kind, options=options, sent=[])
        to = SimpleNamespace(
            socket=None, write_data=lambda data: made.sent.append(kind().deserialize(data[4:]))
        )
        connections = [to] if topic in self.heard else []
        made.impl = SimpleNamespace(connections=connections, add_subscriber_listener=lambda _: None)
        made.publish, made.get_num_connections = partial(_publish, made), lambda: len(connections)
        return made


def _publish(made, *args):
    args_kwds_to_message(made.kind, args, {}).serialize(io.BytesIO())
    made.sent.append(*args)
