"""Datagrams to a program that may be there or not, and the listening end of a wire by datagrams."""

import contextlib
import select
import socket
from contextlib import closing

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.transport import sockets
from mrl_driver.transport.listener import MOST_DATAGRAMS, listen, prompt
from mrl_driver.transport.sockets import UdpSender
from tests.waiting import PATIENCE_S


@contextlib.contextmanager
def listening(host):
    """A socket that listens on a free port of this address, and HOST:PORT."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as end:
        end.settimeout(PATIENCE_S)
        end.bind((host, 0))
        yield end, f"{f'[{host}]' if ':' in host else host}:{end.getsockname()[1]}"


@contextlib.contextmanager
def sending(to):
    with contextlib.closing(UdpSender(to)) as sender:
        yield sender


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
@pytest.mark.parametrize("scheme", ["", "udp://"])
def test_a_datagram_arrives_as_it_was_sent(host, scheme):
    with listening(host) as (end, to), sending(scheme + to) as sender:
        sender.send(b'{"timestamp":1.5}')
        assert (end.recv(4096), sender.loss) == (b'{"timestamp":1.5}', "")


def test_nobody_needs_to_listen():
    with listening("127.0.0.1") as (_, to):
        pass
    with sending(to) as sender:
        for _ in range(3):
            sender.send(b"{}")
        assert sender.loss == ""


def test_what_the_system_does_not_send_is_counted():
    with listening("127.0.0.1") as (_, to), sending(to) as sender:
        for data in (b"{}", b" " * 70000, b"{}", b" " * 70000):
            sender.send(data)
        assert sender.loss.startswith(f"--udp {to}: 2 of 4 datagrams were not sent (message too long); check")


def test_a_name_with_several_addresses_means_the_ipv4_one(monkeypatch):
    """PlotJuggler listens on IPv4 alone, and localhost is ::1 first on many computers."""
    with listening("127.0.0.1") as (end, to):
        port = int(to.rpartition(":")[2])
        found = [
            (family, socket.SOCK_DGRAM, 0, "", there)
            for family, there in (
                (socket.AF_INET6, ("::1", port, 0, 0)),
                (socket.AF_INET, ("127.0.0.1", port)),
            )
        ]
        monkeypatch.setattr(sockets, "resolve", lambda *_: found)
        with sending(f"localhost:{port}") as sender:
            sender.send(b"{}")
            assert end.recv(10) == b"{}"


@pytest.mark.parametrize(
    "to",
    [
        *("", "9870", "127.0.0.1", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:65536", "::1:9870"),
        *(
            "tcp://127.0.0.1:9870",
            "127.0.0.1:9870/robot",
            "127.0.0.1:9870?bind=127.0.0.1:1",
            "me@127.0.0.1:9870",
        ),
    ],
)
def test_what_is_no_address_is_refused_with_an_example(to):
    with pytest.raises(ConfigError) as refused:
        UdpSender(to)
    assert str(refused.value) == (
        f"--udp is {to!r}, expected HOST:PORT, such as 127.0.0.1:9870 or [::1]:9870"
    )


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
