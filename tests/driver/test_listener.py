"""The listening end of a wire by datagrams."""

import select
import socket
from contextlib import closing

import pytest

from mrl_driver.transport.listener import MOST_DATAGRAMS, listen, prompt


@pytest.fixture
def listener():
    with closing(listen("udp://127.0.0.1:0")) as listening:
        yield listening


@pytest.fixture
def client(listener):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as end:
        end.connect(("127.0.0.1", listener.address.port))
        yield end


def waits(listener):
    return bool(select.select([listener.data], [], [], 0)[0])


def test_a_large_datagram_comes_whole(client, listener):
    """A rest kept for later would wait unseen: the descriptor tells of the system's bytes alone."""
    client.send(bytes(5000))
    assert select.select([listener.data], [], [], 5)[0]
    assert len(listener.read(4096)) == 5000 and not waits(listener)


def test_bytes_of_a_client_that_left_are_not_handed_to_the_next(client, listener):
    client.send(b"x" * 1000)
    listener.read(96)
    listener.drop()
    assert listener.read() == b""


def test_a_flood_by_others_holds_up_no_read(client, listener):
    """The bridge sends its stops between two reads."""
    client.send(b"@5e")
    assert select.select([listener.data], [], [], 5)[0] and listener.read() == b"@5e"
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        for _ in range(MOST_DATAGRAMS):
            stranger.sendto(b"@11,200,0e", ("127.0.0.1", listener.address.port))
        client.send(b"@6e")
    assert listener.read() == b"" and listener.read() == b"@6e"


def test_a_connection_asks_each_second_whether_its_other_end_is_there_and_ends_after_two():
    with closing(socket.socket()) as end:
        prompt(end)
        assert end.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
        names = ("TCP_NODELAY", "TCP_KEEPIDLE", "TCP_KEEPINTVL", "TCP_KEEPCNT", "TCP_USER_TIMEOUT")
        set_to = [end.getsockopt(socket.IPPROTO_TCP, getattr(socket, name)) for name in names]
        assert set_to == [1, 1, 1, 2, 2000]
