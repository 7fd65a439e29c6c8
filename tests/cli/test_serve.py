"""`mrl serve`: a board's serial port on the network."""

import contextlib
import signal
import subprocess
import threading
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import pytest

from mrl_driver.driver import Driver, Options, served_robot
from mrl_driver.driver.served_robot import ServedRobot
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, WrongRobot
from mrl_driver.session.handshake import Board
from mrl_driver.transport.listener import REASON, SILENT_S, listen
from mrl_driver.transport.open_link import open_link
from mrl_driver.transport.relay import STOP, STOP_2013, STOPS, Bridge
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard
from tests.driver.conftest import Cable
from tests.waiting import PATIENCE_S, drive_until, wait_until

from .run import fails
from .terminal import MRL

ADDRESS = "127.0.0.1:0"


class Served:
    """An emulated board behind a bridge, in threads of this process."""

    def __init__(self, port, scheme="tcp", **robot):
        self.told = []
        listener = listen(f"{scheme}://{ADDRESS}")
        self.url = str(listener.address)
        self.robot = ServedRobot(port, self.told.append, **robot)
        self._bridge = Bridge(self.robot.find, self.robot.lose, listener, self.told.append)
        self._thread = threading.Thread(target=self._bridge.run)
        self._thread.start()

    def told_of(self, words):
        return any(words in line for line in list(self.told))

    def close(self):
        self._bridge.stop()
        self._thread.join()


@pytest.fixture(params=["tcp", "udp"])
def served(request):
    with EmulatedBoard("square") as board:
        served = Served(board.port, request.param)
        served.board = board
        yield served
        served.close()


def test_a_driver_drives_through_it(served):
    with Driver(served.url) as robot:
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.02)


def test_the_robot_stops_when_its_client_is_gone(served):
    """The client ends without a word, and has set no watchdog on the board."""
    client = open_link(served.url)
    wait_until(lambda: client.write(b"@11,200,0e") or served.board.true_speed_m_s > 0.1, step_s=0.05)
    client.close()
    wait_until(lambda: served.board.true_speed_m_s == 0.0)
    wait_until(lambda: any("has left; the robot is stopped" in line for line in served.told))


@pytest.mark.parametrize("begin", [b"POST", b"GET", b"\x16\x03\x01\x02\x00\x01"])
def test_frames_in_a_request_of_a_browser_reach_no_board(begin):
    """A page of any site may have the browser send them to this computer; in TLS, in what a site had it keep."""
    listener = listen("tcp://127.0.0.1:0")
    with contextlib.closing(listener), contextlib.closing(open_link(str(listener.address))) as browser:
        wait_until(listener.attend)
        browser.write(begin + b" / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" + COMMAND)
        wait_until(lambda: listener.read() or not listener.client)
        assert not listener.client


@pytest.mark.parametrize(
    "silent_s, said", [(SILENT_S - 0.1, "is served; end that program first"), (SILENT_S, "")]
)
def test_only_a_silent_client_gives_up_its_place(monkeypatch, silent_s, said):
    now_s = [100.0]
    monkeypatch.setattr("mrl_driver.transport.listener.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    listener = listen(f"tcp://{ADDRESS}")
    with contextlib.closing(listener), contextlib.closing(open_link(str(listener.address))) as first:
        wait_until(listener.attend)
        now_s[0] += 10.0
        first.write(b"@5e")
        assert wait_until(listener.read) == b"@5e"
        held, now_s[0] = listener.client, now_s[0] + silent_s
        with contextlib.closing(open_link(str(listener.address))) as second:
            if said:
                with pytest.raises(LinkLost, match=f"the other end closed the connection: {held} {said}"):
                    wait_until(lambda: listener.attend() or (second.read(0.01) and False))
            else:
                wait_until(listener.attend)
            assert (listener.client == held) == bool(said)


@pytest.mark.parametrize("profile", ["current", "2013-august"])
def test_a_driver_that_only_watches_is_never_silent_for_so_long(profile):
    engine, sent_s = factory.make(factory.Options(robot="traxbot", profile=profile)).engine, []
    receive = engine.receive
    with SteppedDriver(engine) as robot:
        engine.receive = lambda data: (sent_s.append(robot.now_s), receive(data))
        robot.wait(10.0)
        assert max(later - sooner for sooner, later in zip(sent_s, sent_s[1:])) < SILENT_S - 0.5


def over(link, listener, tell=str):
    """A bridge over a link that is there."""
    link.port, link.close = "/dev/ttyACM0", str
    return Bridge(lambda: link, str, listener, tell)


def run(bridge):
    """Run the bridge without waiting; what its turns would wait for, and how long."""
    waits = []
    select = SimpleNamespace(select=lambda *given: waits.append(given))
    with mock.patch("mrl_driver.transport.relay.select", select):
        bridge.run()
    return waits


def test_a_client_that_turns_silent_while_its_first_command_is_sent_is_a_stop(monkeypatch):
    """As on a PC that is held up for longer than a UDP client may be silent."""
    listener, sent, turns, now_s = listen(f"udp://{ADDRESS}"), [], [], [100.0]
    monkeypatch.setattr("mrl_driver.transport.listener.time", SimpleNamespace(monotonic=lambda: now_s[0]))

    def read(timeout_s):
        turns.append(timeout_s)
        if len(turns) == 1:
            client.write(b"@11,200,0e")
        if len(turns) == 2:
            bridge.stop()
        return b""

    def write(data):
        sent.append(data)
        now_s[0] += SILENT_S

    bridge = over(SimpleNamespace(fileno=lambda: None, read=read, write=write), listener)
    client = open_link(str(listener.address))
    bridge.run()
    client.close()
    assert sent[:2] == [b"@11,200,0e", STOP] and set(turns) == {0}


@pytest.mark.parametrize(
    "said, stop",
    [(b"", STOP_2013), (b"@11,200,0e", STOP), (b"@11,200,0,1234e", STOP), (b"@65547,200,0e", STOP_2013)],
    ids=["nothing", "plain", "checked", "2013"],
)
def test_the_stop_at_the_end_goes_more_than_once(said, stop):
    """A 2013 board drops a stop that breaks off a frame which the client had begun, and has a form of its own."""
    sent = []
    link = SimpleNamespace(fileno=int, read=lambda timeout_s: b"", write=sent.append)
    listener = SimpleNamespace(watch=None, data=None, client="somebody", close=str, drop=str)
    bridge = over(link, listener)
    listener.read, listener.attend = lambda: said, bridge.stop
    run(bridge)
    assert b"".join(sent) == said + stop * b"".join(sent).count(stop) and b"".join(sent).count(stop) > 1


COMMAND = b"@11,200,0e"


def serve_a_client_that_leaves(sent, tell=str, refused=0, turns=20):
    """Its board gets `sent`; after the command, the port refuses some writes.  The bridge ends after so many turns;
    what they wait for comes back."""
    script = [(COMMAND, "somebody")] + (turns - 1) * [(b"", "")]
    refusals = refused * [BoardTimeout("the port has accepted no data for 100 ms")]

    def write(data):
        if data != COMMAND and refusals:
            raise refusals.pop()
        sent.append(data)

    def read():
        data, listener.client = script.pop(0)
        if not script:
            bridge.stop()
        return data

    link = SimpleNamespace(fileno=lambda: 7, read=lambda timeout_s: b"", write=write)
    listener = SimpleNamespace(watch=8, data=None, client="", read=read, attend=str, close=str, drop=str)
    bridge = over(link, listener, tell)
    return run(bridge)


def test_a_bridge_waits_for_bytes_but_looks_for_a_silent_client_and_repeats_a_stop():
    told = []
    waits = serve_a_client_that_leaves([], told.append, turns=6)
    assert waits == [([7, 8], [], [], wait_s) for wait_s in (0.5, 0.5, 0.05, 0.05, 0.5, 0.5)]
    left = "somebody has left; the robot is stopped"
    assert told == ["/dev/ttyACM0 answers", "somebody is served", left]


def test_the_stops_go_though_the_line_that_the_client_has_left_cannot_be_written():
    """As when the reader of stderr has ended."""
    sent = []
    serve_a_client_that_leaves(sent, tell=mock.Mock(side_effect=BrokenPipeError))
    assert sent == [COMMAND, *3 * [STOP]]


def test_no_stop_waits_for_a_line_that_blocks():
    """As when the terminal is stopped with Ctrl-S."""
    sent = []
    serve_a_client_that_leaves(sent, tell=lambda line: wait_until(lambda: len(sent) > STOPS))
    assert sent == [COMMAND, *STOPS * [STOP]]


def test_a_stop_that_the_port_refuses_does_not_count():
    sent, told = [], []
    serve_a_client_that_leaves(sent, told.append, refused=STOPS)
    assert sent == [COMMAND, *STOPS * [STOP]]
    assert [line for line in told if "port" in line] == ["the port has accepted no data for 100 ms"]


def test_the_stop_at_the_end_is_tried_again_if_the_port_refuses_it():
    sent = []
    serve_a_client_that_leaves(sent, refused=2, turns=1)
    assert sent == [COMMAND, STOP * STOPS]


def test_the_client_of_a_lost_board_is_told_and_sent_away():
    error, sent, done = LinkLost("port \xe9 went away"), [], []
    link = SimpleNamespace(
        fileno=int, read=mock.Mock(side_effect=error), port="/dev/ttyACM0", close=mock.Mock()
    )
    listener = mock.Mock(watch=None, data=None, client="somebody", write=sent.append)
    listener.read.return_value = b""
    listener.drop.side_effect = lambda: done.append(list(sent))
    links = [link, None]
    bridge = Bridge(lambda: links.pop(0) if links else bridge.stop(), done.append, listener, str)
    run(bridge)
    line = REASON + str(error).encode() + b"\r\n"
    assert done[:3] == [[], [line], error] and link.close.mock_calls == [mock.call()]
    assert listener.attend.called and listener.read.called


def test_a_bridge_whose_board_cannot_be_found_ends_with_the_reason():
    listener = mock.Mock(client="")
    with pytest.raises(WrongRobot, match="another robot"):
        Bridge(mock.Mock(side_effect=WrongRobot("another robot")), str, listener, str).run()
    assert listener.close.called


# -- a board that is not there, or not the one


@pytest.fixture
def cable(serve, tmp_path):
    """Robot 1 at a link that can be unplugged."""
    return Cable(serve, tmp_path / "robot")


@pytest.fixture
def away(cable):
    """The bridge of a robot that is not there yet."""
    cable.unplug()
    served = Served(cable.path, timeout_s=PATIENCE_S)
    yield served
    served.close()


def test_a_bridge_starts_before_its_board_is_there_and_tells_clients(away, cable):
    with pytest.raises(LinkLost, match="the other end closed the connection: the board was not found yet$"):
        Driver(away.url).connect()
    cable.plug()
    with Driver(away.url, options=Options(port_timeout_s=PATIENCE_S)) as robot:
        assert robot.board.robot_id == 1


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_the_same_robot_is_served_again_after_it_was_unplugged(prompt, cable, scheme):
    served = Served(cable.path, scheme)
    with contextlib.closing(served), Driver(served.url, options=Options(reconnect=True)) as robot:
        cable.unplug()
        wait_until(lambda: served.told_of("went away") and not robot.ready)
        cable.plug()
        wait_until(lambda: robot.ready)


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_a_client_never_drives_another_board_that_appears_there(cable, scheme):
    """It goes on to send its command, as one that does not look at the answers."""
    served = Served(cable.path, scheme)
    wait_until(lambda: served.told_of("answers"))
    cable.unplug()
    wait_until(lambda: served.told_of("went away"))
    cable.plug(robot_id=2)

    def is_refused():
        with contextlib.suppress(LinkError), contextlib.closing(open_link(served.url)) as client:
            client.write(COMMAND)
        return served.told_of("robot id 2 answers") and served.told_of(
            "expected 1: another robot is not served"
        )

    wait_until(is_refused, step_s=0.02)
    served.close()
    assert cable.port.board.moves == []


def test_what_a_client_sent_while_the_board_was_away_is_not_sent_to_it(cable):
    sent, listener = [], listen(f"udp://{ADDRESS}")
    with contextlib.closing(open_link(str(listener.address))) as client:
        client.write(COMMAND)
        link = SimpleNamespace(fileno=int, write=sent.append, read=lambda timeout_s: bridge.stop() or b"")
        bridge = over(link, listener)
        run(bridge)
    assert sent == []


def test_a_virtual_robot_is_not_served_in_place_of_the_real_one_of_before(cable, monkeypatch):
    boards = [Board(1, 2, 0.0, 12.0, 0.0, 2, frozenset(each)) for each in ((), ("virtual",))]
    monkeypatch.setattr(served_robot, "board_on", lambda link: boards.pop(0))
    told = []
    robot = ServedRobot(cable.path, told.append)
    robot.find().close()
    robot.lose(LinkLost("gone"))
    wait_until(lambda: robot.find() or told)
    assert "is a virtual one, expected a real one" in told[0]


def test_a_board_that_is_not_the_named_robot_is_not_served_at_the_start(cable):
    robot = ServedRobot(cable.path, str, robot_id=7)
    with pytest.raises(WrongRobot, match="robot id 1 answers .* expected 7: another robot is not served"):
        robot.find()


@pytest.mark.parametrize(
    ("url", "code", "words"),
    [
        ("tcp://:7000", 2, "expected tcp://HOST:PORT"),
        ("tcp://127.0.0.1", 2, "expected tcp://HOST:PORT"),
        ("rfc2217://127.0.0.1:7000", 2, "expected tcp://HOST:PORT or udp://HOST:PORT"),
        ("tcp://192.0.2.1:7000", 2, "not an address of this computer"),
    ],
)
def test_an_address_that_cannot_be_listened_on_is_refused(url, code, words):
    assert words in fails(code, "serve", "--port", "/dev/ttyACM0", "--listen", url, "--insecure")


@pytest.mark.parametrize("listen", ["udp://0.0.0.0:0", "tcp://10.0.0.7:7000"])
def test_an_address_beyond_this_computer_needs_a_word(listen):
    line = fails(2, "serve", "--port", "/dev/nowhere", "--listen", listen)
    assert "everybody on the network" in line and "a tunnel (ssh -L), or add --insecure" in line


def test_a_bridge_is_not_suspended(serve):
    """Ctrl-Z would leave its client without a stop."""
    command = [*MRL, "serve", "--port", serve().path, "--listen", f"tcp://{ADDRESS}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert "serves" in process.stdout.readline()
        (ignored,) = (
            line for line in Path(f"/proc/{process.pid}/status").read_text().splitlines() if "SigIgn" in line
        )
        process.terminate()
    assert int(ignored.split()[1], 16) >> (signal.SIGTSTP - 1) & 1


def test_a_client_is_told_while_a_silent_board_is_asked_for_its_id(monkeypatch):
    """That takes up to 8 s."""
    monkeypatch.setattr("mrl_driver.transport.relay.ANSWERS_S", 0.0)
    answers, listener, link, threads = threading.Event(), listen(f"tcp://{ADDRESS}"), mock.Mock(), []

    def find():
        threads.extend(threading.enumerate())
        return answers.wait(PATIENCE_S) and bridge.stop() or link

    bridge = Bridge(find, str, listener, str)
    serving = threading.Thread(target=bridge.run)
    serving.start()
    try:
        client = open_link(str(listener.address))
        with contextlib.closing(client), pytest.raises(LinkLost, match="the board was not found yet"):
            wait_until(lambda: client.read(0.1) and False)
        own = {each.name: each.daemon for each in threads if each.name in ("mrl-look", "teller")}
        assert own == {"mrl-look": True, "teller": True}  # no end of the program waits for them
    finally:
        answers.set()
        serving.join()
