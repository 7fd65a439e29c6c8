"""Faults of a running `mrl-sim`: at the start, by the clock, and by orders on stdin."""

import os
import select

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.serve.control import Control, obey
from sim_arduino.serve.pty import PtyPort
from tests.waiting import PATIENCE_S

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
