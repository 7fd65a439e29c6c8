"""Faults of a running `mrl-sim`: at the start, by the clock, and by orders on stdin."""

import os
import select
import subprocess
import sys
import time

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.faults.fault_table import FAULTS
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.serve.control import Control, obey
from sim_arduino.serve.pty import PtyPort
from tests.waiting import PATIENCE_S, wait_until

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


def test_a_cable_pulled_by_the_clock():
    with Simulator("--fault", "unplug:at=0.3,lasts=0.2") as simulator:
        assert simulator.process.stdout.readline().startswith("/dev/pts/")


def test_an_order_to_reset_is_seen_in_the_status():
    with Simulator("--control") as simulator, Client(simulator.path) as client:
        assert client.ask(b"@30e").startswith(b"@30,0,0,1,")
        simulator.order("reset")
        client.ask_until(b"@30e", b"@30,0,0,2,")


def test_a_board_that_loses_all_does_not_answer():
    with Simulator("--fault", "loss:rate=1,direction=to_board") as simulator, Client(
        simulator.path
    ) as client:
        client.send(b"@15e")
        assert client.read(0.4) == b""


def test_a_frozen_board_answers_later():
    with Simulator("--control") as simulator, Client(simulator.path) as client:
        client.ask(b"@15e")
        simulator.order("freeze 0.2")

        def waited():
            start_s = time.monotonic()
            client.ask(b"@15e")
            return time.monotonic() - start_s > 0.1

        wait_until(waited)


def test_a_wrong_order_is_answered_in_one_line_and_changes_nothing():
    with Simulator("--control") as simulator, Client(simulator.path) as client:
        simulator.order("explode")
        assert "order 'explode' is unknown, expected one of: unplug" in simulator.process.stderr.readline()
        assert client.ask(b"@15e") == b"@15,0e\r\n"


def test_orders_may_end_without_ending_the_board():
    with Simulator("--control") as simulator, Client(simulator.path) as client:
        simulator.process.stdin.close()
        simulator.process.stdin = None
        assert client.ask(b"@15e") == b"@15,0e\r\n"


@pytest.mark.parametrize(
    "spec, text",
    [("nope", "fault 'nope' is unknown"), ("loss:rate=7", "rate is '7', expected 0 to 1")],
)
def test_a_wrong_fault_ends_with_one_line(spec, text):
    command = [sys.executable, "-m", "sim_arduino.serve.main", "--fault", spec]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert text in done.stderr


def test_the_help_lists_the_faults():
    command = [sys.executable, "-m", "sim_arduino.serve.main", "--help"]
    out = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S).stdout
    assert all(f"  {name}: {kind.text}\n" in out for name, kind in FAULTS.items())
    assert "unplug [SECONDS]" in out


# ---- in process


@pytest.mark.parametrize(
    "order, text",
    [
        ("stall", "got '', expected 0.001 to " + LONG),
        ("freeze soon", "got 'soon', expected 0.001 to " + LONG),
        ("unplug -1", "got '-1'"),
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
