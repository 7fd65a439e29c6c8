"""`mrl serve` on a network: encrypted, with a token, and every way to get it wrong."""

import contextlib
import json
import os
import re
import socket
import ssl
import stat
import threading
from types import SimpleNamespace

import pytest

from mrl_driver.cli import main
from mrl_driver.driver import Driver, Options
from mrl_driver.errors import ConfigError, LinkError, LinkLost, PortBusy, PortDenied, PortMissing
from mrl_driver.host import access, certificate, named_robots
from mrl_driver.session.events import Lost, Reconnected
from mrl_driver.transport import tls_listener
from mrl_driver.transport.address import masked, parse
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.open_link import open_link
from mrl_driver.transport.relay import STOP, Bridge
from sim_arduino.testing import EmulatedBoard
from tests.waiting import PATIENCE_S, wait_until

from .encrypted import TOKEN, encrypted, link_of
from .run import fails, mrl

SHA256 = "ab" * 32


class Echo:
    """A bridge whose board sends back what it gets, but for stops, which are counted."""

    def __init__(self, tell=None):
        self.told, self.asked, self.received, self.stops = [], [], b"", 0
        tell = tell or self.told.append
        self.listener, self.url = encrypted(tell, asked=self.asked)
        out, into = socket.socketpair()
        for end in (out, into):
            end.setblocking(False)

        def read(timeout_s):
            with contextlib.suppress(BlockingIOError):
                return out.recv(4096)
            return b""

        def write(data):
            if data == STOP:
                self.stops += 1
            else:
                self.received += data
                into.send(data)

        self._ends = out, into
        self.bridge = Bridge(SimpleNamespace(fileno=out.fileno, read=read, write=write), self.listener, tell)
        self._thread = threading.Thread(target=self.bridge.run)
        self._thread.start()

    def close(self):
        self.bridge.stop()
        self._thread.join()
        for end in self._ends:
            end.close()


@pytest.fixture(scope="module")
def _home(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("config")))
        yield os.environ["XDG_CONFIG_HOME"]


@pytest.fixture(scope="module")
def echoing(_home):
    echo = Echo()
    yield echo
    echo.close()


@pytest.fixture
def echo(echoing, _home, monkeypatch):
    """The bridge, without a client, with its own certificate in the user's folder."""
    monkeypatch.setenv("XDG_CONFIG_HOME", _home)
    monkeypatch.setattr(tls_listener, "TELL_S", 0.0)
    wait_until(lambda: not echoing.listener.client)
    echoing.told.clear()
    echoing.asked.clear()
    return echoing


def received(link, size):
    data = b""
    while len(data) < size:
        data += link.read(PATIENCE_S)
    return data


# -- the bytes


def test_bytes_pass_unchanged_in_both_directions(echo):
    sent = b"".join(b"@%d,%de\r\n" % (n, n * n) for n in range(2000))
    with contextlib.closing(open_link(echo.url)) as link:
        back = b""
        for at in range(0, len(sent), 500):
            link.write(sent[at : at + 500])
            back += received(link, len(sent[at : at + 500]))
    assert back == sent


def test_a_second_client_is_told_that_there_is_one(echo):
    with contextlib.closing(open_link(echo.url)), pytest.raises(PortBusy, match="in use by another program"):
        open_link(echo.url)


def test_the_board_is_stopped_when_the_client_leaves(echo):
    with contextlib.closing(open_link(echo.url)):
        before = echo.stops
    wait_until(lambda: echo.stops > before)


def test_a_client_that_takes_leave_is_gone_though_its_connection_is_open(echo):
    """As other programs end TLS: with an alert, and then with the connection."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    end = context.wrap_socket(socket.create_connection(("127.0.0.1", echo.listener.address.port), PATIENCE_S))
    end.sendall(b"MRL1 " + TOKEN.encode() + b"\n")
    assert end.recv(100) == b"accepted\n"
    before = echo.stops
    end.settimeout(0.1)
    with contextlib.suppress(OSError):  # the alert is sent; the bridge closes the connection without one
        end.unwrap()
    wait_until(lambda: echo.stops > before)
    end.close()
    open_link(echo.url).close()


# -- wrong clients


def test_a_wrong_token_is_refused_before_a_byte_reaches_the_board(echo):
    before = echo.received
    with pytest.raises(PortDenied, match="refuses the token: use the link that `mrl serve` prints now"):
        open_link(link_of(echo.listener.address, "f" * 32))
    assert echo.received == before
    wait_until(lambda: any("was refused: wrong token" in line for line in echo.told))


def test_a_wrong_token_holds_up_no_client_though_its_line_blocks(_home, monkeypatch):
    """As when the terminal is stopped with Ctrl-S."""
    monkeypatch.setenv("XDG_CONFIG_HOME", _home)
    served = threading.Event()
    with contextlib.closing(Echo(tell=lambda line: served.wait(PATIENCE_S))) as echo:
        with pytest.raises(PortDenied):
            open_link(link_of(echo.listener.address, "f" * 32))
        with contextlib.closing(open_link(echo.url)):
            served.set()


@pytest.mark.parametrize("said", [b"@11,200,0e\n", b"MRL1\n", b"MRL2 ", b"x" * 300])
def test_a_client_that_shows_no_token_is_refused(echo, monkeypatch, said):
    before = echo.received
    monkeypatch.setattr("mrl_driver.transport.tls_link.GREETING", said)
    with pytest.raises(PortDenied):
        open_link(echo.url)
    assert echo.received == before


def test_another_certificate_gets_no_token(echo):
    with pytest.raises(LinkError, match="has another certificate"):
        open_link(link_of(echo.listener.address, sha256=SHA256))
    assert echo.asked == []


def test_a_client_without_tls_is_told_to_use_the_link(echo):
    with contextlib.closing(open_link(f"tcp://127.0.0.1:{echo.listener.address.port}")) as link:
        link.write(b"@5e")
        with pytest.raises(LinkLost, match="the other end speaks TLS: use the link that `mrl serve` printed"):
            received(link, 1000)


@pytest.mark.parametrize(
    ("answer", "why"),
    [(b"@5,1,2,3,4,5e\r\n", "no TLS: wrong version number"), (b"", "no answer by TLS in time")],
)
def test_a_link_to_a_port_that_does_not_encrypt_says_what_to_do(answer, why):
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as server:
        if answer:
            threading.Thread(target=lambda: server.accept()[0].sendall(answer)).start()
        with pytest.raises(PortMissing, match=f"{why}.*use tcp://HOST:PORT"):
            open_link(
                link_of(parse(f"tcp://127.0.0.1:{server.getsockname()[1]}"), sha256=SHA256), patience_s=0.5
            )


def test_connections_that_never_show_a_token_do_not_keep_others_out(echo):
    port = echo.listener.address.port
    silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(tls_listener.MOST_CALLERS + 2)]
    with contextlib.closing(open_link(echo.url)) as link:
        link.write(b"@5e")
        assert received(link, 3) == b"@5e"
    silent[0].settimeout(tls_listener.ENTER_S / 2)
    assert silent[0].recv(1) == b""  # the oldest made room
    for end in silent:
        end.close()


def test_a_connection_that_is_silent_for_too_long_is_closed(monkeypatch):
    now_s = [0.0]
    monkeypatch.setattr(tls_listener, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    listener, _ = encrypted(str)
    silent = socket.create_connection(("127.0.0.1", listener.address.port))
    listener.attend()
    now_s[0] = tls_listener.ENTER_S
    listener.attend()
    assert silent.recv(1) == b""
    silent.close()
    listener.close()


# -- the link as a port


def test_an_incomplete_link_is_refused_without_its_token():
    ends = (
        "10.0.0.7:7000",
        "10.0.0.7:7000?sha256=12",
        f"10.0.0.7?sha256={SHA256}",
        f"[10.0.0.7:7000?sha256={SHA256}",
    )
    ends += (f"10.0.0.7:99999?sha256={SHA256}", f"10.0.0.7:7000?sha256={SHA256}&x=1")
    links = [f"tls://{TOKEN}@{end}" for end in ends]
    links += ["tls://10.0.0.7:7000", f"tls://***@{ends[0]}", f"tls://{TOKEN}:x@10.0.0.7:7000?sha256={SHA256}"]
    for link in links:
        with pytest.raises(
            ConfigError, match="expected the link that `mrl serve` printed: tls://"
        ) as refused:
            parse(link)
        assert TOKEN not in str(refused.value)


def test_a_token_in_another_url_is_not_shown():
    assert TOKEN not in fails(2, "info", "--port", f"tcp://{TOKEN}@10.0.0.7:7000")
    assert TOKEN not in fails(2, "info", "--port", f"foo://{TOKEN}@10.0.0.7:7000")


def test_a_masked_link_opens_and_shows_no_token(echo):
    port = masked(echo.url)
    assert str(port) == f"tls://***@127.0.0.1:{echo.listener.address.port}"
    open_link(port).close()


def test_a_named_link_is_stored_for_its_user_alone_and_never_shown():
    link = f"tls://{TOKEN}@10.0.0.7:7000?sha256={SHA256}"
    said = mrl("names", "add", "lab3", "--port", link).stdout + mrl("names").stdout
    said += mrl("names", "--json").stdout
    assert said.count("tls://***@10.0.0.7:7000") == 3 and TOKEN not in said
    assert named_robots.read()["lab3"].port == link
    assert stat.S_IMODE(os.stat(named_robots.path()).st_mode) == 0o600


# -- a driver


class Served:
    """An emulated board behind a bridge; `restart` begins with another bridge on the same port."""

    def __init__(self):
        self.told, self.board = [], EmulatedBoard("square")
        self._begin(0)

    def _begin(self, port):
        self.link = SerialLink(self.board.port)
        self.listener, self.url = encrypted(self.told.append, port)
        self.bridge = Bridge(self.link, self.listener, self.told.append)
        self._thread = threading.Thread(target=self.bridge.run)
        self._thread.start()

    def _end(self):
        self.bridge.stop()
        self._thread.join()
        self.link.close()

    def restart(self):
        self._end()
        self._begin(self.listener.address.port)

    def close(self):
        self._end()
        self.board.close()


@pytest.fixture(scope="module")
def journey(_home, tmp_path_factory):
    """A driver whose bridge was started again: its events, its recording, what the bridge said."""
    path, events = str(tmp_path_factory.mktemp("tls") / "drive.mrl"), []
    served = Served()
    try:
        with Driver(served.url, options=Options(record=path, reconnect=True)) as robot:
            robot.on_event(events.append)
            served.restart()
            wait_until(lambda: any(isinstance(event, Reconnected) for event in events) and robot.ready)
            robot_id = robot.board.robot_id
    finally:
        served.close()
    with open(path, encoding="ascii") as file:
        return SimpleNamespace(events=events, recording=file.read(), told=served.told, robot_id=robot_id)


def test_a_driver_finds_a_bridge_that_was_started_again(journey):
    found = [type(event) for event in journey.events if isinstance(event, (Lost, Reconnected))]
    assert found == [Lost, Reconnected] and journey.robot_id == 1


def test_the_token_is_in_no_event_no_recording_and_no_message(journey):
    assert "tls://***@127.0.0.1:" in journey.recording
    for text in (*map(str, journey.events), *map(repr, journey.events), journey.recording, *journey.told):
        assert TOKEN not in text


# -- the command


@pytest.fixture
def command():
    """`mrl serve` on all addresses: the first link that it prints, with the address of this computer alone."""
    board, (output, other) = EmulatedBoard("square"), os.pipe()

    def run():
        with contextlib.suppress(LinkLost):
            main.cli.main(
                ["serve", "--port", board.port, "--listen", "tcp://0.0.0.0:0"], standalone_mode=False
            )

    with os.fdopen(other, "w", buffering=1) as stdout, contextlib.redirect_stdout(stdout):
        thread = threading.Thread(target=run)
        thread.start()
        with os.fdopen(output) as said:
            link, words = said.readline().split(" ", 1)
            yield re.sub(r"@.*:(\d+)\?", r"@127.0.0.1:\1?", link), words
            board.close()
            thread.join()


def test_beyond_this_computer_the_command_encrypts_and_prints_a_link(command):
    link, words = command
    assert parse(link).token == access.tokens().drive and parse(link).sha256 == certificate.fingerprint()
    assert "everybody who has this link can drive the robot" in words
    assert json.loads(mrl("info", "--port", link, "--json").stdout)["port"].startswith("tls://***@")
    with pytest.raises(PortDenied, match="a watch-only token does not drive"):
        open_link(link.replace(access.tokens().drive, access.tokens().watch))


@pytest.mark.parametrize("listen", ["udp://0.0.0.0:0", "udp://10.0.0.7:7000"])
def test_udp_beyond_this_computer_needs_a_word(listen):
    line = fails(2, "serve", "--port", "/dev/nowhere", "--listen", listen)
    assert f"use tls{listen[3:]}, or add --insecure" in line


@pytest.mark.parametrize("listen", ["udp://0.0.0.0:0", "tcp://0.0.0.0:0"])
def test_that_word_allows_it(listen):
    assert "does not exist" in fails(3, "serve", "--port", "/dev/nowhere", "--listen", listen, "--insecure")


def test_that_word_contradicts_tls():
    line = fails(2, "serve", "--port", "/dev/nowhere", "--listen", "tls://127.0.0.1:0", "--insecure")
    assert "--insecure is given with tls://127.0.0.1:0" in line


def test_new_tokens_are_made_on_request():
    before = access.tokens()
    fails(3, "serve", "--port", "/dev/nowhere", "--listen", "tls://127.0.0.1:0", "--new-tokens")
    assert not set(before) & set(access.tokens())


def test_an_emulated_board_is_not_encrypted():
    from mrl_driver.transport.listener import listen

    with pytest.raises(ConfigError, match="only mrl serve speaks tls://"):
        listen("tls://127.0.0.1:0")
