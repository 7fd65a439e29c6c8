"""The pty as a serial device, without a board behind it."""

import fcntl
import os
import termios

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.serve.pty import PtyPort, SymbolicLink

from .simulator import Client


@pytest.fixture
def port(close_later):
    return close_later(PtyPort())


def test_bytes_pass_unchanged_both_ways(port):
    everything = bytes(range(256))
    with Client(port.path) as client:
        port.newly_opened()
        client.send(everything)
        port.write(everything)
        assert port.read() == everything
        assert client.read_until(everything[-3:]) == everything


def test_bytes_wait_until_the_opening_before_them_was_noticed(port):
    with Client(port.path) as client:
        client.send(b"@13e")
        assert port.read() == b""
        assert port.newly_opened()
        assert port.read() == b"@13e"
    port.newly_opened()
    with Client(port.path):
        assert port.newly_opened()


def test_what_is_sent_while_nobody_listens_is_lost(port):
    port.write(b"old")
    with Client(port.path) as client:
        port.newly_opened()
        port.write(b"new")
        assert client.read_until(b"new") == b"new"
    assert port.dropped == 3


def test_a_new_program_does_not_get_what_the_last_one_left(port):
    with Client(port.path):
        port.newly_opened()
        port.write(b"old")
    port.newly_opened()
    with Client(port.path) as client:
        port.newly_opened()
        port.write(b"new")
        assert client.read_until(b"new") == b"new"


def test_a_closed_port_keeps_what_its_program_sent_last(port):
    with Client(port.path) as client:
        client.send(b"@13e")
    port.newly_opened()
    assert port.read() == b"@13e"


def test_a_reader_that_stalls_costs_bytes_not_time(port):
    with Client(port.path):
        port.newly_opened()
        for _ in range(300):
            port.write(b"x" * 1000)
        assert port.dropped > 100000


def test_exclusive_access_ends_with_its_program(port):
    """The kernel keeps the mark as long as anybody has the device open."""
    with Client(port.path) as client:
        port.newly_opened()
        fcntl.ioctl(client.fd, termios.TIOCEXCL)
    port.newly_opened()
    assert not exclusive(port)


def exclusive(port):
    with Client(port.path) as client:
        answer = fcntl.ioctl(client.fd, 0x80045440, b"\0" * 4)  # TIOCGEXCL
    return bool(int.from_bytes(answer, "little"))


def test_settings_end_with_their_program(port):
    before = termios.tcgetattr(port.master)
    with Client(port.path) as client:
        port.newly_opened()
        changed = termios.tcgetattr(client.fd)
        changed[3] |= termios.ECHO | termios.ICANON
        termios.tcsetattr(client.fd, termios.TCSANOW, changed)
        assert termios.tcgetattr(port.master) != before
    port.newly_opened()
    assert termios.tcgetattr(port.master) == before


@pytest.mark.parametrize(
    ("code", "baud"),
    [
        (termios.B9600, 9600),
        (termios.B57600, 57600),
        (termios.B115200, 115200),
        (termios.B230400, 230400),
        (termios.B500000, 500000),
    ],
)
def test_the_rate_is_that_of_the_bytes(port, code, baud):
    """Also of those that a program has left that is closed."""
    with Client(port.path) as client:
        port.newly_opened()
        settings = termios.tcgetattr(client.fd)
        settings[4:6] = code, code
        termios.tcsetattr(client.fd, termios.TCSANOW, settings)
        client.send(b"@13e")
    port.newly_opened()
    assert (port.baud, port.read(), port.baud) == (baud, b"@13e", 115200)


def test_the_rate_of_a_program_is_not_lost_with_the_close_of_the_one_before(port):
    """It opens the port before the emulator looks."""
    with Client(port.path):
        port.newly_opened()
    with Client(port.path) as client:
        settings = termios.tcgetattr(client.fd)
        settings[4:6] = termios.B57600, termios.B57600
        termios.tcsetattr(client.fd, termios.TCSANOW, settings)
        port.newly_opened()
        assert port.baud == 57600


def test_a_program_that_sets_no_rate_has_that_of_the_board(port):
    with Client(port.path):
        port.newly_opened()
        assert port.baud == 115200


def test_a_link_replaces_an_old_one_until_it_is_removed(tmp_path):
    name = str(tmp_path / "ttyTRAX0")
    SymbolicLink(name, "/dev/pts/98")
    link = SymbolicLink(name, "/dev/pts/99")
    assert os.readlink(name) == "/dev/pts/99"
    assert os.listdir(tmp_path) == ["ttyTRAX0"]
    link.remove()
    assert not os.path.lexists(name)


def test_a_link_to_a_port_that_is_served_is_not_taken_over(port, tmp_path):
    name = str(tmp_path / "ttyTRAX0")
    SymbolicLink(name, port.path)
    with pytest.raises(ConfigError, match="leads to .* which is in use"):
        SymbolicLink(name, "/dev/pts/99")
    assert os.readlink(name) == port.path


def test_a_link_of_an_emulator_that_was_killed_may_lead_to_the_new_port_already(port, tmp_path):
    name = str(tmp_path / "ttyTRAX0")
    os.symlink(port.path, name)
    SymbolicLink(name, port.path).remove()
    assert not os.path.lexists(name)


def test_a_link_that_somebody_took_over_stays(tmp_path):
    name = str(tmp_path / "ttyTRAX0")
    first = SymbolicLink(name, "/dev/pts/98")
    SymbolicLink(name, "/dev/pts/99")
    first.remove()
    assert os.path.lexists(name)


def test_a_file_is_not_replaced(tmp_path):
    name = tmp_path / "precious"
    name.write_text("x")
    with pytest.raises(ConfigError, match="expected a free name"):
        SymbolicLink(str(name), "/dev/pts/99")


def test_two_programs_that_open_at_the_same_moment(port):
    """The kernel tells of one opening; when one of them closes, the other one's bytes show that it is there."""
    with Client(port.path) as stays:
        with Client(port.path):
            pass
        port.newly_opened()
        stays.send(b"@5e")
        port.read()
        assert port.is_open
