"""Publishing without a queue: nobody who stops reading can hold up the robot."""

import signal
import socket

import pytest
import rospy
from nav_msgs.msg import Odometry

from ros1_bridge.topics.fast_publisher import BACKLOG_BYTES, Fast, direct_publisher
from tests.waiting import wait_until

MESSAGES = 3000
"""Far more than the buffers of a connection hold."""
SLEEPY_SUBSCRIBER = """
import rospy
from nav_msgs.msg import Odometry
rospy.init_node("sleepy", anonymous=True)
rospy.Subscriber("{topic}", Odometry, lambda m: print(m.header.seq, flush=True), queue_size=1)
rospy.spin()
"""


@pytest.fixture
def pair():
    """Two ends of a TCP connection."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        near = socket.create_connection(server.getsockname())
        far, _ = server.accept()
    yield near, far
    near.close()
    far.close()


class Transport:
    """A connection of rospy's, as far as it is used."""

    stat_bytes = stat_num_msg = 0

    def __init__(self, near):
        self.socket = near


def writer(near):
    """A publisher's connection through this socket."""

    class WithConnection:
        def __init__(self, *_, **__):
            self.impl, self.connections = self, [Transport(near)]

        def add_subscriber_listener(self, listener):
            self.listener = listener

    publisher = direct_publisher(WithConnection, "odom", Odometry)
    publisher.listener.peer_subscribe("odom", None, None)
    return publisher.connections[0]


def test_connection_that_nobody_reads_drops_messages(pair):
    """A write that waits for the reader would wait for good."""
    transport = writer(pair[0])
    for _ in range(MESSAGES):
        transport.write_data(bytes(1000))
    assert transport.stat_num_msg < MESSAGES


def test_reader_that_wakes_up_gets_whole_messages(pair):
    near, far = pair
    write = writer(near).write_data
    for _ in range(MESSAGES):
        write(bytes(1000))
    near.shutdown(socket.SHUT_WR)
    received = sum(iter(lambda: len(far.recv(65536)), 0))
    assert BACKLOG_BYTES < received < MESSAGES * 1000
    assert received % 1000 == 0


def test_rospy_is_told_what_was_sent(pair):
    transport = writer(pair[0])
    transport.write_data(bytes(70))
    transport.write_data(bytes(30))
    assert (transport.stat_bytes, transport.stat_num_msg) == (100, 2)


def test_stalled_subscriber_neither_holds_up_nor_loses_its_connection(rig):
    topic = f"{rig.ns}/odom"
    publisher = direct_publisher(rospy.Publisher, topic, Odometry)
    sleepy = rig.start("sleepy", "/usr/bin/python3", "-c", SLEEPY_SUBSCRIBER.format(topic=topic))
    wait_until(lambda: publisher.get_num_connections() > 0)
    sleepy.signal(signal.SIGSTOP)
    for _ in range(MESSAGES):
        publisher.publish(Odometry())
    sleepy.signal(signal.SIGCONT)

    def newest_arrives() -> bool:
        publisher.publish(Odometry())
        return any(int(line) > MESSAGES for line in sleepy.output() if line.isdigit())

    wait_until(newest_arrives)
    publisher.unregister()


class Broken(Exception):
    """What a connection that broke raises."""


class Connection:
    def __init__(self, good=True):
        self.good, self.sent, self.closed = good, [], False

    def write_data(self, data):
        if not self.good:
            raise Broken
        self.sent.append(data)

    def close(self):
        self.closed = True


class Publisher:
    """A publisher with connections, as rospy's."""

    def __init__(self, *connections):
        self.impl, self.connections = self, connections


def test_fast_message_is_what_rospy_sends():
    connection, message = Connection(), Odometry()
    message.header.frame_id, message.child_frame_id = "odom", "base_link"
    Fast(Publisher(connection), Broken).publish(message)
    size, body = connection.sent[0][:4], connection.sent[0][4:]
    assert int.from_bytes(size, "little") == len(body)
    assert Odometry().deserialize(body) == message
    assert message.header.seq == 1


def test_shorter_message_leaves_nothing_of_the_longer_one():
    connection, message = Connection(), Odometry()
    fast = Fast(Publisher(connection), Broken)
    message.child_frame_id = "a_long_name"
    fast.publish(message)
    message.child_frame_id = ""
    fast.publish(message)
    assert len(connection.sent[1]) == len(connection.sent[0]) - len("a_long_name")


def test_broken_connection_is_closed_and_costs_the_others_nothing():
    broken, good = Connection(good=False), Connection()
    Fast(Publisher(broken, good), Broken).publish(Odometry())
    assert (len(good.sent), broken.closed, good.closed) == (1, True, False)


def test_subscriber_that_dies_is_forgotten(rig):
    topic = f"{rig.ns}/odom"
    publisher = direct_publisher(rospy.Publisher, topic, Odometry)
    fast = Fast(publisher, rospy.exceptions.TransportException)
    dying = rig.start("dying", "/usr/bin/python3", "-c", SLEEPY_SUBSCRIBER.format(topic=topic))
    wait_until(lambda: fast.impl.connections)
    dying.signal(signal.SIGKILL)

    def is_forgotten():
        fast.publish(Odometry())
        return not fast.impl.connections

    wait_until(is_forgotten)
    publisher.unregister()
