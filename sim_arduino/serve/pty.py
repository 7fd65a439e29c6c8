"""The emulated USB port: a pseudo-terminal that behaves like a serial device and can be unplugged."""

import ctypes
import errno
import fcntl
import os
import re
import select
import struct
import termios
import tty
from typing import List, Optional, Tuple

from mrl_driver.errors import ConfigError, SimulatorError, shortages
from mrl_driver.protocol.table import BAUD

_IN_OPEN, _IN_CLOSE = 0x20, 0x08 | 0x10
_EVENT = struct.Struct("iIII")
READ_BYTES = 256
_RATES = {getattr(termios, name): int(name[1:]) for name in dir(termios) if re.match(r"B\d\d", name)}
"""Baud rates by their code."""
_RATES.update({0o010000: 250000, termios.B38400: BAUD})
"""The first code means "a custom rate".  The second is that of a pty on which no program has set a rate."""
EVERYTHING = 65536


class PtyPort:
    """A pty in raw mode; the host opens `path`.

    The port keeps a descriptor of the host's side, so that programs can open and close the port.  While it is closed,
    bytes from the board are lost, as on a real port.  Bytes are also lost if a program does not read and the buffer
    is full.
    """

    def __init__(self) -> None:
        self.path = ""  # the device that the host opens; it changes each time the port is plugged in
        self.dropped = 0  # number of lost bytes from the board
        self.master: Optional[int] = None  # descriptor of the board's side; None while unplugged
        self.watch: Optional[int] = None
        """Descriptor that is readable when a program opens or closes the port; None without inotify."""
        self.plug()

    def plug(self) -> None:
        """Plugs the device in, with another name than before."""
        if self.master is not None:
            return
        ends: List[int] = []
        try:
            with shortages("no pseudo terminal can be opened", SimulatorError):
                ends += os.openpty()
                if os.ttyname(ends[1]) == self.path:
                    ends += os.openpty()  # it has another name, because the first is still open
            self.master, self._slave = ends[-2:]
            del ends[-2:]
        finally:
            for end in ends:
                os.close(end)
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        self._settings = termios.tcgetattr(self._slave)
        self.path = os.ttyname(self._slave)
        self._clients = 0
        self._left, self._read_baud = b"", BAUD
        self.watch = _watch(self.path)

    def unplug(self) -> None:
        """Unplugs the device; a program that has it open gets an error."""
        if self.master is None:
            return
        for descriptor in (self.master, self._slave, self.watch):
            if descriptor is not None:
                os.close(descriptor)
        self.master = self.watch = None

    @property
    def plugged(self) -> bool:
        """Whether the device is plugged in."""
        return self.master is not None

    @property
    def baud(self) -> int:
        """Baud rate that the host has set, with which the next bytes of `read` came; 115200 if it has set none."""
        return self._read_baud if self._left else self._host_baud

    @property
    def _host_baud(self) -> int:
        return _RATES.get(termios.tcgetattr(self._slave)[5], BAUD) if self.plugged else BAUD

    @property
    def is_open(self) -> bool:
        """Whether a program has the port open; always true without inotify."""
        return self.master is not None and (self._clients > 0 or self.watch is None)

    def newly_opened(self) -> bool:
        """Counts the programs that opened or closed the port; True if it was closed before and is open now."""
        newly, events = False, list(_events(self.watch))
        for number, opened in enumerate(events, 1):
            self._clients = max(0, self._clients + (1 if opened else -1))
            if opened and self._clients == 1:
                termios.tcflush(self._slave, termios.TCIFLUSH)
                newly = True
            elif not self._clients:
                self._on_last_close(others=any(events[number:]))
        return newly

    def _on_last_close(self, others: bool) -> None:
        """Keeps the bytes from the last program, and resets its settings, as a real device does at the last close.

        The settings may be those of `others`, which have opened the port since then.
        """
        self._left += self._read(EVERYTHING)
        if others:
            return
        fcntl.ioctl(self._slave, termios.TIOCNXCL)
        termios.tcsetattr(self._slave, termios.TCSANOW, self._settings)
        termios.tcflush(self._slave, termios.TCIFLUSH)

    def read(self, limit: int = READ_BYTES) -> bytes:
        """Bytes from the host, at most `limit`.

        Simultaneous openings are reported as one.  If bytes arrive while no program is known, an opening was missed.
        """
        if self._left:
            data, self._left = self._left[:limit], self._left[limit:]
            return data
        data = self._read(limit)
        if data and not self._clients:
            if self.watch is not None and select.select([self.watch], [], [], 0)[0]:
                self._left = data  # of a program that has opened the port since the last look
                return b""
            self._clients = 1
        return data

    def _read(self, limit: int) -> bytes:
        if self.master is None:
            return b""
        self._read_baud = self._host_baud
        try:
            return os.read(self.master, limit)
        except BlockingIOError:
            return b""

    def unread(self) -> int:
        """Number of bytes that a program can read now; they are lost if the port is unplugged first."""
        return (
            struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))[0] if self.is_open else 0
        )

    def write(self, data: bytes) -> None:
        """Sends the bytes that the host's buffer accepts; the rest is lost."""
        sent = 0
        if data and self.master is not None and self.is_open:
            try:
                sent = os.write(self.master, data)
            except BlockingIOError:
                pass
        self.dropped += len(data) - sent

    close = unplug


def _watch(path: str) -> Optional[int]:
    """An inotify descriptor for openings and closings; None without inotify."""
    libc = ctypes.CDLL(None, use_errno=True)
    try:
        descriptor = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    except AttributeError:
        return None
    if descriptor < 0:
        return None
    if libc.inotify_add_watch(descriptor, path.encode(), _IN_OPEN | _IN_CLOSE) < 0:
        os.close(descriptor)
        return None
    return int(descriptor)


def _events(watch: Optional[int]) -> Tuple[bool, ...]:
    """For each event since the last call: True for an opening, False for a closing."""
    if watch is None:
        return ()
    try:
        data = os.read(watch, 4096)
    except BlockingIOError:
        return ()
    found = []
    while data:
        _, mask, _, length = _EVENT.unpack_from(data)
        found.append(bool(mask & _IN_OPEN))
        data = data[_EVENT.size + length :]
    return tuple(found)


class SymbolicLink:
    """A symbolic link to the port; it is replaced atomically, and removed if it still points to this port.

    ConfigError if the name is a file or folder, or a link to another existing port.
    """

    def __init__(self, name: str, target: str = "") -> None:
        self._name, self._target = name, ""
        if os.path.lexists(name) and not os.path.islink(name):
            raise ConfigError(f"link {name!r} is a file or folder, expected a free name or a symbolic link")
        self.move(target)

    def move(self, target: str) -> None:
        """Points the link to another port, or with "" removes it; ConfigError if it cannot be made."""
        if not target:
            self.remove()
            return
        there = os.path.realpath(self._name)
        if os.path.islink(self._name) and os.path.exists(there) and there not in (target, self._target):
            raise ConfigError(
                f"link {self._name!r} leads to {there}, which is in use, expected a free name; end that program, "
                "remove the link, or give another name"
            )
        self._target, temporary = target, f"{self._name}.{os.getpid()}"
        try:
            os.symlink(target, temporary)
            os.replace(temporary, self._name)
        except OSError as error:
            raise ConfigError(
                f"link {self._name!r} cannot be made: {os.strerror(error.errno or errno.EIO)}; give another name"
            ) from None

    def remove(self) -> None:
        """Removes the link, unless another program has taken the name."""
        try:
            if os.readlink(self._name) == self._target:
                os.unlink(self._name)
        except OSError:
            pass
