"""Which ports are opened in the search for a lost robot, and in which order."""

import contextlib
import fcntl
import os
import pty
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import PortBusy
from mrl_driver.transport import link, port_info
from mrl_driver.transport.port_info import Port, locked_by, opened_by
from mrl_driver.transport.reconnect import Search, candidates

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
        ((SISTER, SISTER._replace(device=BY_ID)), {"name": BY_ID}, [BY_ID, SISTER.device]),
    ],
    ids=["name of before", "moved", "name taken", "foreign under the name", "no USB ids", "told by link"]
    + ["told by socket", "name is a link", "one of two others"],
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


def test_a_device_whose_socket_is_unknown_is_told_by_its_link():
    plain = ROBOT._replace(serial=None)
    assert plain.is_same(plain._replace(location="1-2")) and plain._replace(location="1-2").is_same(plain)


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
    assert search.next(NAME, [ROBOT, SISTER], 6.0) == NAME


@pytest.mark.parametrize(
    "name, wrong, wait_s", [(NAME, False, 1.0), ("tcp://robot:7", False, 0.2), (NAME, True, 10.0)]
)
def test_a_port_is_tried_again_after_a_while_and_soon_where_that_resets_nothing(name, wrong, wait_s):
    search = Search(name, Port(name))
    search.refuse(name, 5.0, wrong)
    assert [search.next(name, [], 5.0 + each) for each in (wait_s - 0.01, wait_s)] == [None, name]


def test_another_robot_is_left_alone_until_it_was_unplugged():
    search = Search(NAME, ROBOT)
    search.refuse("/dev/ttyACM1", 5.0, wrong=True)
    search.refuse(NAME, 5.0, wrong=True)
    assert search.next(NAME, [SISTER], 14.9) is None and search.next(NAME, [SISTER], 1e6) == NAME
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
    assert search.next("/dev/pts/3", [], 0.2) == search.next("/dev/pts/4", [], 0.2) == "/dev/robot"


def search_for(*others, name=LOST.device):
    return Search(name, LOST, others, lambda name: name != LOST.device)


def take(search, port, there):
    return search.take(port.device, port, LOST.device, there)


def test_a_port_that_was_there_beside_the_robot_is_never_opened():
    assert search_for(ALIKE[1]).next(LOST.device, [ALIKE[1]], 0.0) is None
    assert search_for(ALIKE[1]).next(LOST.device, ALIKE[1:], 0.0) == ALIKE[2].device


def test_a_link_that_leads_to_another_port_by_now_is_not_opened():
    assert search_for(ALIKE[1], name="/dev/robot").next(ALIKE[1].device, [ALIKE[1]], 0.0) is None
    assert search_for(name="/dev/robot").next(ALIKE[1].device, [ALIKE[1]], 0.0) == "/dev/robot"


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


@pytest.mark.parametrize(
    "changes, rival, is_taken",
    [
        ({}, "A1", True),
        ({"location": "1-9"}, "A1", False),
        ({"location": "1-9"}, "B2", True),
        ({"serial": "B2"}, "A1", False),
    ],
    ids=["socket of before", "another socket", "alone with its number", "another number"],
)
def test_of_two_that_may_be_the_robot_the_one_in_its_socket_is_taken_at_once(changes, rival, is_taken):
    search, port = (
        Search(NAME, PLACED, exists=lambda name: name != NAME),
        PLACED._replace(device="/dev/ttyACM3", **changes),
    )
    there = [port, PLACED._replace(device="/dev/ttyACM5", location="1-5", serial=rival)]
    assert search.take(port.device, port, NAME, there) is is_taken


# -- what is in use


@pytest.fixture
def terminal():
    """A terminal that somebody works in: a process has it as controlling terminal."""
    script = "open('/proc/self/comm', 'w').write('a) b'); print(1, flush=True); input()"
    pid, master = pty.fork()
    if not pid:
        os.execv(sys.executable, [sys.executable, "-c", script])
    os.read(master, 1)
    yield os.readlink(f"/proc/{pid}/fd/0")
    os.write(master, b"\n")
    os.waitpid(pid, 0)
    os.close(master)


@contextlib.contextmanager
def on_another_file_system(monkeypatch, pattern):
    """Files of a pattern keep the numbers that they have, on another file system."""
    stat = os.stat

    def elsewhere(path):
        found = stat(path)
        return os.stat_result([*found[:2], found.st_dev + 1, *found[3:]]) if fnmatch(path, pattern) else found

    with monkeypatch.context() as patch:
        patch.setattr(link.os, "stat", elsewhere)
        yield


def test_a_pseudo_terminal_that_somebody_works_in_is_in_use(terminal):
    """A name of before may lead there by now."""
    assert opened_by(terminal).startswith("a) b (process ")


def test_a_pseudo_terminal_is_not_in_use_for_one_of_its_number_of_another_container(terminal, monkeypatch):
    """A shell in a chroot or a container may work in a terminal of the host."""
    with on_another_file_system(monkeypatch, "/proc/*/fd/*"):
        used = opened_by(terminal)
    assert not used


def test_a_lock_on_another_file_with_the_ports_inode_number_is_not_the_ports(tmp_path, monkeypatch):
    with open(tmp_path / "port", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with on_another_file_system(monkeypatch, f"{tmp_path}/*"):
            holder = locked_by(file.name)
    assert holder == ""


@pytest.mark.parametrize("error, is_used", [(FileNotFoundError, False), (PermissionError, True)])
def test_a_terminal_that_another_user_works_in_may_be_in_use(terminal, monkeypatch, error, is_used):
    """What the process has open cannot be seen, unless it has ended."""

    def hidden(path):
        if path.startswith("/proc/"):
            raise error
        return listdir(path)

    listdir = os.listdir
    with monkeypatch.context() as patch:
        patch.setattr(port_info.glob, "glob", lambda pattern: [])
        patch.setattr(port_info.os, "listdir", hidden)
        used = opened_by(terminal)
    assert bool(used) is is_used


def test_a_port_is_described_by_what_the_system_says(monkeypatch, tmp_path):
    device, by_id = str(tmp_path / "ttyACM9"), str(tmp_path / "usb-Arduino_A1")
    os.symlink(device, by_id)
    there = [
        SimpleNamespace(device=each, vid=0x2341, pid=0x43, serial_number="A1", location="1-2")
        for each in (device, "/dev/ttyACM8")
    ]
    monkeypatch.setattr(port_info, "_comports", lambda: there)
    monkeypatch.setattr(port_info.glob, "glob", {"/dev/serial/by-id/*": [by_id]}.get)
    assert port_info.describe(by_id) == Port(device, (by_id,), 0x2341, 0x43, "A1", "1-2")
    assert port_info.described()[1] == Port("/dev/ttyACM8", (), 0x2341, 0x43, "A1", "1-2")
    assert port_info.ports() == ["/dev/ttyACM8", device]
    assert port_info.describe("/dev/not there") == Port("/dev/not there")


def test_what_is_told_of_a_port(pseudo_terminal):
    facts = port_info.facts_of(Port(pseudo_terminal, (BY_ID, "/dev/serial/by-id/x"), 0x2A03, 0x43, "A1"))
    assert facts[:-1] == (pseudo_terminal, "Arduino Uno R3", True, BY_ID, "2a03:0043", "A1", "", True)
    nothing = ("/dev/not there", "serial port", False, "", "", "", "", False, "")
    assert port_info.facts_of(Port(nothing[0])) == nothing and port_info.group_of("/dev/null") == "root"
    kinds = [port_info.text_of(vendor, 0x9999) for vendor in (0x2341, 0x2A03, 0x1546)]
    assert kinds == ["Arduino board", "Arduino board", "unknown USB device"]


def test_terminals_are_told_from_other_devices_and_from_files():
    names = ("/dev/tty", "/dev/null", "/dev/not there")
    assert list(map(port_info.is_terminal, names)) == [True, False, False]
    assert opened_by(__file__) == opened_by(names[2]) == port_info.opening_group(names[2]) == ""


@pytest.mark.parametrize(
    "text, is_used", [("{:10}\n", True), ("4194305\n", False), ("9" * 30, False), ("me\n", False)]
)
def test_a_lock_file_counts_while_its_program_runs(monkeypatch, tmp_path, pseudo_terminal, text, is_used):
    monkeypatch.setattr(port_info, "_LOCK_FOLDERS", (str(tmp_path / "none"), str(tmp_path)))
    (tmp_path / f"LCK..{os.path.basename(pseudo_terminal)}").write_text(text.format(os.getpid()))
    used = port_info.user_of(pseudo_terminal)
    assert (f" (process {os.getpid()})" in used, bool(used)) == (is_used, is_used)


def test_a_property_of_udev_may_have_an_equals_sign_in_its_value(monkeypatch):
    said = {"/run/udev/data/c1:3": "S:serial/by-id/x\nE:ID_MODEL=a=b c\nE:ID_BUS=usb\n"}
    monkeypatch.setattr(port_info, "read_text", said.get)
    assert port_info.udev_properties("/dev/null") == {"ID_MODEL": "a=b c", "ID_BUS": "usb"}


def test_a_file_of_the_system_is_read_as_far_as_it_can_be(tmp_path):
    assert port_info.read_text(str(tmp_path / "none")) == ""
    (tmp_path / "comm").write_bytes(b"r\xffs\n")
    assert port_info.read_text(str(tmp_path / "comm")) == "r\ufffds\n"


def test_programs_are_found_by_their_name():
    name = Path("/proc/self/comm").read_text().rstrip("\n")
    assert os.getpid() in port_info.programs_named(name) and port_info.programs_named(name + "?") == []


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
    with open("/dev/full", "rb"):
        assert opened_by("/dev/full") == ""
    with held("/dev/full") as number:
        assert port_info.user_of("/dev/full").endswith(f"(process {number})")


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
