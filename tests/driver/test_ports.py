"""Which ports are opened in the search for a lost robot, and in which order."""

import contextlib
import fcntl
import os
import pty
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import PortBusy
from mrl_driver.transport import link
from mrl_driver.transport.port_info import Port, locked_by, opened_by
from mrl_driver.transport.reconnect import AGAIN_S, WRONG_AGAIN_S, Search, candidates

BY_ID = "/dev/serial/by-id/usb-Arduino_A1"
ROBOT = Port("/dev/ttyACM0", (BY_ID,), 0x2341, 0x0043, "A1")
MOVED = ROBOT._replace(device="/dev/ttyACM3")
SISTER = Port("/dev/ttyACM1", ("/dev/serial/by-id/usb-Arduino_B2",), 0x2341, 0x0043, "B2")
GPS = Port("/dev/ttyACM2", (), 0x1546, 0x01A7, None)
NAME = "/dev/ttyACM0"


def found(*there, name=NAME, lost=ROBOT, device=None):
    return candidates(name, device or name, lost, there)


PLAIN = ROBOT._replace(serial=None)
PLACED = ROBOT._replace(location="1-2")


@pytest.mark.parametrize(
    ("there", "options", "names"),
    [
        ((SISTER, ROBOT), {}, [NAME, SISTER.device]),
        ((SISTER, MOVED), {}, [MOVED.device, NAME, SISTER.device]),
        ((SISTER._replace(device=NAME), MOVED), {}, [MOVED.device, NAME]),
        ((GPS._replace(device=NAME), SISTER), {}, [SISTER.device, NAME]),
        (
            (ROBOT, SISTER, Port("/dev/ttyS0")),
            {"name": "/run/robot", "lost": Port("/dev/pts/3")},
            ["/run/robot"],
        ),
        (
            (SISTER._replace(serial=None), PLAIN._replace(device=MOVED.device)),
            {"lost": PLAIN},
            [MOVED.device, NAME, SISTER.device],
        ),
        (
            (PLACED._replace(location="1-1"), PLACED._replace(device=MOVED.device)),
            {"lost": PLACED},
            [MOVED.device, NAME],
        ),
        ((ROBOT, SISTER), {"name": BY_ID, "device": NAME}, [BY_ID, SISTER.device]),
    ],
    ids=["name of before", "moved", "name taken", "foreign under the name", "no USB ids", "told by link"]
    + ["told by socket", "name is a link"],
)
def test_the_same_device_leads_then_the_name_then_its_like(there, options, names):
    assert found(*there, **options) == names


def test_other_vendors_and_products_are_never_opened():
    other_product = SISTER._replace(device="/dev/ttyACM4", product=0x0001)
    assert found(GPS, other_product, Port("/dev/ttyS0")) == [NAME]


@pytest.mark.parametrize("serial", ["0001", "0", "00000000", None])
def test_devices_with_the_serial_number_of_all_their_kind_are_told_by_their_socket(serial):
    """Or with none: copies share one link, which leads to the one that was plugged in last."""
    plain = ROBOT._replace(serial=serial, location="1-2")
    assert plain.is_same(plain._replace(device="/dev/ttyACM3"))
    assert not plain.is_same(plain._replace(location="1-3"))


def test_two_devices_without_serial_number_and_link_are_alike():
    plain = ROBOT._replace(serial=None, links=())
    assert not plain.is_same(plain) and plain.is_like(plain)


PORTS = st.lists(
    st.builds(
        Port,
        st.sampled_from([f"/dev/ttyACM{i}" for i in range(5)]),
        st.just(()),
        st.sampled_from([None, 1, 2]),
        st.sampled_from([1, 2]),
        st.sampled_from([None, "a", "b"]),
    ),
    unique_by=lambda port: port.device,
)


@given(PORTS, st.builds(Port, st.just(NAME), st.just(()), st.sampled_from([None, 1]), st.just(1)))
def test_only_the_named_port_and_its_like_are_opened_each_once(there, lost):
    names = found(*there, lost=lost)
    like = {port.device for port in there if port.is_like(lost)}
    assert set(names) == like | {NAME} and len(names) == len(set(names))


def test_a_port_that_stays_silent_lets_the_next_have_a_turn():
    search = Search(NAME, ROBOT)
    search.refuse(NAME, 5.0)
    assert search.next(NAME, [ROBOT, SISTER], 5.0) == "/dev/ttyACM1"
    assert search.next(NAME, [ROBOT, SISTER], 5.0 + AGAIN_S) == NAME


def test_another_robot_is_left_alone_until_it_was_unplugged():
    search = Search(NAME, ROBOT)
    search.refuse("/dev/ttyACM1", 5.0, wrong=True)
    search.refuse(NAME, 5.0, wrong=True)
    assert search.next(NAME, [SISTER], 5.0 + WRONG_AGAIN_S / 2) is None
    search.next(NAME, [], 6.0)
    assert search.next(NAME, [SISTER], 6.0) == "/dev/ttyACM1"


# -- several robots with the same id

ALIKE = [Port(f"/dev/ttyUSB{i}", (), 0x1A86, 0x7523) for i in range(3)]
LOST = ALIKE[0]


def test_a_link_that_led_to_a_wrong_robot_is_tried_at_once_when_it_leads_elsewhere():
    search = Search("/dev/robot", Port("/dev/pts/1"), exists=lambda name: True)
    assert search.next("/dev/pts/2", [], 0.0) == "/dev/robot"
    search.refuse("/dev/robot", 0.0, wrong=True)
    assert search.next("/dev/pts/2", [], 0.1) is None
    assert search.next("/dev/pts/3", [], 0.2) == "/dev/robot"


def search_for(*others, name=LOST.device):
    return Search(name, LOST, others, lambda name: name != LOST.device)


def take(search, port, there):
    return search.take(port.device, port, LOST.device, there)


def test_a_port_that_was_there_beside_the_robot_is_never_opened():
    assert search_for(ALIKE[1]).next(LOST.device, [ALIKE[1]], 0.0) is None
    assert search_for(ALIKE[1]).next(LOST.device, ALIKE[1:], 0.0) == ALIKE[2].device


def test_a_link_that_leads_to_another_port_by_now_is_not_opened():
    assert search_for(ALIKE[1], name="/dev/robot").next(ALIKE[1].device, [ALIKE[1]], 0.0) is None


def test_another_like_it_is_asked_before_one_is_taken():
    search = search_for()
    assert not take(search, ALIKE[1], ALIKE[1:]) and not search.rivals
    assert search.next("", ALIKE[1:], 0.0) == ALIKE[2].device
    search.refuse(ALIKE[2].device, 0.0)
    assert search.next("", ALIKE[1:], 0.0) == ALIKE[1].device
    assert take(search, ALIKE[1], ALIKE[1:])


def test_none_of_two_that_answer_is_taken_until_one_is_unplugged():
    search = search_for()
    for port in ALIKE[1:]:
        assert not take(search, port, ALIKE[1:])
    assert search.rivals == [port.device for port in ALIKE[1:]]
    assert search.next("", ALIKE[1:], 0.5) is None
    assert search.next("", [ALIKE[2]], 0.5) == ALIKE[2].device
    assert take(search, ALIKE[2], [ALIKE[2]])


# -- what is in use


@pytest.fixture
def terminal():
    """A terminal that somebody works in: a process has it as controlling terminal."""
    script = "import sys; print(1, flush=True); sys.stdin.readline()"
    pid, master = pty.fork()
    if not pid:
        os.execv(sys.executable, [sys.executable, "-c", script])
    os.read(master, 1)
    yield os.readlink(f"/proc/{pid}/fd/0")
    os.write(master, b"\n")
    os.waitpid(pid, 0)
    os.close(master)


@contextlib.contextmanager
def on_another_file_system(monkeypatch, below):
    """Files below a path keep the numbers that they have, on another file system."""
    stat = os.stat

    def elsewhere(path):
        found = stat(path)
        return os.stat_result([*found[:2], found.st_dev + 1, *found[3:]]) if path.startswith(below) else found

    with monkeypatch.context() as patch:
        patch.setattr(link.os, "stat", elsewhere)
        yield


def test_a_pseudo_terminal_that_somebody_works_in_is_in_use(terminal):
    """A name of before may lead there by now."""
    assert opened_by(terminal)


def test_a_pseudo_terminal_is_not_in_use_for_one_of_its_number_in_a_container(terminal, monkeypatch):
    with on_another_file_system(monkeypatch, "/proc/"):
        used = opened_by(terminal)
    assert not used


def test_a_lock_on_another_file_with_the_ports_inode_number_is_not_the_ports(tmp_path, monkeypatch):
    with open(tmp_path / "port", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with on_another_file_system(monkeypatch, str(tmp_path)):
            holder = locked_by(file.name)
    assert holder == ""


@contextlib.contextmanager
def held(port):
    """Another program has opened the port; its process id."""
    with open(port, "rb", buffering=0, opener=opener) as file, subprocess.Popen(
        [sys.executable, "-c", "print(flush=True), input()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=[file.fileno()],
    ) as program:
        program.stdout.readline()
        file.close()
        yield program.pid
        program.communicate(b"\n")


def opener(path, flags):
    return os.open(path, flags | os.O_NOCTTY)


@pytest.fixture
def pseudo_terminal():
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_device_that_another_program_holds_is_in_use():
    with held("/dev/full") as number:
        assert opened_by("/dev/full").endswith(f"(process {number})")


def test_a_port_that_another_program_has_open_is_not_opened(pseudo_terminal):
    """Each would get a part of the board's bytes, and no lock keeps out a program that asks for none."""
    with held(pseudo_terminal) as number, pytest.raises(PortBusy, match=rf"in use by .*\(process {number}\)"):
        link.SerialLink(pseudo_terminal)
    link.SerialLink(pseudo_terminal).close()


def test_an_emulator_in_another_process_is_no_other_program():
    script = "import os; master, slave = os.openpty(); print(os.ttyname(slave), flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as emulator:
        assert opened_by(emulator.stdout.readline().strip()) == ""
        emulator.communicate("\n")
