"""Publishing without a queue: nobody who stops reading can hold up the robot."""

import signal
import socket
import time

import pytest
import rospy
from nav_msgs.msg import Odometry

from ros1_bridge.direct import BACKLOG_BYTES, _dropping, direct_publisher
from ros1_bridge.processes import wait_until

from .rig import START_S

MESSAGES = 3000
"""Far more than the buffers of a connection hold."""
PATIENCE_S = 0.1
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


def test_connection_that_nobody_reads_drops_messages(pair):
    near, _ = pair
    write = _dropping(near, near.sendall)
    longest_s = 0.0
    for _ in range(MESSAGES):
        begin = time.monotonic()
        write(bytes(1000))
        longest_s = max(longest_s, time.monotonic() - begin)
    assert longest_s < PATIENCE_S


def test_reader_that_wakes_up_gets_whole_messages(pair):
    near, far = pair
    write = _dropping(near, near.sendall)
    for _ in range(MESSAGES):
        write(bytes(1000))
    near.shutdown(socket.SHUT_WR)
    received = sum(iter(lambda: len(far.recv(65536)), 0))
    assert BACKLOG_BYTES < received < MESSAGES * 1000
    assert received % 1000 == 0


def test_stalled_subscriber_neither_holds_up_nor_loses_its_connection(rig):
    topic = f"{rig.ns}/odom"
    publisher = direct_publisher(rospy.Publisher, topic, Odometry)
    sleepy = rig.start("sleepy", "/usr/bin/python3", "-c", SLEEPY_SUBSCRIBER.format(topic=topic))
    assert wait_until(lambda: publisher.get_num_connections() > 0, START_S)
    sleepy.signal(signal.SIGSTOP)
    begin = time.monotonic()
    for _ in range(MESSAGES):
        publisher.publish(Odometry())
    assert time.monotonic() - begin < START_S
    sleepy.signal(signal.SIGCONT)

    def newest_arrives() -> bool:
        publisher.publish(Odometry())
        return any(int(line) > MESSAGES for line in sleepy.output() if line.isdigit())

    assert wait_until(newest_arrives, START_S)
    publisher.unregister()
