"""Datagrams to a program that may be there or not."""

import contextlib
import socket

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.transport import udp_sender
from mrl_driver.transport.udp_sender import UdpSender
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
        monkeypatch.setattr(udp_sender, "resolve", lambda *_: found)
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
