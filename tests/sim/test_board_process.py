"""The board that sim.launch starts: when it ends, and how it says what is wrong."""

import math

import pytest

from sim_arduino.serve.minimal import PATIENCE_S, Leave, main


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
    leave = Leave(port)
    assert leave.due_s == math.inf
    leave.end(server)
    assert leave.due_s == 0.0 and server.woken
    return leave, port, server


def test_board_outlives_its_host(ending):
    leave, port, server = ending
    leave.look(10.0)
    assert not server.stopped
    port.is_open = False
    leave.look(leave.due_s)
    assert server.stopped


def test_board_does_not_wait_for_a_host_that_stays(ending):
    leave, _, server = ending
    leave.look(10.0)
    leave.look(10.0 + 0.99 * PATIENCE_S)
    assert not server.stopped
    leave.look(10.0 + PATIENCE_S)
    assert server.stopped


def test_second_signal_ends_at_once(ending):
    leave, _, server = ending
    leave.end(server)
    assert server.stopped


def test_unknown_world_costs_one_line(capsys, tmp_path):
    assert main(["--link", str(tmp_path / "port"), "--world", "moon"]) == 2
    assert capsys.readouterr().err.startswith("sim_board: world 'moon' is unknown, expected corridor")
    assert not (tmp_path / "port").is_symlink()
