"""`mrl ports`: what may be opened, and what it says of each port."""

import json
import subprocess

import pytest

from mrl_driver.driver import probe
from mrl_driver.session.handshake import TIMEOUT_S
from mrl_driver.transport import port_info
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.port_search import Port

from .run import mrl

UNO = Port("/dev/ttyACM7", ("/dev/serial/by-id/usb-Arduino_7",), 0x2341, 0x0043, "7")
COPY = Port("/dev/ttyUSB7", (), 0x1A86, 0x7523, None)


@pytest.fixture
def there(monkeypatch):
    """Lets these ports be there."""
    return lambda *ports: monkeypatch.setattr(port_info, "described", lambda: list(ports))


def rows(*args):
    return {row["device"]: row for row in json.loads(mrl("ports", "--json", *args).stdout)}


def test_ports_are_told_by_their_usb_ids(there):
    there(UNO, COPY, Port("/dev/ttyS7"))
    found = rows()
    assert [found[name]["kind"].partition(",")[0] for name in sorted(found)] == [
        "Arduino Uno R3",
        "serial port",
        "CH340 adapter",
    ]
    assert "asked" not in found["/dev/ttyACM7"]


def test_a_probe_asks_boards_of_arduino_named_robots_and_ports_given_but_no_others(there, serve):
    given, named, other = (serve(robot_id=i) for i in (1, 2, 3))
    there(Port(other.path), COPY, UNO)
    mrl("names", "add", "lab2", "--port", named.path)
    found = rows("--probe", given.path)
    assert {name for name, row in found.items() if row["asked"]} == {given.path, named.path, UNO.device}
    assert (found[given.path]["robot_id"], found[named.path]["robot_id"]) == (1, 2)
    assert found[named.path]["name"] == "lab2" and not other.received


def test_a_port_in_use_is_never_opened(there, serve):
    port = serve()
    there(Port(port.path, (), 0x2341, 0x0043))
    link = SerialLink(port.path)
    try:
        row = rows("--probe")[port.path]
    finally:
        link.close()
    assert not row["asked"] and "process" in row["used_by"] and not port.received


def test_a_port_that_a_program_opens_while_others_are_asked_is_not_opened(serve, monkeypatch):
    port, asked = serve(), []
    monkeypatch.setattr(probe, "probe", lambda *given: asked.append(given))
    link = SerialLink(port.path)
    try:
        ((_, answer),) = probe.probe_all([(port.path, 115200, 0.5)])
    finally:
        link.close()
    assert "in use by" in answer.error and not asked


def test_a_usb_port_has_time_for_boot_loader_and_old_firmware(there, serve, monkeypatch):
    asked, pty = {}, serve().path
    monkeypatch.setattr(probe, "probe", lambda *port: asked.update({port[0]: port[2]}) or probe.Answer())
    there(UNO)
    rows("--probe", pty)
    assert asked == {pty: probe.RUNNING_S, UNO.device: TIMEOUT_S}


def test_a_program_without_a_lock_is_named(serve):
    """Such as a terminal program."""
    port = serve().path
    assert port_info.user_of(port) == ""
    with open(port, "rb", buffering=0) as held, subprocess.Popen(["sleep", "60"], stdin=held) as program:
        assert f"(process {program.pid})" in port_info.user_of(port)
        program.kill()
