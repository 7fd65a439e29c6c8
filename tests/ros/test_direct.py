"""Publishing without a queue: nobody who stops reading can hold up the robot."""

import socket
from types import SimpleNamespace

from nav_msgs.msg import Odometry

from ros1_bridge.topics.fast_publisher import BACKLOG_BYTES, Fast, direct_publisher

MESSAGES = 3000  # Far more than the buffers of a connection hold


def test_connection_that_nobody_reads_drops_whole_messages():
    """A write that waits for the reader would wait for good.  Rospy is told what was sent."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        near = socket.create_connection(server.getsockname())
        far, _ = server.accept()
    transport, listeners = SimpleNamespace(socket=near, stat_bytes=0, stat_num_msg=0), []
    given = SimpleNamespace(connections=[transport], add_subscriber_listener=listeners.append)
    given.impl = given
    direct_publisher(lambda *_, **__: given, "odom", Odometry)
    listeners[0].peer_subscribe("odom", None, None)
    with near, far:
        for _ in range(MESSAGES):
            given.connections[0].write_data(bytes(1000))
        assert BACKLOG_BYTES / 1000 < transport.stat_num_msg < MESSAGES
        near.shutdown(socket.SHUT_WR)
        received = sum(iter(lambda: len(far.recv(65536)), 0))
    assert received % 1000 == 0 and BACKLOG_BYTES < received <= transport.stat_bytes


class Broken(Exception):
    """What a connection that broke raises."""


def test_fast_messages_are_what_rospy_sends_and_a_broken_connection_is_closed_alone():
    def refuse(data):
        raise Broken

    sent, closed = [], []
    good = SimpleNamespace(write_data=lambda data: sent.append(bytes(data)))
    broken = SimpleNamespace(write_data=refuse, close=lambda: closed.append(True))
    publisher = SimpleNamespace(connections=[broken, good])
    publisher.impl, message = publisher, Odometry(child_frame_id="a_long_name")
    fast = Fast(publisher, Broken)
    for frame in ("a_long_name", ""):
        message.child_frame_id = frame
        fast.publish(message)
        size, body = sent[-1][:4], sent[-1][4:]
        assert int.from_bytes(size, "little") == len(body) and Odometry().deserialize(body) == message
    assert message.header.seq == 2 and closed
