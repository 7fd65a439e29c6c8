"""Robots by name: the user's file, what wins over what, and every way to get it wrong."""

import json
import os

import pytest

from mrl_driver.host import named_robots
from mrl_driver.transport.port_search import Port
from sim_arduino.testing import EmulatedBoard

from .run import fails, mrl


def write(text):
    os.makedirs(os.path.dirname(named_robots.path()), exist_ok=True)
    with open(named_robots.path(), "w", encoding="utf-8") as file:
        file.write(text)


@pytest.fixture
def link(serve, tmp_path):
    """A link that leads to robot 1, as udev's of an adapter whose serial number another one has, too."""
    path = tmp_path / "usb-1a86"
    path.symlink_to(serve(robot_id=1).path)
    return path


def lead_to_robot_2(link, serve):
    link.unlink()
    link.symlink_to(serve(robot_id=2).path)


@pytest.mark.parametrize("given", [(), ("--id", 1)], ids=["asked", "given"])
def test_a_name_never_stands_for_another_board_that_its_port_leads_to(link, serve, given):
    assert "lab3 is robot 1 on" in mrl("names", "add", "lab3", "--port", link, *given).stdout
    assert json.loads(mrl("--robot", "lab3", "info", "--json").stdout)["robot_id"] == 1
    lead_to_robot_2(link, serve)
    line = fails(8, "--robot", "lab3", "drive", "--linear", 0.1, "--for", 0.1)
    assert "robot id 2 answers, expected 1: another board is on this port" in line


def test_another_id_for_the_board_is_the_names_from_then_on():
    with EmulatedBoard() as board:
        mrl("names", "add", "lab3", "--port", board.port)
        assert named_robots.read()["lab3"].id == 1
        assert mrl("--robot", "lab3", "set-id", 2, "--yes").returncode == 0
    assert named_robots.read()["lab3"].id == 2


CP2102 = Port("/dev/ttyUSB0", ("/dev/serial/by-id/usb-Silicon_Labs-if00",), 0x10C4, 0xEA60, "0001")
FTDI = Port("/dev/ttyUSB0", ("/dev/serial/by-id/usb-FTDI_A50285BI-if00",), 0x0403, 0x6001, "A50285BI")


@pytest.mark.parametrize(
    ("there", "promises"),
    [
        ([FTDI], True),
        ([CP2102], False),
        ([FTDI, FTDI._replace(device="/dev/ttyUSB1")], False),
        ([FTDI._replace(serial=None)], False),
    ],
    ids=["own number", "number of all", "number of two", "no number"],
)
def test_a_name_promises_every_socket_only_if_the_serial_number_is_the_boards_own(
    monkeypatch, there, promises
):
    monkeypatch.setattr("mrl_driver.transport.link.described", lambda: there)
    done = mrl("names", "add", "lab3", "--port", "/dev/ttyUSB0", "--id", "3")
    assert (", wherever it is plugged in" in done.stdout) is promises
    assert named_robots.read()["lab3"].port == (FTDI.links[0] if promises else "/dev/ttyUSB0")


def test_an_explicit_port_wins_over_the_name_and_the_name_over_the_environment(monkeypatch):
    write("lab3: {port: /dev/one}\n")
    monkeypatch.setenv("MRL_PORT", "/dev/two")
    assert "'/dev/one' does not exist" in fails(3, "info", "--robot", "lab3")
    assert "'/dev/three' does not exist" in fails(3, "info", "--robot", "lab3", "--port", "/dev/three")
    assert "'/dev/two' does not exist" in fails(3, "info")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lab3: {prot: /dev/one}\n", "key lab3.prot is unknown, expected port, model, baud, id"),
        ("lab3: {model: traxbot}\n", "key lab3.port is missing"),
        ("lab3: {port: 7}\n", "lab3.port is 7, expected a serial port"),
        ("lab3: {port: /dev/one, baud: fast}\n", "lab3.baud is 'fast', expected a whole number from 300"),
        ("lab3: {port: /dev/one, baud: .nan}\n", "lab3.baud is nan"),
        ("lab3: {port: /dev/one, id: 0}\n", "lab3.id is 0"),
        ("lab3: /dev/one\n", "lab3 is '/dev/one', expected a mapping"),
        ("- lab3\n", "expected a mapping of names, each with a port"),
        ("traxbot: {port: /dev/one}\n", "name 'traxbot' is a robot model"),
        ("'a b': {port: /dev/one}\n", "name is 'a b'"),
        ("lab3: {port: [\n", "no YAML"),
        pytest.param("[" * 5000, "no YAML", id="deep"),
    ],
)
def test_a_wrong_file_names_key_value_and_what_was_expected(text, words):
    write(text)
    line = fails(2, "info", "--robot", "lab3")
    assert words in line and named_robots.path() in line


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["auto", "--port", "/dev/one"], "is a robot model"),
        (["3lab", "--port", "/dev/one"], "name is '3lab'"),
        (["lab3", "--port", " "], "--port is ' '"),
        (["lab3", "--port", "/dev/one", "--baud", "1"], "--baud is 1"),
        (["lab3", "--port", "/dev/one", "--model", "nix"], "robot 'nix' is unknown"),
    ],
)
def test_nothing_wrong_gets_into_the_file(args, words):
    assert words in fails(2, "names", "add", *args)
    assert not os.path.exists(named_robots.path())
