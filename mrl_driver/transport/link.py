"""The serial port: bytes in, bytes out, and errors that say what to do.  pyserial opens it.

Reading and writing use poll, `os.read` and `os.write` on the descriptor.  This costs half of pyserial's own calls and
never waits longer than requested.
"""

import contextlib
import errno
import fcntl
import os
import select
import stat
import termios
import threading
import time
from typing import Dict, Optional, Protocol, Type

import serial

from mrl_driver.errors import BoardTimeout, LinkError, LinkLost, PortBusy, PortDenied, PortMissing, shortage
from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.table import BAUD

from . import fork_guard
from .port_info import PTY_MAJORS, is_terminal, locked_by, not_pyserial, opened_by, opening_group, ports

if not hasattr(serial, "Serial"):
    raise not_pyserial()

# If a port accepts no bytes for this time, that is an error [s].  Frames are short, and the system buffers thousands of
# bytes.
WRITE_TIMEOUT_S = 0.1
READ_SIZE = 4096  # largest number of bytes that a terminal returns at once
LOCKS = ("link read", "link write", "link wake")
_ERRORS: Dict[int, Type[LinkError]] = {
    **dict.fromkeys((errno.ENOENT, errno.ENOTTY, errno.EINVAL, errno.EISDIR), PortMissing),
    **dict.fromkeys((errno.EACCES, errno.EPERM), PortDenied),
    **dict.fromkeys((errno.EBUSY, errno.EAGAIN), PortBusy),
}


class Link(Protocol):
    """A connection to a board.  One thread may read while others write, and any thread may wake or close it."""

    port: str  # the name that was opened

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived; empty after `close`.

        Waits at most `timeout_s` for a first byte [s]; `wake` ends the wait.

        Raises:
            LinkLost: the port went away.
        """

    def write(self, data: bytes) -> None:
        """Send all of `data`.  No lock is held while the port blocks.

        Raises:
            BoardTimeout: the port accepted no bytes for 100 ms; earlier bytes may have been sent.
            LinkLost: the port went away, or the link is closed.
        """

    def wake(self) -> None:
        """Make a waiting `read` return at once."""
        return  # by default nobody waits

    def close(self) -> None:
        """Close the port.  A `read` in another thread returns at once with no bytes."""
        return  # by default nothing is open

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when data arrive; raise LinkError if there is none."""
        raise LinkError(f"{self.port} has no descriptor")

    def set_baud(self, baud: int) -> None:
        """Change the port's speed after all bytes have been sent.

        Raises:
            LinkError: the speed of this link cannot be changed.
            LinkLost: the port went away.
        """
        raise LinkError(f"{self.port} has no speed that can be set from here: set it at the other end")


class DescriptorLink(Link):
    """A link over one descriptor that never blocks."""

    def _begin(self, port: str, fd: int) -> None:
        """Use `fd`, an open descriptor that never blocks.  If that fails, it is closed."""
        self.port, self._fd = port, fd
        self.closed, self._open = False, True
        try:
            self._make_locks()
            self._wake_out, self._wake_in = os.pipe()
        except BaseException:
            self._release()
            raise
        os.set_blocking(self._wake_in, False)
        self._poll = select.poll()
        for each in (fd, self._wake_out):
            self._poll.register(each, select.POLLIN)
        fork_guard.leave_to_parent(self._abandon)

    def _make_locks(self) -> None:
        self._reading, self._writing, self._waking = map(new_lock, LOCKS)
        self._writer_done = threading.Condition(self._writing)
        self._writer: Optional[int] = None  # thread that writes

    def _abandon(self) -> None:
        """In a forked child: close the copies of the descriptors; port, TIOCEXCL and lock stay with the parent."""
        if self._open:
            self.closed, self._open = True, False
            self._make_locks()
            os.close(self._wake_in)
            os.close(self._wake_out)
            self._release()

    def read(self, timeout_s: float) -> bytes:
        with self._reading:
            if self.closed:
                return b""
            data = b""
            for fd, _ in self._poll.poll(max(0.0, timeout_s) * 1000):
                if fd == self._wake_out:
                    os.read(fd, 4096)
                elif not self.closed:
                    try:
                        data = os.read(fd, READ_SIZE)
                    except BlockingIOError:
                        return b""
                    except OSError as error:
                        raise self._lost(error.strerror or str(error)) from None
                    if not data:
                        self._end_of_data()
            return data

    def _end_of_data(self) -> None:
        raise self._lost("hung up")

    def write(self, data: bytes) -> None:
        thread = threading.get_ident()
        interrupted = self._writer == thread  # this write is a signal handler's
        try:
            with self._writing:
                while self._writer not in (None, thread):  # frames of two threads never mix
                    if not self._writer_done.wait(WRITE_TIMEOUT_S):
                        raise BoardTimeout(
                            f"{self.port}: another write has blocked for {WRITE_TIMEOUT_S * 1000:.0f} ms"
                        )
                self._writer = thread
            self._send(data)
        finally:
            with self._writing:
                if self._writer == thread and not interrupted:
                    self._writer = None
                    self._writer_done.notify()

    def _send(self, data: bytes) -> None:
        """Send all of `data`; no other thread writes meanwhile.  `_unsent` is the rest."""
        deadline_s, self._unsent = time.monotonic() + WRITE_TIMEOUT_S, data
        while self._unsent:
            with self._writing:
                if self.closed:
                    raise LinkLost(f"{self.port} is closed")
                try:
                    self._unsent = self._unsent[os.write(self._fd, self._unsent) :]
                    continue
                except BlockingIOError:
                    pass
                except OSError as error:
                    raise self._lost(error.strerror or str(error)) from None
            room, left_s = select.poll(), deadline_s - time.monotonic()
            room.register(self._fd, select.POLLOUT)
            if left_s <= 0 or not room.poll(left_s * 1000):
                raise self._stalled()

    def _stalled(self) -> BoardTimeout:
        return BoardTimeout(
            f"{self.port} has accepted no data for {WRITE_TIMEOUT_S * 1000:.0f} ms: "
            "the board is stalled; check its cable and power"
        )

    def wake(self) -> None:
        with self._waking:
            if self._open:
                with contextlib.suppress(BlockingIOError):  # the pipe is full of wake-ups already
                    os.write(self._wake_in, b"\0")

    def close(self) -> None:
        self.closed = True
        self.wake()
        with self._reading, self._writing, self._waking:
            if not self._open:  # not `closed`: Ctrl-C may have ended an earlier close while it waited
                return
            self._open = False
            try:
                self._give_back()
            finally:
                os.close(self._wake_in)
                os.close(self._wake_out)

    def _give_back(self) -> None:
        """Close the descriptor that `_begin` was given."""
        self._release()

    def _release(self) -> None:
        """Close this process's descriptors."""
        raise NotImplementedError

    def fileno(self) -> int:
        return self._fd

    def _lost(self, why: str) -> LinkLost:
        return LinkLost(f"{self.port} went away ({why}): check the cable and the board's power")


class SerialLink(DescriptorLink):
    """An open serial port that no other program may open.

    Raises:
        PortMissing: there is no such port, or it is not a serial port.
        PortDenied: this user has no permission.
        PortBusy: another program uses it.
        LinkError: the port refuses its settings.
    """

    def __init__(self, port: str, baud: int = BAUD) -> None:
        require_device(port)
        holder = opened_by(port) if is_terminal(port) else ""
        if holder:
            raise busy(port, holder)
        self._serial = _open(port, baud)
        self._begin(port, self._serial.fileno())
        _exclude(self._fd, True)

    def _end_of_data(self) -> None:
        """Without a hang-up, another program has taken the bytes that were there."""
        poll = select.poll()
        poll.register(self._fd, 0)
        if poll.poll(0):
            super()._end_of_data()

    def _give_back(self) -> None:
        try:
            _drop_unsent(self._serial)
            _exclude(self._fd, False)
        finally:
            self._release()

    def _release(self) -> None:
        self._serial.close()

    def set_baud(self, baud: int) -> None:
        try:
            _drop_unsent(self._serial)
            if not self._serial.out_waiting:  # otherwise the adapter hangs, and this would wait for ever
                self._serial.flush()
            self._serial.baudrate = baud
        except (TypeError, ValueError, OSError, termios.error) as error:  # TypeError: it was closed
            raise self._lost(_words(error)) from None


def require_device(port: str) -> None:
    """Raise PortMissing unless `port` is a character device; if its type cannot be read, do nothing."""
    try:
        mode = os.stat(port).st_mode
    except FileNotFoundError:
        where = "" if os.path.isabs(port) else f" in the folder {os.getcwd()}"
        raise PortMissing(f"{port!r} does not exist{where}; {_there_are()}") from None
    except (OSError, ValueError):
        return
    if not stat.S_ISCHR(mode):
        kind = "folder" if stat.S_ISDIR(mode) else "file"
        raise PortMissing(f"{port!r} is a {kind}, expected a serial port; {_there_are()}")


def _there_are() -> str:
    found = ports()
    return (
        f"ports there are: {', '.join(found)}"
        if found
        else "there is no serial port; is the board plugged in? Without one, mrl-sim serves an emulated robot"
    )


def _open(port: str, baud: int) -> serial.Serial:
    try:
        made = serial.Serial(None, baud, exclusive=True)
        made.port = port
        try:
            made.open()
        except BaseException:
            with contextlib.suppress(Exception):  # pyserial 3.4 has not opened what it closes here
                made.close()
            raise
        return made
    except ValueError as error:
        raise LinkError(
            f"{port}: baud rate {baud!r} is refused ({error}), expected one such as {BAUD}"
        ) from None
    except (OSError, termios.error) as error:
        raise _explain(port, error) from None


def _explain(port: str, error: Exception) -> LinkError:
    if shortage(error):
        return LinkError(f"{port} cannot be opened: {shortage(error)}")
    kind = _ERRORS.get(_errno(error))
    if kind is PortBusy:
        return busy(port, locked_by(port))
    if _errno(error) == errno.EPERM:
        return PortDenied(
            f"this container may not use {port}: pass the device to it, with docker run --device, and again after it "
            "was unplugged"
        )
    if kind is PortDenied:
        return PortDenied(denied(port))
    if kind is PortMissing:
        return PortMissing(f"{port!r} is not a serial port; {_there_are()}")
    return LinkError(
        f"{port} cannot be opened, because its device does not answer ({_words(error)}): unplug it and plug it in "
        "again; in a container, pass the device to it again"
    )


def denied(port: str) -> str:
    """Return why this user may not open a port, and what to do."""
    group = opening_group(port)
    if not group:
        advice = 'let udev give serial ports to a group: sudo "$(which mrl)" system install'
        return f"only root may open {port}; {advice}"
    return (
        f"no permission for {port}; join its group with: sudo usermod -aG {group} $USER, then log out and in"
    )


def busy(port: str, holder: str, more: str = "") -> PortBusy:
    """Return the error for a port that another program has open, or this one."""
    if holder.endswith(f"(process {os.getpid()})"):
        return PortBusy(f"{port} is open in this program already; close what has it open, such as a Driver")
    return PortBusy(
        f"{port} is in use by {holder or 'another program'}{more}; end that program, or choose another port"
    )


def _errno(error: BaseException) -> int:
    """Return the system's error number from the arguments of a pyserial error or its cause; 0 if unknown."""
    seen: Optional[BaseException] = error
    while seen is not None:
        for number in seen.args:
            if isinstance(number, int):
                return number
        seen = seen.__context__
    return 0


def _words(error: BaseException) -> str:
    number = _errno(error)
    return os.strerror(number) if number else " ".join(str(error).split())


def _drop_unsent(port: serial.Serial) -> None:
    """Discard the bytes that an adapter that hangs has not accepted; otherwise `close` would wait up to 30 s."""
    try:
        before, since_s = port.out_waiting, time.monotonic()
        while before and time.monotonic() < since_s + WRITE_TIMEOUT_S:
            time.sleep(0.002)
            left = port.out_waiting
            if left < before:
                before, since_s = left, time.monotonic()
        if before:
            port.reset_output_buffer()
    except (OSError, termios.error):
        return


def _exclude(fd: int, on: bool) -> None:
    """Set or clear TIOCEXCL, which also keeps out programs that do not use locks.

    A pseudo terminal is not changed: its server keeps it open, so the flag would remain after a killed driver.
    """
    if os.major(os.fstat(fd).st_rdev) in PTY_MAJORS:
        return
    with contextlib.suppress(OSError):
        fcntl.ioctl(fd, termios.TIOCEXCL if on else termios.TIOCNXCL)
