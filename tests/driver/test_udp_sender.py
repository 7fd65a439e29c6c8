"""Datagrams to a program that may be there or not, and the listening end of a wire by datagrams."""

import contextlib
import errno
import os
import select
import socket
import struct
from contextlib import closing
from types import SimpleNamespace
from unittest import mock

import pytest

from mrl_driver.errors import ConfigError, LinkError, LinkLost, PortBusy, PortDenied, PortMissing
from mrl_driver.transport import sockets
from mrl_driver.transport.listener import REASON, datagrams, listen, prompt
from mrl_driver.transport.open_link import open_link
from mrl_driver.transport.sockets import UdpSender, explain
from tests.waiting import PATIENCE_S, wait_until


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


def test_a_name_with_several_addresses_means_the_first_of_ipv4(monkeypatch):
    """PlotJuggler listens on IPv4 alone, and localhost is ::1 first on many computers."""
    with listening("127.0.0.1") as (end, to):
        port = int(to.rpartition(":")[2])
        found = [
            (family, socket.SOCK_DGRAM, 0, "", there)
            for family, there in (
                (socket.AF_INET6, ("::1", port, 0, 0)),
                (socket.AF_INET, ("127.0.0.1", port)),
                (socket.AF_INET, ("127.0.0.0", port)),
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
        end.settimeout(PATIENCE_S)
        end.connect(("127.0.0.1", listener.address.port))
        yield end


def come(client, listener):
    """The client's first datagram."""
    client.send(b"@5e")
    assert select.select([listener.data], [], [], PATIENCE_S)[0] and listener.read() == b"@5e"


def waits(listener):
    return bool(select.select([listener.data], [], [], 0)[0])


def test_a_new_client_by_datagrams_is_told_once(client, listener):
    assert not listener.attend()
    come(client, listener)
    assert [listener.attend() for _ in range(2)] == [True, False]


@pytest.mark.parametrize(
    "data, sizes",
    [
        (b"", []),
        (b"x" * 3000, [1400, 1400, 200]),
        (b"@5e" + b"x" * 1397, [1400]),
        (b"@5e" + b"x" * 1398, [3, 1398]),
        (b"@8,100,200,45,45,45e\r\n" * 100, [1384, 816]),
    ],
)
def test_a_datagram_has_at_most_1400_bytes(data, sizes):
    assert list(map(len, datagrams(data))) == sizes


def test_a_datagram_has_whole_frames_and_the_rest_waits(client, listener):
    assert listener.write(b"@5e") == 0  # nobody to send it to
    come(client, listener)
    for sent, received in ((b"@8,1e\r\n@8,2e\r\n@9,", b"@8,1e\r\n@8,2e\r\n"), (b"3e@7e@", b"@9,3e@7e")):
        assert listener.write(sent) == len(sent) and client.recv(4096) == received


def test_a_datagram_that_the_system_does_not_take_is_lost(client, listener, monkeypatch):
    come(client, listener)
    with monkeypatch.context() as patch:
        patch.setattr(socket.socket, "sendto", mock.Mock(side_effect=OSError))
        assert listener.write(b"@5e") == 3
    assert listener.write(b"@6e") == 3 and client.recv(9) == b"@6e"


def test_after_three_silent_seconds_another_client_is_served(client, listener, monkeypatch):
    now_s, url = [100.0], ("127.0.0.1", listener.address.port)
    monkeypatch.setattr("mrl_driver.transport.listener.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as other:
        for now_s[0], sender in ((100.0, client), (102.9, other), (103.0, other)):
            sender.sendto(b"@5e", url)
            listener.read()
        assert listener.client == f"127.0.0.1:{other.getsockname()[1]}"
        for now_s[0], there in ((105.9, True), (106.0, False)):
            listener.attend()
            assert bool(listener.client) is there


@contextlib.contextmanager
def connected(there):
    """A connection of a client that is served."""
    with closing(socket.create_connection((there.address.host, there.address.port))) as end:
        end.settimeout(PATIENCE_S)
        assert select.select([there.watch], [], [], PATIENCE_S)[0] and there.attend()
        yield end


@pytest.mark.parametrize("host, name", [("127.0.0.1", "127.0.0.1"), ("::1", "[::1]")])
def test_all_that_wait_while_a_client_is_connected_are_closed_at_once(host, name):
    with closing(listen(f"tcp://{name}:0")) as there:
        port = there.address.port
        assert (there.client, there.data, there.read(), there.write(b"@5e")) == ("", None, b"", 0)
        assert str(there.address) == f"tcp://{name}:{port}"
        with connected(there) as first:
            assert there.client == f"{name}:{first.getsockname()[1]}" and there.read() == b""
            first.send(b"@5e")
            for end in [socket.create_connection((host, port)) for _ in range(2)]:
                end.settimeout(PATIENCE_S)
                assert not there.attend()
                with end, end.makefile("rb") as told:
                    assert (
                        told.read()
                        == REASON + f"{there.client} is served; end that program first\r\n".encode()
                    )
            assert there.read() == b"@5e" and there.write(b"@5e") == 3 and first.recv(9) == b"@5e"
            wait_until(lambda: there.write(bytes(1 << 16)) == 0)
            assert there.client


def reset(end):
    """Ends a connection as a program does that left bytes unread."""
    end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    end.close()


@pytest.mark.parametrize("leave", [socket.socket.close, reset])
@pytest.mark.parametrize("notice", ["connects", "read", "write"])
def test_a_client_that_has_left_is_noticed_and_makes_room(leave, notice):
    with closing(listen("tcp://127.0.0.1:0")) as there:
        with connected(there) as first:
            leave(first)
            assert select.select([there.data], [], [], PATIENCE_S)[0]
            if notice == "read":
                assert (there.read(), there.client) == (b"", "")
            if notice == "write":
                wait_until(lambda: there.write(b"@5e") == 0)
                assert there.client == ""
        with connected(there) as second:
            assert there.client == f"127.0.0.1:{second.getsockname()[1]}"


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_an_address_is_listened_on_once(scheme):
    with closing(listen(f"{scheme}://127.0.0.1:0")) as there, pytest.raises(PortBusy, match=" is in use by"):
        listen(str(there.address))


@pytest.mark.parametrize(
    "number, kind, words",
    [
        (errno.EACCES, PortDenied, "choose a port above 1023"),
        (errno.EPERM, PortDenied, "choose a port above 1023"),
        (errno.EADDRNOTAVAIL, ConfigError, "is not an address of this computer"),
        (errno.EMFILE, LinkError, "cannot be listened on: this program has too many files open"),
        (errno.EIO, LinkError, r"cannot be listened on \(Input/output error\); choose another address"),
    ],
)
def test_an_address_that_cannot_be_listened_on_says_why(monkeypatch, number, kind, words):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(socket.socket, "bind", refuse)
    with pytest.raises(kind, match=words) as raised:
        listen("tcp://127.0.0.1:0")
    assert type(raised.value) is kind


def test_datagrams_come_from_the_address_that_was_asked_for():
    with listening("127.0.0.1") as (end, to), listening("127.0.0.1") as (taken, own):
        taken.close()
        with closing(open_link(f"udp://{to}?bind={own}")) as link:
            link.write(b"@5e")
            assert end.recvfrom(9) == (b"@5e", ("127.0.0.1", int(own.rpartition(":")[2])))


def test_a_socket_that_fails_is_a_lost_link(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as bridge:
        url = f"tcp://127.0.0.1:{bridge.getsockname()[1]}"
        with closing(open_link(url)) as link, monkeypatch.context() as patch:
            patch.setattr(os, "write", mock.Mock(side_effect=OSError(errno.EIO, "Input/output error")))
            with pytest.raises(LinkLost) as raised:
                link.write(b"@5e")
    why = "went away (input/output error): check the bridge's power and the network"
    assert str(raised.value) == f"{url} {why}"


def test_the_last_words_of_a_bridge_are_told_though_a_write_fails_first():
    with socket.create_server(("127.0.0.1", 0)) as bridge:
        link = open_link(f"tcp://127.0.0.1:{bridge.getsockname()[1]}")
        with closing(bridge.accept()[0]) as end:
            end.sendall(REASON + b"the cable is out\r\n")
        with closing(link), pytest.raises(
            LinkLost, match="the other end closed the connection: the cable is out$"
        ):
            wait_until(lambda: link.write(b"@5e"))


@pytest.mark.parametrize(
    "url, words",
    [
        ("udp://no-such-host.invalid:7", "name"),
        ("tcp://no-such-host.invalid:7", "name"),
        ("tcp://a..b:7", "label empty"),
    ],
)
def test_an_unknown_host_is_an_error_that_names_the_port(url, words):
    with pytest.raises(PortMissing, match=rf"^{url} cannot be opened \('.*': .*{words}.*\): check the name"):
        open_link(url)


@pytest.mark.parametrize(
    "given, kind, words",
    [
        ((errno.EIO, ""), LinkError, "input/output error): check the address and the network"),
        (("Odd",), LinkError, "odd): check the address and the network"),
        ((errno.EACCES, ""), PortDenied, "permission denied): check the address and the network"),
        ((errno.EPERM, ""), PortDenied, "operation not permitted): check the address and the network"),
        ((errno.ENETUNREACH, ""), PortMissing, "network is unreachable): check the network of this computer"),
    ],
)
def test_an_error_of_the_network_has_its_remedy_or_a_common_one(given, kind, words):
    told = explain("tcp://robot:7", OSError(*given))
    assert type(told) is kind and str(told) == f"tcp://robot:7 cannot be opened ({words}"


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
    come(client, listener)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as stranger:
        for _ in range(32):
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
