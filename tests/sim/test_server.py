"""The server between a port and a board: how fast the host's bytes pass."""

import os

import pytest

from sim_arduino.serve.server import PtyServer
from sim_arduino.serve.socket_port import MOST_WAITING, read_all
from tests.waiting import require_median

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
