"""Every transport offers what `Link` says."""

import contextlib
import errno
import fcntl
import inspect
import os
import re
import struct
import termios
import threading
import time
import tty

import pytest

from mrl_driver.driver.simulated import SteppedLink
from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, MrlError, PortBusy, PortDenied, PortMissing
from mrl_driver.recording.recorded_link import RecordedLink
from mrl_driver.transport.link import Link, SerialLink
from mrl_driver.transport.pyserial_link import UrlLink
from mrl_driver.transport.sockets import TcpLink, UdpLink
from tests.waiting import PATIENCE_S, require_median

TIOCGEXCL = 0x80045440  # Linux tells the mark that TIOCEXCL sets
LONG_S = 3600.0  # A read that nothing ends would outlast the test
LATE_S = 0.05  # A wait that nothing ends may last so much longer than asked
GIVEN_UP_S, RUNS, CLOSE_S = 0.1, 5, 1.0
"""A blocked write is given up after this time; the median of so many; the longest close."""


@pytest.fixture
def pty():
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for fd in (master, slave):
        try:
            os.close(fd)
        except OSError:
            pass


def in_thread(work):
    """Run `work` aside; the list gets its result or error."""
    results = []

    def run():
        try:
            results.append(work())
        except MrlError as error:
            results.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread, results


def timed(work):
    """How long it takes [s]."""
    start_s = time.monotonic()
    work()
    return time.monotonic() - start_s


@pytest.mark.realtime
def test_reading_waits_as_long_as_asked(pty):
    link = SerialLink(pty[1])
    times = [timed(lambda: link.read(0.1)) for _ in range(RUNS)]
    assert 0.1 - 0.001 <= min(times), times
    require_median(times, 0.1 + LATE_S, "a read of 0.1 s")
    link.close()


def test_wake_ends_a_wait(pty):
    link = SerialLink(pty[1])
    thread, results = in_thread(lambda: link.read(LONG_S))
    link.wake()
    thread.join(PATIENCE_S)
    assert results == [b""]
    link.close()


def test_closing_wakes_the_reader_without_an_error(pty):
    link = SerialLink(pty[1])
    thread, results = in_thread(lambda: link.read(LONG_S))
    time.sleep(0.01)
    link.close()
    thread.join(PATIENCE_S)
    assert results == [b""]


def test_a_closed_link_reads_nothing_and_cannot_write(pty):
    link = SerialLink(pty[1])
    link.close()
    link.close()
    link.wake()
    assert link.read(1.0) == b""
    with pytest.raises(LinkLost, match="is closed"):
        link.write(b"@13e")


def test_a_hang_up_is_a_lost_link(pty):
    link = SerialLink(pty[1])
    thread, results = in_thread(lambda: link.read(LONG_S))
    os.close(pty[0])
    thread.join(PATIENCE_S)
    assert isinstance(results[0], LinkLost) and "went away" in str(results[0])
    link.close()


def test_bytes_that_another_program_took_are_no_hang_up(pty, monkeypatch):
    """They were there, and are not any more when this program reads them."""
    link, read = SerialLink(pty[1]), os.read

    def second(fd, size):
        if fd == link.fileno():
            read(fd, size)
        return read(fd, size)

    os.write(pty[0], b"@8,1e")
    monkeypatch.setattr(os, "read", second)
    assert link.read(LONG_S) == b""
    monkeypatch.undo()
    os.write(pty[0], b"@5e")
    assert link.read(LONG_S) == b"@5e"
    link.close()


def test_a_port_that_cannot_be_read_is_a_lost_link(pty, monkeypatch):
    """As some USB drivers tell an unplugged cable."""
    link, read = SerialLink(pty[1]), os.read

    def fail(fd, size):
        if fd == link.fileno():
            raise OSError(errno.EIO, "Input/output error")
        return read(fd, size)

    os.write(pty[0], b"@")
    monkeypatch.setattr(os, "read", fail)
    with pytest.raises(LinkLost, match="went away \\(Input/output error\\)"):
        link.read(LONG_S)
    link.close()


def test_writing_to_a_lost_port_is_a_lost_link(pty):
    link = SerialLink(pty[1])
    os.close(pty[0])
    with pytest.raises(LinkLost):
        link.write(b"@13e")
    link.close()


@pytest.mark.realtime
def test_a_write_that_blocks_is_given_up(pty):
    link = SerialLink(pty[1])

    def write():
        with pytest.raises(BoardTimeout, match="has accepted no data"):
            link.write(bytes(1 << 20))

    times = [timed(write) for _ in range(RUNS)]
    assert GIVEN_UP_S - 0.001 <= min(times), times
    require_median(times, GIVEN_UP_S + LATE_S, "giving up a write")
    link.close()


def test_writes_of_two_threads_stay_whole(pty, monkeypatch):
    """Even where the port takes them byte by byte."""
    monkeypatch.setattr("mrl_driver.transport.link.WRITE_TIMEOUT_S", PATIENCE_S)  # of a machine that is busy
    link, write = SerialLink(pty[1]), os.write
    monkeypatch.setattr(
        os, "write", lambda fd, data: write(fd, data[:1]) if time.sleep(0.0002) is None else 0
    )
    threads = [
        in_thread(lambda text=text: [link.write(text) for _ in range(20)]) for text in (b"@1111e", b"@2222e")
    ]
    for thread, _ in threads:
        thread.join()
    received = b""
    while len(received) < 40 * 6:
        received += os.read(pty[0], 4096)
    frames = received.split(b"e")[:-1]
    assert len(frames) == 40 and set(frames) == {b"@1111", b"@2222"}
    link.close()


def test_a_write_in_a_signal_handler_does_not_wait_for_the_write_that_it_interrupts(pty, monkeypatch):
    """That one cannot go on before the handler returns.  Its frame may be cut, which the '@' of the next one ends."""
    link, write, handlers = SerialLink(pty[1]), os.write, []

    def interrupted(fd, data):
        if handlers and data != b"@13e":
            handlers.pop()()
        return write(fd, data)

    monkeypatch.setattr(os, "write", interrupted)
    handlers.append(lambda: link.write(b"@13e"))
    link.write(b"@5e")
    received = b""
    while len(received) < len(b"@13e@5e"):
        received += os.read(pty[0], 64)
    assert received == b"@13e@5e"
    link.close()


def test_a_serial_port_is_marked_exclusive_while_it_is_open(pty, monkeypatch):
    """The mark keeps out programs that do not lock; root alone gets in, so the mark itself is asked for."""
    monkeypatch.setattr("mrl_driver.transport.link.PTY_MAJORS", ())
    observer = os.open(pty[1], os.O_RDWR | os.O_NOCTTY)
    marks = []
    link = SerialLink(pty[1])
    for _ in range(2):
        marks.append(struct.unpack("i", fcntl.ioctl(observer, TIOCGEXCL, bytes(4)))[0])
        link.close()
    os.close(observer)
    assert marks == [1, 0]


def test_a_second_program_is_refused_by_name(pty):
    link = SerialLink(pty[1])
    with pytest.raises(PortBusy, match=rf"in use by .*\(process {os.getpid()}\)"):
        SerialLink(pty[1])
    link.close()


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/nowhere/x", "does not exist"),
        ("ttyNONE0", f"does not exist in the folder {re.escape(os.getcwd())}"),
        ("/dev", "is a folder"),
        (__file__, "a plain file"),
        ("/dev/null", "is not a serial port"),
    ],
)
def test_the_message_says_what_it_is_and_what_there_is(path, words):
    with pytest.raises(PortMissing, match=f"{words}(, expected a serial port)?; (ports )?there (are|is)"):
        SerialLink(path)


@pytest.mark.parametrize(
    "mode, group, words",
    [
        *((0o620, "dialout", "only root"), (0o660, "root", "only root"), (0o600, "dialout", "only root")),
        *((0o660, "dialout", "usermod -aG dialout "), (0o660, "uucp", "usermod -aG uucp ")),
    ],
)
def test_a_denied_port_names_the_group_that_may_open_it(pty, monkeypatch, mode, group, words):
    def deny(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.Serial", deny)
    monkeypatch.setattr("mrl_driver.transport.port_info.group_of", lambda device: group)
    os.chmod(pty[1], mode)
    with pytest.raises(PortDenied, match=words):
        SerialLink(pty[1])


@pytest.mark.parametrize(("left", "flushes"), [([100] * 1000, 1), ([3, 2, 1, 0], 0)])
def test_a_close_waits_only_while_the_adapter_takes_what_was_sent(pty, monkeypatch, left, flushes):
    """For one that hangs the system would wait 30 s."""
    link, flushed, sizes = SerialLink(pty[1]), [], iter(left)
    monkeypatch.setattr("mrl_driver.transport.link.unsent", lambda fd: next(sizes))
    monkeypatch.setattr(termios, "tcflush", lambda fd, what: flushed.append(what))
    link.close()
    assert flushed == [termios.TCOFLUSH] * flushes


def test_a_change_of_speed_does_not_wait_for_an_adapter_that_hangs(pty, monkeypatch):
    """Nor for one that has nothing to flush; the driver's lock is held meanwhile, and a stop would wait with it."""
    drained = []
    monkeypatch.setattr("mrl_driver.transport.link.unsent", lambda fd: 100)
    monkeypatch.setattr(termios, "tcdrain", drained.append)
    with contextlib.closing(SerialLink(pty[1])) as link:
        link.set_baud(57600)
    assert drained == []


def test_a_port_marked_exclusive_is_busy(pty, monkeypatch):
    def busy(*_, **__):
        raise OSError(16, "Device or resource busy")

    monkeypatch.setattr("serial.Serial", busy)
    with pytest.raises(PortBusy):
        SerialLink(pty[1])


@pytest.mark.parametrize(
    "number", [errno.EIO, errno.EPROTO, errno.EPIPE, errno.ENODEV, errno.ENXIO, errno.ETIMEDOUT]
)
@pytest.mark.parametrize("call", ["tcgetattr", "tcsetattr"])
def test_a_device_that_does_not_answer_is_a_port_and_must_be_plugged_in_again(pty, monkeypatch, call, number):
    """Whatever number the system gives for it: a cable that was pulled, or a node that a container got before."""

    def fail(*_):
        raise termios.error(number, os.strerror(number))

    monkeypatch.setattr(termios, call, fail)
    with pytest.raises(LinkError, match="does not answer .*unplug it and plug it in again") as raised:
        SerialLink(pty[1])
    assert not isinstance(raised.value, PortMissing) and os.strerror(number) in str(raised.value)


def test_a_port_that_the_container_may_not_open_is_denied_without_a_group(pty, monkeypatch):
    """Its mode permits it, and the system does not: the rights of devices are the container's."""

    def deny(*_, **__):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr("serial.Serial", deny)
    with pytest.raises(PortDenied, match="this container may not use") as raised:
        SerialLink(pty[1])
    assert "dialout" not in str(raised.value)


@pytest.mark.parametrize("baud", [-1, "fast"])
def test_a_baud_rate_that_is_none_is_refused(pty, baud):
    with pytest.raises(LinkError, match="baud rate"):
        SerialLink(pty[1], baud)


@pytest.mark.realtime
def test_many_closes_during_reads(pty):
    times = []
    for _ in range(50):
        link = SerialLink(pty[1])
        thread, results = in_thread(lambda link=link: link.read(LONG_S))
        times.append(timed(link.close))
        thread.join(PATIENCE_S)
        assert results == [b""]
    require_median([max(times)], CLOSE_S, "the longest close")


METHODS = [name for name, _ in inspect.getmembers(Link, inspect.isfunction) if not name.startswith("_")]


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("transport", [SerialLink, TcpLink, UdpLink, UrlLink, RecordedLink, SteppedLink])
def test_a_transport_has_the_methods_of_a_link_with_their_parameters(transport, name):
    assert inspect.signature(getattr(transport, name)) == inspect.signature(getattr(Link, name))
