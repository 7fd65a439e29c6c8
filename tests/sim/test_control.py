"""`mrl-sim` as a process: faults at the start, by the clock and on stdin, its end, and how fast bytes pass."""

import math
import os
import select
import signal
import subprocess
import sys

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.serve import factory
from sim_arduino.serve.control import Control, obey
from sim_arduino.serve.minimal import CLOSE_WAIT_S, Shutdown, emulated, main
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import PtyServer
from sim_arduino.serve.socket_port import MOST_WAITING, read_all
from tests.waiting import PATIENCE_S, require_median

from .simulator import Client, Simulator
from .test_faults import Echo

LONG = "1e9 seconds"


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
        ("freeze soon", "got 'soon', expected 0.001 to " + LONG),
        ("plug now", "order 'plug now' is unknown"),
        ("fault loss:rate=2", "rate is '2'"),
    ],
)
def test_an_order_that_is_none_says_so(order, text):
    with pytest.raises(ConfigError) as error:
        obey(FaultyEngine(Echo()), order)
    assert text in str(error.value)


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
    is_open = True


class Server:
    stopped, woken = 0, 0

    def stop(self):
        self.stopped += 1

    def wake(self):
        self.woken += 1


@pytest.fixture
def ending():
    """A watcher that was told to end, its port and its server."""
    port, server = Port(), Server()
    shutdown = Shutdown(port)
    assert shutdown.due_s == math.inf
    shutdown.end(server)
    assert shutdown.due_s == 0.0 and server.woken
    return shutdown, port, server


def test_board_outlives_its_host(ending):
    shutdown, port, server = ending
    shutdown.look(10.0)
    assert not server.stopped
    port.is_open = False
    shutdown.look(shutdown.due_s)
    assert server.stopped


def test_board_does_not_wait_for_a_host_that_stays(ending):
    shutdown, _, server = ending
    shutdown.look(10.0)
    shutdown.look(10.0 + 0.99 * CLOSE_WAIT_S)
    assert not server.stopped
    shutdown.look(10.0 + CLOSE_WAIT_S)
    assert server.stopped


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--world", "moon", "world 'moon' is unknown, expected corridor"),
        ("--pose", "1,2", "pose is '1,2', expected X,Y,YAW"),
    ],
)
def test_wrong_option_costs_one_line(capsys, tmp_path, option, value, said):
    assert main(["--link", str(tmp_path / "port"), option, value]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"sim_board: {said}") and told.count("\n") == 1
    assert not (tmp_path / "port").is_symlink()


PROGRAM = "import sys; from sim_arduino.serve.minimal import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture
def board(tmp_path):
    command = [sys.executable, "-c", PROGRAM, "--link", str(tmp_path / "port")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline().endswith(f" as {tmp_path / 'port'}\n")
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signal_ends_the_process_and_removes_its_port(board, tmp_path, name):
    assert (tmp_path / "port").is_symlink()
    board.send_signal(getattr(signal, name))
    assert (board.wait(), board.stderr.read()) == (0, "")
    assert not (tmp_path / "port").is_symlink()


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
