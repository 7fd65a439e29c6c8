"""The board that sim.launch starts: when it ends, and how it says what is wrong."""

import math
import signal
import subprocess
import sys

import pytest

from sim_arduino.serve import factory
from sim_arduino.serve.minimal import CLOSE_WAIT_S, Shutdown, emulated, main


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
