"""`mrl-sim` as a process: faults at the start, by the clock and on stdin, its end, and how fast bytes pass."""

import os
import select

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.protocol import encode_reply, encode_request
from mrl_driver.robot.inputs import READ_INPUTS
from sim_arduino.board import PythonBoard
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory
from sim_arduino.serve.control import Control, obey
from sim_arduino.serve.main import emulated
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import CLOSE_WAIT_S, PtyServer
from sim_arduino.serve.socket_port import MOST_WAITING, read_all
from tests.models import WITH_INPUTS, bridged, model
from tests.waiting import PATIENCE_S, require_median

from .simulator import Client, Simulator
from .test_faults import Echo


def hangs_up(client):
    poll = select.poll()
    poll.register(client.fd, 0)
    return bool(poll.poll(1000 * PATIENCE_S))


def test_an_unplugged_port_hangs_up_and_returns_under_another_name(tmp_path):
    link = tmp_path / "ttyTRAX0"
    with Simulator("--control", "--link", str(link)) as simulator:
        with Client(str(link)) as client:
            client.ask(b"@15e")
            simulator.order("unplug")
            assert hangs_up(client)
            assert not os.path.lexists(link)
            simulator.order("plug")
            path = simulator.process.stdout.readline().strip()
        assert path != simulator.path
        assert os.readlink(link) == path
        with Client(str(link)) as client:
            assert client.ask(b"@15e") == b"@15,0e\r\n"


def test_a_wrong_order_is_answered_in_one_line_and_changes_nothing():
    with Simulator("--control") as simulator, Client(simulator.path) as client:
        simulator.order("explode")
        assert "order 'explode' is unknown, expected one of: unplug" in simulator.process.stderr.readline()
        assert client.ask(b"@15e") == b"@15,0e\r\n"


@pytest.mark.parametrize(
    "order, text",
    [
        ("freeze soon", "lasts is 'soon', expected 0.001 to 1e+09 s"),
        ("plug now", "order 'plug now' is unknown"),
        ("press bumper_left", "robot duo has no bumper_left; expected a robot's file with its pin"),
        ("fault loss:rate=2", "rate is '2'"),
    ],
)
def test_an_order_that_is_none_says_so(order, text):
    with pytest.raises(ConfigError) as error:
        obey(FaultyEngine(PythonBoard(Plant(model("duo")))), order)
    assert text in str(error.value)


def test_an_input_is_pressed_until_it_is_released():
    board = FaultyEngine(PythonBoard(Plant(bridged(**WITH_INPUTS))))
    board.advance(0.1)
    for order, active in (("press bumper_rear", 4), ("release bumper_rear", 0)):
        obey(board, order)
        board.advance(board.engine.now_s + 0.1)
        board.receive(encode_request(READ_INPUTS))
        assert board.advance(board.engine.now_s + 0.1) == encode_reply(READ_INPUTS, active, 0, 63)


def test_orders_in_pieces_are_joined():
    out, into = os.pipe()
    faults, port, told = FaultyEngine(Echo()), PtyPort(), []
    control = Control(faults, out, told.append, told.append)
    try:
        for piece in (b"unpl", b"ug 5\nst", b"op\n"):
            os.write(into, piece)
            control.attend(port)
        assert port.master is None
        assert told[0] == ""
        assert told[1].startswith("order 'stop' is unknown")
    finally:
        port.close()
        os.close(out)
        os.close(into)


def test_a_port_is_unplugged_however_short_it_was(close_later):
    """The board may run past the whole time before anybody looks."""
    faults, port, told = FaultyEngine(Echo()), close_later(PtyPort()), []
    control, before = Control(faults, None, told.append, told.append), port.path
    control.attend(port)
    faults.unplug(0.01)
    faults.advance(1.0)
    control.attend(port)
    control.attend(port)
    assert told == ["", port.path] and port.path != before


def test_times_of_an_ordered_fault_count_from_now():
    engine = FaultyEngine(Echo())
    engine.advance(5.0)
    obey(engine, "fault unplug:at=1,lasts=1")
    plugged = []
    for time_s in (5.5, 6.5, 7.5):
        engine.advance(time_s)
        plugged.append(engine.plugged)
    assert plugged == [True, False, True]


class Port:
    path, watch, master, plugged, baud, is_open = "", None, None, True, 115200, True

    def newly_opened(self):
        return False

    def read(self, limit=0):
        return b""


@pytest.fixture
def ending(monkeypatch):
    """A server at 10 s that was told to end, its port, and a function that lets it run at a time."""
    port, clock = Port(), [10.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    server = PtyServer(Echo(), port)
    server.end()

    def run_at(time_s):
        clock[0] = time_s
        server.step()
        return server.running

    yield port, server, run_at
    server.waker.close()


def test_board_outlives_its_host(ending):
    port, _, run_at = ending
    assert run_at(10.0)
    port.is_open = False
    assert not run_at(10.1)


def test_board_does_not_wait_for_a_host_that_stays(ending):
    _, _, run_at = ending
    assert run_at(10.0 + 0.99 * CLOSE_WAIT_S)
    assert not run_at(10.0 + CLOSE_WAIT_S)


def test_second_signal_ends_the_board_at_once(ending):
    _, server, run_at = ending
    assert run_at(10.0)
    server.end()
    assert not server.running


def test_a_team_has_the_emulated_robots_by_their_numbers():
    team, places = emulated(
        "sim,/dev/ttyACM0,sim,sim", factory.Options(robot="traxbot,stingbot"), ",environment,"
    )
    assert [each.name for each in team] == ["robot1", "robot3", "robot4"]
    assert [each.robot for each in team] == ["traxbot", "stingbot", "stingbot"]
    assert [each.environment for each in team] == [False, False, False]
    assert places == [0, 2, 3]


PIECE = bytes(256)
PIECES = 12


class EndlessHost:
    """A port whose host never stops sending."""

    path, watch, plugged, dropped = "", None, True, 0

    def __init__(self, baud):
        self.baud = baud
        self.master, self._end = os.pipe()
        os.write(self._end, b"x")

    def newly_opened(self):
        return False

    def read(self, limit=0):
        return PIECE

    def close(self):
        os.close(self.master)
        os.close(self._end)


class Taker:
    """A board that notes when bytes come, and calls `full` when it has enough of them."""

    next_event_s = float("inf")

    def __init__(self):
        self.now_s, self.times, self.full = 0.0, [], None

    def advance(self, to_s):
        self.now_s = to_s
        return b""

    def gap(self, to_s, data):
        """The computer has paused: what was measured before does not count."""
        self.now_s = to_s
        self.times.clear()

    def receive(self, data):
        self.times.append(self.now_s)
        if len(self.times) == PIECES:
            self.full()


def gaps_s(baud):
    """Times between the pieces of an endless input [s]; the first two may come at once."""
    port, board = EndlessHost(baud), Taker()
    server = PtyServer(board, port)
    board.full = server.stop
    server.run()
    port.close()
    return [b - a for a, b in zip(board.times[1:], board.times[2:])]


@pytest.mark.parametrize("baud", [115200, 500000])
def test_the_hosts_bytes_do_not_pass_faster_than_the_ports_speed(baud):
    needed_s, gaps = 10 * len(PIECE) / baud, gaps_s(baud)
    assert sum(gaps) > 0.9 * len(gaps) * needed_s


def test_what_waits_is_read_though_the_host_never_stops():
    port = EndlessHost(115200)
    assert MOST_WAITING <= len(read_all(port)) <= MOST_WAITING + len(PIECE)
    port.close()


@pytest.mark.realtime
@pytest.mark.parametrize("baud", [115200, 500000])
def test_the_hosts_bytes_pass_at_the_ports_speed(baud):
    require_median(gaps_s(baud), 2 * 10 * len(PIECE) / baud, "a piece's way through the port")
