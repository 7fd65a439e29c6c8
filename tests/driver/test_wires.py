"""Robots behind other wires than a cable: datagrams that get lost, come twice or late, and connections."""

import copy
import json
import math
import os
import re
import socket
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import pytest
from serial.urlhandler import protocol_loop

from mrl_driver.driver import Driver, Options
from mrl_driver.driver.link_source import LinkSource
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError, LinkError, LinkLost, NotARobot, PortMissing
from mrl_driver.protocol import encode_reply, encode_request
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.session.events import Lost, Ready, Slowed, Stale
from mrl_driver.transport import open_link as opening
from mrl_driver.transport.address import Address, is_network, parse, require_port, scheme_of
from mrl_driver.transport.baud_rates import require_raisable
from mrl_driver.transport.listener import REASON
from mrl_driver.transport.open_link import open_link, speed_up
from mrl_driver.transport.relay import STOP_2013
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard
from tests.network import own_network
from tests.waiting import PATIENCE, drive_until, wait_until

from .talk import Talk

DATAGRAMS = ("drop:rate=0.05", "repeat:rate=0.05", "overtake:rate=0.05,delay=0.06")
"""5 % of the datagrams are lost, 5 % come twice, 5 % are overtaken by up to three others; in both directions."""
POSE_ERROR_M, YAW_ERROR_RAD = 2e-4, 5e-4
WATCHDOG_S, LATE_S = 0.25, 0.05


class Watched:
    """A driver in simulated time on a board behind a wire with these faults, and what it told."""

    def __init__(self, *faults, **options):
        self.emulated = factory.make(factory.Options(robot="traxbot", world="square", faults=faults, seed=3))
        self.robot = SteppedDriver(self.emulated.board, options=Options(**options))
        self.robot.connect()
        self.begun_s = self.robot.now_s
        self.telemetry, self.events = [], []
        self.robot.on_telemetry(self.telemetry.append)
        self.robot.on_event(self.events.append)

    def close(self):
        self.robot.close()
        self.emulated.close()

    def commands(self, name):
        code = {"stop": 0xFC, "move": 0xEB}[name]
        return [each.time_s for each in self.emulated.plant.motor_board.commands if each.code == code]


@pytest.fixture(scope="module")
def driven():
    """A robot that drove, turned and stopped eight times over bad datagrams."""
    watched = Watched(*DATAGRAMS)
    for _ in range(8):
        watched.robot.drive(0.2, 0.0)
        watched.robot.wait(2.0)
        watched.robot.drive(0.1, 0.6)
        watched.robot.wait(1.5)
        watched.robot.stop()
        watched.robot.wait(0.7)
    yield watched
    watched.close()


def test_the_pose_over_bad_datagrams_is_the_true_one(driven):
    """The wheels only turned forwards: counters and stamps never run backwards."""
    pose, true = driven.robot.pose, driven.emulated.plant.true_pose
    assert math.hypot(pose.x_m - true.x_m, pose.y_m - true.y_m) < POSE_ERROR_M
    assert abs(math.remainder(pose.yaw_rad - true.yaw_rad, 2 * math.pi)) < YAW_ERROR_RAD
    pairs = list(zip(driven.telemetry, driven.telemetry[1:]))
    assert len(pairs) > 100
    assert all(b.counts.left >= a.counts.left and b.counts.right >= a.counts.right for a, b in pairs)
    assert all(b.stamp_s > a.stamp_s for a, b in pairs)
    seen = driven.robot.link.statistics
    assert min(seen.lost, seen.duplicates, seen.overtaken) > 30
    assert (seen.garbage, seen.refused_counts, seen.restarts) == ({}, 0, 0)


def test_the_robot_stops_within_the_watchdog_when_datagrams_cease():
    watched = Watched("drop:rate=1,at=3", *DATAGRAMS, command_timeout_s=None)
    watched.robot.drive(0.3, 0.0)
    watched.robot.wait(4.0 - watched.robot.now_s)
    stopped_s = next(time_s for time_s in watched.commands("stop") if time_s > 2.9)
    assert stopped_s < 3.0 + WATCHDOG_S + LATE_S
    assert any(isinstance(event, Stale) for event in watched.events)
    watched.close()


def test_a_board_that_was_out_of_reach_has_not_restarted():
    """After 2 s of silence it speaks without check value, as one that has restarted does; its uptime goes on."""
    watched = Watched("drop:rate=1,at=5,lasts=3")
    watched.robot.wait(9.0 - watched.robot.now_s)
    assert [event.restarted for event in watched.events if isinstance(event, Ready)] == [False]
    watched.close()


def test_an_overtaken_status_is_no_restart():
    """Its uptime is smaller than the one that came before."""
    talk = Talk().until_ready().run(3.0)
    late = []

    def hold(data):
        if b"@%d," % BY_NAME["read_status"].code in data and not late:
            late.append(data)
            return b""
        return data

    talk.to_host = hold
    talk.run(1.2)
    talk.to_host = lambda data: data
    talk.events += talk.session.receive(late[0], talk.now)
    assert talk.session.ready and talk.session.counters.restarts == 0


@pytest.mark.parametrize(("baud", "rate_hz"), [(9600, 13.3), (19200, 26.3)])
def test_a_slow_line_is_never_full(baud, rate_hz):
    """A program that commands 100 times a second neither delays telemetry nor its stop, nor ends its command."""
    watched = Watched(f"split:size=1,gap={10 / baud}", line_baud=baud)
    for i in range(300):
        watched.robot.drive(0.2 + 0.001 * (i % 5), 0.0)
        assert watched.robot.command is not None
        watched.robot.wait(0.01)
    begun_s, byte_s = watched.robot.now_s, 10 / baud
    watched.robot.stop()
    watched.robot.wait(0.3)
    stopped_s = next(time_s for time_s in watched.commands("stop") if time_s > begun_s)
    assert stopped_s - begun_s < 50 * byte_s
    assert max(each.arrival_s - each.stamp_s for each in watched.telemetry) < 100 * byte_s
    assert len(watched.telemetry) / (watched.robot.now_s - watched.begun_s) == pytest.approx(
        rate_hz, rel=0.05
    )
    watched.close()


def test_the_line_is_raised_and_left_as_it_was(monkeypatch):
    """A held-up host may prove it late; the board itself waits 1 s, and is asked again if that was not enough."""
    monkeypatch.setattr(opening, "PROOF_S", 0.9)

    def is_raised():
        with Driver(board.port, options=Options(fast=True)) as robot:
            if robot.link.baud != 500000:
                return False
            # a held-up host asks twice, and one answer may come at the wrong rate
            at_change = dict(robot.link.statistics.garbage)
            drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.02)
            assert robot.link.statistics.garbage == at_change and robot.link.baud == 500000
            return True

    with EmulatedBoard("square") as board:
        wait_until(is_raised)
        with Driver(board.port) as usual:
            assert usual.ready and usual.link.baud == 115200


def test_a_raised_line_that_fails_goes_back():
    """Bytes turn into others until the driver gives the speed up; the robot is then found at the usual one."""
    with EmulatedBoard("square") as board, Driver(board.port, options=Options(fast=True)) as robot:
        heard = []
        robot.on_event(heard.append)
        board.faults.inject("baud:rate=57600")
        wait_until(lambda: any(isinstance(event, Slowed) for event in heard))
        board.faults.clear()
        wait_until(lambda: robot.drive(0.1, 0.0))
        assert robot.link.baud == 115200
        assert [str(event) for event in heard if isinstance(event, Slowed)] == [
            "the line shows errors at its higher speed and goes back to 115200 baud"
        ]


def test_a_port_is_tried_again_until_its_time_is_over(monkeypatch):
    now_s, open_port = [5.0], mock.Mock(side_effect=LinkError("it is denied"))
    monkeypatch.setattr(opening, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    first, now_s[0] = opening.Opening(open_port, 2.0), 6.9
    assert first.attempt() is None and first.reason == "it is denied"
    now_s[0] = 7.0
    with pytest.raises(LinkError, match="it is denied"):
        first.attempt()


@pytest.mark.parametrize(
    "port, baud, words",
    [
        ("tcp://a:1", 115200, "port tcp://a:1, expected a device"),
        (7, 115200, "port 7, expected a device"),
        ("/dev/ttyACM0", 9600, "baud 9600, expected 115200"),
    ],
)
def test_only_a_device_at_115200_baud_can_be_raised(port, baud, words):
    with pytest.raises(ConfigError, match=f"fast is given with {words}"):
        require_raisable(port, baud)


class Frames:
    """A session that is ready, and counts frames and damages."""

    def __init__(self):
        self.ready, self.counters = True, SimpleNamespace(frames=0, garbage={"noise": 0})

    def hear(self, frames, damaged=0):
        self.counters.frames += frames
        self.counters.garbage["noise"] += damaged


def test_hours_with_a_few_damages_each_minute_do_not_hide_a_raised_line_that_fails():
    links, heard = LinkSource("/dev/none", 115200, Options()), Frames()
    for minute in range(400):
        assert not links.is_failing(heard, 0.0)
        heard.hear(3000, damaged=20 if minute < 100 else 0)
    assert not links.is_failing(heard, 0.0)
    heard.hear(10, damaged=21)
    assert links.is_failing(heard, 0.0)


def test_a_stop_goes_before_all_else(serve):
    """A 2013 board drives on until it gets one."""
    board = serve()
    with Driver(board.path, options=Options(fast=True)):
        assert board.received.startswith(STOP_2013)


@pytest.fixture(params=["tcp", "udp"])
def scheme(request):
    return request.param


def test_a_robot_drives_over_a_socket(scheme):
    with EmulatedBoard("square", listen=f"{scheme}://127.0.0.1:0") as board, Driver(board.port) as robot:
        drive_until(robot, 0.2, 0.0, lambda: board.true_pose.x_m > 0.02)
        robot.stop()
        board.wait_until(lambda: robot.stopped)
        assert robot.pose.x_m == pytest.approx(board.true_pose.x_m, abs=POSE_ERROR_M)


def test_a_board_that_returns_to_its_address_is_found(scheme):
    with EmulatedBoard("square", listen=f"{scheme}://127.0.0.1:0") as board:
        heard = []
        with Driver(board.port, options=Options(reconnect=True)) as robot:
            robot.on_event(heard.append)
            board.faults.unplug()
            wait_until(lambda: any(isinstance(event, (Lost, Stale)) for event in heard))
            board.faults.plug()
            wait_until(lambda: robot.ready)
            wait_until(lambda: robot.drive(0.2, 0.0) and board.true_speed_m_s > 0.1)


def test_a_second_program_is_turned_away():
    with EmulatedBoard("square", listen="tcp://127.0.0.1:0") as board, Driver(board.port) as robot:
        with pytest.raises(LinkLost, match=r"127.0.0.1:\d+ is served; end that program first"):
            Driver(board.port).connect()
        assert robot.ready


def test_a_url_of_pyserial_brings_back_what_was_sent():
    link = open_link("loop://")
    link.set_baud(57600)
    link.write(b"@5e")
    assert link.read(1.0) == b"@5e"
    with pytest.raises(LinkLost, match="invalid baudrate: 0"):
        link.set_baud(0)
    link.close()
    with pytest.raises(LinkLost, match="loop:// is closed"):
        link.write(b"@5e")


@pytest.mark.parametrize(
    "url, error, words",
    [
        ("loop://?speed=1", LinkError, "pyserial does not take it .*check the URL"),
        ("spy:///nowhere/port", PortMissing, "cannot be opened .*check the address and what is there"),
    ],
)
def test_what_pyserial_does_not_open_is_told(url, error, words):
    with pytest.raises(error, match=words):
        open_link(url)


@pytest.mark.parametrize(
    "use, words",
    [
        (lambda link: link.read(10.0), r"went away \((?!hung up).*: check the cable"),
        (lambda link: link.write(b"@5e"), "went away .*write failed.*: check the cable"),
    ],
    ids=["read", "write"],
)
def test_a_device_that_pyserial_lost_says_why(tmp_path, use, words):
    device, port = os.openpty()
    with closing(open_link(f"spy://{os.ttyname(port)}?file={tmp_path / 'spy.txt'}")) as link:
        os.close(port)
        os.close(device)
        with pytest.raises(LinkLost, match=words):
            while True:
                use(link)


def test_a_write_of_pyserial_in_a_signal_handler_does_not_wait_for_the_write_that_it_interrupts(monkeypatch):
    with closing(open_link("loop://")) as link:
        write, handlers = protocol_loop.Serial.write, [lambda: link.write(b"@13e")]

        def interrupted(port, data):
            if handlers:
                handlers.pop()()
            return write(port, data)

        monkeypatch.setattr(protocol_loop.Serial, "write", interrupted)
        link.write(b"@5e")
        wait_until(lambda: link.read(1.0).endswith(b"@5e"))


@pytest.mark.parametrize(
    "url, size", [("{tty}", 20), (f"spy://{{tty}}?file={os.devnull}", 20), ("tcp://127.0.0.1:{port}", 24)]
)
def test_a_port_that_takes_no_bytes_is_a_timeout(url, size):
    """It is not lost: it may take bytes again."""
    master, slave = os.openpty()
    with socket.create_server(("127.0.0.1", 0)) as listening:
        url = url.format(tty=os.ttyname(slave), port=listening.getsockname()[1])
        link = open_link(url)
        with closing(link), pytest.raises(BoardTimeout, match=f"^{re.escape(url)} has accepted .* 100 ms"):
            link.write(bytes(1 << size))
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize(
    "url",
    ["tcp://", "tcp://host", "tcp://host:x", "tcp://host:0", "tcp://host:70000", "tcp://[::1:7", "tcp://host:7#x",
     "tcp://me@host:7", "tcp://host:7/x", "tcp://host:7/://", "tcp://host:7?bind=host:7",
     "udp://host:7?bind=a:1&bnd=1", "udp://host:7?bnd=1", "udp://host:7?bind=", "rfc2217://", "rfc2217://host",
     "rfc2217://host:0", "spy://", "ftp://host:7", "udp://host:7?bind=a:x"],
)  # fmt: skip
def test_a_url_that_does_not_parse_is_refused_before_it_is_opened(url):
    words = r"(:.*| names nothing| does not parse( \(.+\))?), expected (\w+://HOST|a device|nothing behind)"
    with pytest.raises(ConfigError, match=f"^port {re.escape(repr(url))}{words}"):
        Driver(url)


@pytest.mark.parametrize(
    "url, address",
    [
        ("TCP://robot:7/", Address("tcp", "robot", 7)),
        ("udp://[fe80::2]:7", Address("udp", "fe80::2", 7)),
        ("udp://robot:7?bind=10.0.0.1:9", Address("udp", "robot", 7, ("10.0.0.1", 9))),
        ("udp://robot:7?bind=10.0.0.1", Address("udp", "robot", 7, ("10.0.0.1", 0))),
    ],
)
def test_an_address_is_what_its_url_says(url, address):
    assert parse(url) == address and is_network(url)
    assert str(address) == url.lower().rstrip("/").partition("?")[0]


@pytest.mark.parametrize(
    "url", ["loop://", "spy:///dev/ttyACM0?file=x", "spy://loop://", "rfc2217://robot:7"]
)
def test_a_url_for_pyserial_is_no_network_address(url):
    require_port(url)
    assert not is_network(url) and scheme_of(url) == url.partition(":")[0]
    with pytest.raises(ConfigError, match="is not a network address"):
        parse(url)


@pytest.mark.parametrize(
    "scheme, kind, error",
    [("tcp", socket.SOCK_STREAM, PortMissing), ("udp", socket.SOCK_DGRAM, LinkLost)],
    ids=["tcp", "udp"],
)
def test_a_refused_connection_says_what_to_do(scheme, kind, error):
    with closing(socket.socket(type=kind)) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        if scheme == "udp":  # it would take datagrams
            free.close()
        with pytest.raises(error, match=r"connection refused\): nothing listens there"):
            Driver(f"{scheme}://127.0.0.1:{port}").connect()


def test_a_host_that_does_not_answer_is_given_up():
    """The listening queue is full, so the connection is neither taken nor refused."""
    with closing(socket.socket()) as deaf, closing(socket.socket()) as first, closing(
        socket.socket()
    ) as second:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen(0)
        for end in (first, second):
            end.setblocking(False)
            end.connect_ex(deaf.getsockname())
        start_s = time.monotonic()
        with pytest.raises(PortMissing, match="timed out.: check the address, the bridge's power"):
            open_link(f"tcp://127.0.0.1:{deaf.getsockname()[1]}", patience_s=0.2)
        assert time.monotonic() - start_s > 0.15


class Peer:
    """Another program that listens: it says `greeting`, and closes if told so."""

    def __init__(self, greeting, hang_up):
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._listening.getsockname()[1]}"
        self._greeting, self._hang_up, self._end = greeting, hang_up, None
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        self._end, _ = self._listening.accept()
        self._end.sendall(self._greeting)
        if self._hang_up:
            self._end.close()

    def close(self):
        self._listening.close()
        if self._end is not None:
            self._end.close()


HTTP = b"HTTP/1.1 400 Bad Request\r\n\r\n"


@pytest.mark.parametrize(
    "greeting, hangs_up, error, words",
    [
        (b"SSH-2.0-OpenSSH_9.2p1\r\n", False, NotARobot, "SSH-2.0"),
        (HTTP, True, LinkLost, "sent b'HTTP/1.1 400 Bad Request' and closed .* another service"),
        (REASON + b"no \xe9\r\n", True, LinkLost, "the other end closed the connection: no \ufffd$"),
        (b"@5,1e", True, LinkLost, "the other end closed the connection; it may serve another program"),
        (b"", True, LinkLost, "the other end closed the connection|reset by peer"),
    ],
    ids=["speaks", "hangs up after that", "says why", "is a robot", "hangs up"],
)
def test_a_peer_that_is_no_robot_is_told(greeting, hangs_up, error, words):
    with closing(Peer(greeting, hangs_up)) as peer, pytest.raises(error, match=words):
        if greeting and hangs_up:
            with closing(open_link(peer.url)) as link:
                while link.read(10.0):
                    pass
        Driver(peer.url, options=Options(greeting_s=0.3)).connect()


ROOT = Path(__file__).resolve().parents[2]
LONGEST_S = 110 * PATIENCE
ACROSS_HOSTS_M = 1e-3


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the trials of `two_hosts` have seen."""
    command = [*own_network(), sys.executable, "-m", "tests.driver.two_hosts"]
    folder = tmp_path_factory.mktemp("hosts")
    done = subprocess.run(
        [*command, str(folder)], cwd=str(ROOT), capture_output=True, text=True, timeout=LONGEST_S
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_the_pose_is_the_true_one(seen, scheme):
    assert seen[scheme]["error_m"] < ACROSS_HOSTS_M


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_the_robot_stands_when_the_cable_is_pulled_and_drives_when_it_is_back(seen, scheme):
    assert seen[scheme]["rolled_m"] == 0.0
    assert seen[scheme]["again_m"] > 0.0


WHO, RAISE, NAME, *ENDS = (
    BY_NAME[name].code for name in ("read_protocol", "set_baud", "robot_info", "stop", "stop_stream")
)
OLD_QUIET, QUIET = (b"".join(encode_request(each, wrapped=old) for each in ENDS) for old in (True, False))
ASK, ASK_OLD, TRY = encode_request(WHO), encode_request(NAME, wrapped=True), encode_request(RAISE, 2)
GREETED = [OLD_QUIET, ASK, QUIET]
PROVEN = [*GREETED, TRY, 500000, 0.02, *20 * [TRY]]


class Wire:
    """A link in injected time; `replies` has the fields of the replies to a code, and None takes no bytes."""

    def __init__(self, monkeypatch, replies):
        self.now_s, self.done, self.replies, self.waiting = 0.0, [], copy.deepcopy(replies), b""
        time = SimpleNamespace(monotonic=lambda: self.now_s, sleep=self.sleep)
        monkeypatch.setattr(opening, "time", time)
        self.set_baud = self.done.append

    def sleep(self, time_s):
        self.now_s += time_s
        self.done.append(time_s)

    def write(self, data):
        self.done.append(data)
        if self.replies is None:
            self.now_s += 0.125
            raise BoardTimeout("the port has accepted no data")
        code = {ASK: WHO, ASK_OLD: NAME, TRY: RAISE}.get(data)
        fields = self.replies.get(code)
        self.waiting = encode_reply(6, 1, 2) + encode_reply(code, *fields.pop()) if fields else b""

    def read(self, timeout_s):
        waiting, self.waiting = self.waiting, b""
        self.now_s += 0.0 if waiting else timeout_s
        return waiting


@pytest.mark.parametrize(
    "replies, done, took_s",
    [
        ({NAME: [(2500, 172, 1200, 1, 1)]}, [OLD_QUIET, ASK, ASK_OLD], 0.25),
        ({}, 6 * [OLD_QUIET, ASK, ASK_OLD], 3.0),
        (None, 8 * [OLD_QUIET, ASK, ASK_OLD], 3.0),
        ({WHO: [(256, 255 + 512)]}, GREETED, 0.0),
        ({WHO: [(2, 256)], RAISE: [(0,)]}, [*GREETED, TRY, 1.1], 1.1),
        ({WHO: [(2, 256)], RAISE: 20 * [(2,)]}, [*PROVEN, 115200, 1.1], 1.22),
        ({WHO: [(2, 256)], RAISE: 21 * [(2,)]}, PROVEN, 0.02),
    ],
    ids=["of 2013", "silent", "takes nothing", "not able", "refuses", "fails at last", "is raised"],
)
def test_a_line_is_raised_if_twenty_answers_in_a_row_prove_it(monkeypatch, replies, done, took_s):
    link = Wire(monkeypatch, replies)
    assert speed_up(link) is (done[-1] == TRY)
    assert link.done == done and link.now_s == pytest.approx(took_s)
