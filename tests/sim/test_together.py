"""Many boards in one process and thread."""

import os
import subprocess
import sys
import threading

import pytest

from mrl_driver.robot import models
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import HEARTBEAT_S, PtyServer, Waker, serve_together
from tests.waiting import PATIENCE_S, wait_until

from .simulator import Client, Simulator


class Idle:
    """A board without events that counts its calls; `heard` is called with the host's bytes."""

    next_event_s = float("inf")

    def __init__(self, heard=lambda data: None):
        self.heard, self.advances = heard, 0

    def advance(self, to_s):
        self.advances += 1
        return b""

    def gap(self, to_s, waiting):
        """This computer has paused."""
        if waiting:
            self.heard(waiting)

    def receive(self, data):
        self.heard(data)


@pytest.fixture
def together():
    """Serves engines in one thread; gives the servers, their ports, and the list of failures."""
    waker, ports, servers, threads, failures = Waker(), [], [], [], []

    def serve(*engines):
        ports.extend(PtyPort() for _ in engines)
        servers.extend(PtyServer(engine, port, waker=waker) for engine, port in zip(engines, ports))
        arguments = servers, waker, lambda server, error: failures.append((server, error))
        threads.append(threading.Thread(target=serve_together, args=arguments))
        threads[-1].start()
        return servers, ports, failures

    yield serve
    for server in servers:
        server.stop()
    for thread in threads:
        thread.join()
    for port in ports:
        port.close()
    waker.close()


def plant(name="robot"):
    return Plant(models.load("traxbot"), name=name)


def steps_in_a_second(board):
    """How often a server would call a board between 1 and 2 s of its time."""
    count, now_s = 0, 1.0
    board.advance(now_s)
    while now_s < 2.0:
        now_s = min(board.next_event_s, now_s + HEARTBEAT_S)
        board.advance(now_s)
        count += 1
    return count


@pytest.mark.parametrize(
    ("make", "idle", "streaming"),
    [(PythonBoard, 15, 60), (lambda plant: AvrEngine(plant, robot_id=1), 99, 300)],
    ids=["python", "avr"],
)
def test_a_board_is_called_only_when_it_has_something_to_do(make, idle, streaming):
    """An idle one some 10 times a second.  An image at 50 Hz is called 5 times a frame, and each 1 ms of its bytes."""
    boards = make(plant()), make(plant())
    boards[1].advance(0.5)
    boards[1].receive(b"@11,150,600e@18,20e")
    called = [steps_in_a_second(board) for board in boards]
    for board in boards:
        board.close()
    assert called[0] <= idle and called[1] <= streaming


def test_bytes_for_one_board_do_not_call_the_others(together, monkeypatch):
    monkeypatch.setattr("sim_arduino.serve.server.HEARTBEAT_S", 1e6)
    taken, other = [], Idle()
    _, ports, _ = together(other, Idle(taken.append))
    with Client(ports[1].path) as client:
        for _ in range(10):
            before = len(taken)
            client.send(b"@13e")
            wait_until(lambda before=before: len(taken) > before)
    assert other.advances == 1


class Broken(Idle):
    def receive(self, data):
        raise ValueError("broken")


def test_a_board_that_fails_does_not_stop_the_others(together):
    taken = threading.Event()
    servers, ports, failures = together(Broken(), Idle(lambda data: taken.set()))
    with Client(ports[0].path) as broken, Client(ports[1].path) as sound:
        broken.send(b"@13e")
        wait_until(lambda: failures)
        sound.send(b"@13e")
        assert taken.wait(PATIENCE_S)
    assert failures[0][0] is servers[0] and str(failures[0][1]) == "broken"


TEAM = ("--name", "one", "--name", "two", "--pose", "0,0,0", "--pose", "0.6,0,180")


@pytest.mark.parametrize("engine", ["python", "avr"])
def test_all_robots_of_a_process_answer(engine):
    with Simulator(*TEAM, "--engine", engine) as simulator:
        lines = [simulator.path, simulator.process.stdout.readline().strip()]
        assert [line.split()[0] for line in lines] == ["one", "two"]
        for line in lines:
            with Client(line.split()[1]) as client:
                assert client.ask(b"@15e") == b"@15,0e\r\n"


def test_each_robot_has_a_link_and_files_with_its_name(tmp_path):
    files = [("--link", "link"), ("--truth", "truth"), ("--log", "log")]
    options = [word for option, file in files for word in (option, str(tmp_path / f"{file}-{{name}}"))]
    with Simulator(*TEAM, *options) as simulator:
        simulator.process.stdout.readline()
        expected = sorted(f"{file}-{name}" for _, file in files for name in ("one", "two"))
        assert sorted(os.listdir(tmp_path)) == expected


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ((*TEAM, "--link", "/tmp/robot"), "--link is '/tmp/robot', expected {name} in it"),
        ((*TEAM, "--control"), "--control is given for a team, expected one --name with it"),
        (("--pose", "0,0,0", "--pose", "1,1,0"), "--pose is given 2 times, expected at most once for each"),
        (("--name", "one", "--name", "two"), "is in a wall or another robot (one)"),
    ],
)
def test_options_that_do_not_fit_several_robots(options, text):
    command = [sys.executable, "-m", "sim_arduino.serve.main", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert text in done.stderr
