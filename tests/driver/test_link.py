"""Every transport offers what `Link` says."""

import contextlib
import errno
import fcntl
import inspect
import os
import re
import select
import struct
import termios
import threading
import time
import tty
from unittest import mock

import pytest

from mrl_driver.driver.simulated import SteppedLink
from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, MrlError, PortBusy, PortDenied, PortMissing
from mrl_driver.recording.recorded_link import RecordedLink
from mrl_driver.transport.link import Link, SerialLink
from mrl_driver.transport.pyserial_link import UrlLink
from mrl_driver.transport.sockets import TcpLink, UdpLink
from tests.shortage import opened
from tests.waiting import PATIENCE_S, require_median

TIOCGEXCL = 0x80045440  # Linux tells the mark that TIOCEXCL sets
LONG_S = 3600.0  # A read that nothing ends would outlast the test
CLOSE_S = 1.0  # Limit of the longest close


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


def test_reading_waits_as_long_as_asked(pty, monkeypatch):
    looked = mock.Mock(**{"poll.return_value": []})
    monkeypatch.setattr("mrl_driver.transport.link.select", mock.Mock(poll=lambda: looked))
    with contextlib.closing(SerialLink(pty[1])) as link:
        assert link.read(0.25) == link.read(-1.0) == b""
    assert looked.poll.mock_calls == [mock.call(250.0), mock.call(0.0)]


@pytest.mark.parametrize(
    "ends, data", [(lambda link, line: link.wake(), b""), (lambda link, line: os.write(line, b"@5e"), b"@5e")]
)
def test_a_read_waits_for_the_first_byte_or_until_it_is_woken(pty, ends, data):
    with contextlib.closing(SerialLink(pty[1])) as link:
        thread, results = in_thread(lambda: link.read(LONG_S))
        time.sleep(0.01)
        ends(link, pty[0])
        thread.join(PATIENCE_S)
        assert results == [data]


def test_wake_ups_that_nobody_reads_hold_up_nobody(pty):
    with contextlib.closing(SerialLink(pty[1])) as link:
        for _ in range(70000):  # more than a pipe takes
            link.wake()


def test_a_forked_child_has_nothing_of_the_link(pty):
    before = set(opened())
    with contextlib.closing(SerialLink(pty[1])) as link:
        own, child = set(opened()) - before, os.fork()
        if not child:
            os._exit(7 if link.read(LONG_S) == b"" and not own & set(opened()) else 1)
        assert os.WEXITSTATUS(os.waitpid(child, 0)[1]) == 7
        link.write(b"@5e")
        assert os.read(pty[0], 64) == b"@5e"


def test_closing_wakes_the_reader_without_an_error(pty):
    link = SerialLink(pty[1])
    thread, results = in_thread(lambda: link.read(LONG_S))
    time.sleep(0.01)
    link.close()
    thread.join(PATIENCE_S)
    assert results == [b""]


def test_a_closed_link_reads_nothing_and_can_neither_write_nor_change_its_speed(pty):
    link = SerialLink(pty[1])
    link.close()
    link.close()
    link.wake()
    assert link.read(1.0) == b""
    with pytest.raises(LinkLost, match="is closed"):
        link.write(b"@13e")
    with pytest.raises(LinkLost):
        link.set_baud(57600)


def test_a_hang_up_is_a_lost_link(pty):
    link = SerialLink(pty[1])
    thread, results = in_thread(lambda: link.read(LONG_S))
    os.close(pty[0])
    thread.join(PATIENCE_S)
    assert isinstance(results[0], LinkLost) and "went away" in str(results[0])
    link.close()


@pytest.mark.parametrize("blocks", [False, True])
def test_bytes_that_another_program_took_are_no_hang_up(pty, monkeypatch, blocks):
    """They were there, and are not any more when this program reads them."""
    link, read = SerialLink(pty[1]), os.read

    def second(fd, size):
        if fd == link.fileno():
            read(fd, size)
            if blocks:
                raise BlockingIOError
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


def test_a_write_that_blocks_is_given_up(pty, monkeypatch):
    """It waits for room as long as is left of its time."""
    now_s, waits = [5.0], []

    def wait(wait_ms):
        waits.append(wait_ms)
        now_s[0] = 5.0625 if len(waits) == 1 else 5.1
        return True

    room = mock.Mock(poll=wait)
    with contextlib.closing(SerialLink(pty[1])) as link, monkeypatch.context() as patch:
        patch.setattr(os, "write", mock.Mock(side_effect=BlockingIOError))
        patch.setattr("mrl_driver.transport.link.time", mock.Mock(monotonic=lambda: now_s[0]))
        patch.setattr(
            "mrl_driver.transport.link.select", mock.Mock(poll=lambda: room, POLLOUT=select.POLLOUT)
        )
        with pytest.raises(BoardTimeout, match="has accepted no data for 100 ms"):
            link.write(b"@5e")
        assert room.register.call_args == mock.call(link.fileno(), select.POLLOUT)
    assert waits == pytest.approx([100.0, 37.5])


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


def test_a_write_waits_for_room_and_no_other_goes_before_it(pty, monkeypatch):
    monkeypatch.setattr("mrl_driver.transport.link.WRITE_TIMEOUT_S", PATIENCE_S)
    link, size = SerialLink(pty[1]), 1 << 17
    thread, results = in_thread(lambda: link.write(bytes(size)))
    assert select.select([pty[0]], [], [], PATIENCE_S)[0]
    with monkeypatch.context() as patch, pytest.raises(
        BoardTimeout, match="another write has blocked for 1 ms"
    ):
        patch.setattr("mrl_driver.transport.link.WRITE_TIMEOUT_S", 0.001)
        link.write(b"@5e")
    received = b""
    while len(received) < size:
        received += os.read(pty[0], size)
    thread.join(PATIENCE_S)
    assert results == [None] and received == bytes(size)
    link.write(b"@5e")
    assert os.read(pty[0], 64) == b"@5e"
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


def test_a_port_that_cannot_be_marked_exclusive_is_used_without_the_mark(pty, monkeypatch):
    def refuse(fd, request, *args):
        if request in (termios.TIOCEXCL, termios.TIOCNXCL):
            raise OSError(errno.ENOTTY, "not supported")
        return ioctl(fd, request, *args)

    ioctl = fcntl.ioctl
    monkeypatch.setattr("mrl_driver.transport.link.PTY_MAJORS", ())
    monkeypatch.setattr("mrl_driver.transport.link.fcntl.ioctl", refuse)
    with contextlib.closing(SerialLink(pty[1])) as link:
        link.write(b"@5e")
    assert os.read(pty[0], 64) == b"@5e"


def test_a_second_program_is_refused_by_name(pty, monkeypatch):
    with contextlib.closing(SerialLink(pty[1])):
        holder = os.getpid()
        monkeypatch.setattr("os.getpid", lambda: 1)
        with pytest.raises(PortBusy, match=rf"^{pty[1]} is in use by .*\(process {holder}\); end that"):
            SerialLink(pty[1])


def test_a_program_is_not_told_to_end_itself(pty):
    """As in a notebook, whose cell is run twice."""
    words = f"^{pty[1]} is open in this program already; close "
    with contextlib.closing(SerialLink(pty[1])), pytest.raises(PortBusy, match=words):
        SerialLink(pty[1])


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/nowhere/x", "does not exist"),
        ("ttyNONE0", f"does not exist in the folder {re.escape(os.getcwd())}"),
        ("/dev", "is a folder"),
        (__file__, "is a file"),
        ("/dev/null", "is not a serial port"),
    ],
)
def test_the_message_says_what_it_is_and_what_there_is(path, words):
    with pytest.raises(PortMissing, match=f"{words}(, expected a serial port)?; (ports )?there (are|is)"):
        SerialLink(path)


@pytest.mark.parametrize(
    "there, words",
    [
        ([], "there is no serial port; is the board plugged in? Without one, mrl-sim serves "),
        (["/dev/ttyACM0", "/dev/ttyUSB1"], "ports there are: /dev/ttyACM0, /dev/ttyUSB1"),
    ],
)
def test_a_port_that_is_not_there_is_told_with_those_that_are(monkeypatch, there, words):
    monkeypatch.setattr("mrl_driver.transport.link.ports", lambda: there)
    with pytest.raises(PortMissing, match=f"^'/nowhere/x' does not exist; {re.escape(words)}"):
        SerialLink("/nowhere/x")


@pytest.mark.parametrize(
    "mode, group, words",
    [
        *((0o620, "dialout", "only root"), (0o660, "root", "only root"), (0o600, "dialout", "only root")),
        *((0o660, "dialout", "usermod -aG dialout "), (0o660, "uucp", "usermod -aG uucp ")),
    ],
)
def test_a_denied_port_names_the_group_that_may_open_it(pty, monkeypatch, mode, group, words):
    monkeypatch.setattr("serial.Serial", mock.Mock(side_effect=PermissionError(13, "Permission denied")))
    monkeypatch.setattr("mrl_driver.transport.port_info.group_of", lambda device: group)
    os.chmod(pty[1], mode)
    with pytest.raises(PortDenied, match=words):
        SerialLink(pty[1])


@pytest.mark.parametrize(("left", "flushes"), [([100] * 1000, 1), ([3, 2, 1, 0], 0)])
def test_a_close_waits_only_while_the_adapter_takes_what_was_sent(pty, monkeypatch, left, flushes):
    """For one that hangs the system would wait 30 s."""
    link, flushed, sizes = SerialLink(pty[1]), [], iter(left)
    monkeypatch.setattr("serial.Serial.out_waiting", property(lambda port: next(sizes)))
    monkeypatch.setattr(termios, "tcflush", lambda fd, what: flushed.append(what))
    link.close()
    assert flushed == [termios.TCOFLUSH] * flushes


def test_a_close_that_ctrl_c_ends_while_it_waits_for_the_adapter_frees_the_port(pty, monkeypatch):
    link = SerialLink(pty[1])
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("serial.Serial.out_waiting", property(mock.Mock(side_effect=KeyboardInterrupt)))
        link.close()
    SerialLink(pty[1]).close()


def test_a_close_goes_on_where_ctrl_c_has_ended_the_one_before(pty, monkeypatch):
    link = SerialLink(pty[1])
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(link, "wake", mock.Mock(side_effect=KeyboardInterrupt))
        link.close()
    link.close()
    SerialLink(pty[1]).close()


def test_a_change_of_speed_does_not_wait_for_an_adapter_that_hangs(pty, monkeypatch):
    """Nor for one that has nothing to flush; the driver's lock is held meanwhile, and a stop would wait with it."""
    drained, left = [], [100]
    monkeypatch.setattr("serial.Serial.out_waiting", property(lambda port: left[0]))
    monkeypatch.setattr(termios, "tcdrain", drained.append)
    with contextlib.closing(SerialLink(pty[1])) as link:
        link.set_baud(57600)
        assert drained == []
        left[0] = 0
        with pytest.raises(LinkLost, match=r"went away \(.*baud ?rate: -1.*\): check the cable"):
            link.set_baud(-1)
        assert drained == [link.fileno()]


@pytest.mark.parametrize(
    "number", [errno.EIO, errno.EPROTO, errno.EPIPE, errno.ENODEV, errno.ENXIO, errno.ETIMEDOUT]
)
@pytest.mark.parametrize("call", ["tcgetattr", "tcsetattr"])
def test_a_device_that_does_not_answer_is_a_port_and_must_be_plugged_in_again(pty, monkeypatch, call, number):
    """Whatever number the system gives for it: a cable that was pulled, or a node that a container got before."""

    def fail(*_):
        raise termios.error(number, os.strerror(number))

    monkeypatch.setattr(termios, call, fail)
    words = rf"does not answer \({os.strerror(number)}\): unplug it and plug it in again"
    with pytest.raises(LinkError, match=words) as raised:
        SerialLink(pty[1])
    assert not isinstance(raised.value, PortMissing)


@pytest.mark.parametrize(
    "number, kind, words",
    [
        (errno.EBUSY, PortBusy, "^{} is in use by another program; end that"),
        (errno.EPERM, PortDenied, "^this container may not use {}: pass the device to it"),
    ],
)
def test_a_port_that_is_marked_exclusive_or_not_the_containers_says_so(pty, monkeypatch, number, kind, words):
    """The mode of the second permits it, and the system does not: the rights of devices are the container's."""
    monkeypatch.setattr("serial.Serial", mock.Mock(side_effect=OSError(number, os.strerror(number))))
    with pytest.raises(kind, match=words.format(pty[1])):
        SerialLink(pty[1])


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
