"""Few descriptors, no thread: one of our errors, nothing stays open or locked, and it works again afterwards."""

import contextlib
import socket
from types import SimpleNamespace

import pytest

from mrl_driver.driver import Driver, Options, link_source
from mrl_driver.errors import MrlError
from mrl_driver.recording.recording import Recorder
from mrl_driver.session.events import Lost, Reconnected
from mrl_driver.transport.address import parse
from mrl_driver.transport.listener import TcpListener, UdpListener
from mrl_driver.transport.open_link import open_link
from mrl_driver.transport.sockets import UdpSender
from sim_arduino.serve.pty import PtyPort
from tests.shortage import MOST, descriptors_left, errors_of_each_step, threads_left
from tests.waiting import wait_until


def bound(kind, scheme):
    return kind(parse(f"{scheme}://127.0.0.1:0", listening=True))


def driver(port, **options):
    made = Driver(port, options=Options(**options))
    made.connect()
    return made


OPENERS = {
    "device": lambda use: open_link(use.port),
    "tcp": lambda use: open_link(use.tcp),
    "udp": lambda use: open_link("udp://127.0.0.1:9"),
    "url": lambda use: open_link("loop://"),
    "driver": lambda use: driver(use.port),
    "recording driver": lambda use: driver(use.port, record=use.file),
    "recorder": lambda use: Recorder(use.file),
    "tcp listener": lambda use: bound(TcpListener, "tcp"),
    "udp listener": lambda use: bound(UdpListener, "udp"),
    "udp sender": lambda use: UdpSender("127.0.0.1:9"),
    "emulated port": lambda use: PtyPort(),
}
"""Everything that is opened in steps: a call that returns what can be closed."""


@pytest.fixture
def use(serve, tmp_path):
    """A port, an address that accepts connections, and the name of a file."""
    with socket.create_server(("127.0.0.1", 0), backlog=MOST) as listener:
        tcp = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        yield SimpleNamespace(port=serve().path, tcp=tcp, file=str(tmp_path / "drive.mrl"))


@pytest.mark.parametrize("left", [descriptors_left, threads_left])
@pytest.mark.parametrize("name", OPENERS)
def test_what_is_opened_in_steps_leaves_nothing_open_if_a_step_fails(use, name, left):
    errors = errors_of_each_step(lambda: OPENERS[name](use), left, MrlError)
    assert all("too many files open" in str(error) or "no thread" in str(error) for error in errors)
    assert name != "recorder" or all(f"cannot record to {use.file!r}: " in str(error) for error in errors)


def test_a_driver_that_found_no_thread_closes_and_connects_later(serve):
    robot = Driver(serve().path)
    with threads_left(0), pytest.raises(MrlError, match="the driver cannot start: no thread can be started"):
        robot.connect()
    assert robot.connect().robot_id == 1
    robot.close()


@pytest.mark.parametrize("left", [0, 5])
def test_a_lost_robot_is_found_again_when_there_are_descriptors(cable, left, monkeypatch):
    """With five, the port opens, and the pipe behind it does not."""
    events, tried = [], []
    monkeypatch.setattr(link_source, "open_link", lambda *args: tried.append(args) or open_link(*args))
    with Driver(cable.path, options=Options(reconnect=True)) as robot:
        robot.on_event(events.append)
        cable.unplug()
        wait_until(lambda: any(isinstance(event, Lost) for event in events))
        cable.plug()
        with descriptors_left(left):
            wait_until(lambda: len(tried) > 2)
            assert robot.error is None
        wait_until(lambda: any(isinstance(event, Reconnected) for event in events))


def test_a_listener_that_cannot_accept_goes_on_and_accepts_later():
    with contextlib.closing(bound(TcpListener, "tcp")) as listener, socket.create_connection(
        ("127.0.0.1", listener.address.port)
    ):
        with descriptors_left(0):
            assert not listener.attend() and listener.watch is None
        assert listener.attend() and listener.client and listener.watch is not None
