"""`mrl monitor --udp`: the numbers of a robot for another program, beside what people see."""

import json
import socket

import pytest

from mrl_driver.cli.commands import monitor
from tests.waiting import PATIENCE_S, wait_until

from .run import mrl


@pytest.fixture
def receiver():
    """A program that listens to datagrams."""
    with socket.socket(type=socket.SOCK_DGRAM) as end:
        end.settimeout(PATIENCE_S)
        end.bind(("127.0.0.1", 0))
        yield end


def address_of(receiver):
    return "127.0.0.1:{1}".format(*receiver.getsockname())


def received(receiver):
    return [json.loads(receiver.recv(4096)) for _ in range(2)]


@pytest.fixture
def sent(monkeypatch):
    """Each line is printed after telemetry was sent."""

    def line(driver):
        for _ in range(2):  # the first has been sent when the second one is there
            before = driver.telemetry
            wait_until(lambda before=before: driver.telemetry is not before)
        return "a line"

    monkeypatch.setattr(monitor, "line", line)
    monkeypatch.setattr(monitor, "LINE_S", 0.05)


@pytest.mark.parametrize("name, option", [("line", []), ("snapshot", ["--json"])])
def test_telemetry_goes_to_another_program_beside_what_is_printed(serve, receiver, monkeypatch, name, option):
    monkeypatch.setattr(monitor, name, lambda driver: received(receiver)[1]["battery_v"])
    done = mrl("monitor", "--port", serve().path, "--seconds", "0.05", "--udp", address_of(receiver), *option)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.splitlines()[0] == "12.0"


@pytest.mark.usefixtures("sent")
def test_datagrams_that_the_system_refuses_are_said_at_once_and_counted_at_the_end(serve):
    """A program may not send to all computers unless it says so."""
    done = mrl("monitor", "--port", serve().path, "--seconds", "0.1", "--udp", "127.255.255.255:9")
    first, last = done.stderr.splitlines()
    for line in (first, last):
        assert line.startswith("mrl: warning: --udp 127.255.255.255:9: ") and "permission denied" in line
    assert done.returncode == 0 and int(first.split()[4]) <= int(last.split()[4])
