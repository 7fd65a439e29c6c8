"""Publishing without a queue: nobody who stops reading can hold up the robot."""

import signal
import socket
from types import SimpleNamespace

import rospy
from nav_msgs.msg import Odometry

from ros1_bridge.topics.fast_publisher import BACKLOG_BYTES, Fast, direct_publisher
from tests.waiting import wait_until

MESSAGES = 3000  # Far more than the buffers of a connection hold
SLEEPY_SUBSCRIBER = """
import rospy
from nav_msgs.msg import Odometry
rospy.init_node("sleepy", anonymous=True)
rospy.Subscriber("{topic}", Odometry, lambda m: print(m.header.seq, flush=True), queue_size=1)
rospy.spin()
"""


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


def test_stalled_subscriber_neither_holds_up_nor_loses_its_connection_and_a_dead_one_is_forgotten(rig):
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
    fast = Fast(publisher, rospy.exceptions.TransportException)
    sleepy.signal(signal.SIGKILL)
    wait_until(lambda: fast.publish(Odometry()) or not fast.impl.connections)
    publisher.unregister()


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
