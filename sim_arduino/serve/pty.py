"""The emulated USB port: a pseudo-terminal that behaves like a serial device, which may be unplugged."""

import ctypes
import errno
import fcntl
import os
import struct
import termios
import tty
from typing import Optional, Protocol, Tuple

from mrl_driver.errors import ConfigError

_IN_OPEN, _IN_CLOSE = 0x20, 0x08 | 0x10
_EVENT = struct.Struct("iIII")
READ_BYTES = 256
USUAL_BAUD = 115200
_FAST = {termios.B500000: 500000, termios.B1000000: 1000000, 0o010000: 250000}
"""Speeds by their code; that of 250000 says that it is told elsewhere.  Any other one is taken for the usual."""
_EVERYTHING = 65536


class Port(Protocol):
    """What a board is reached by, see `PtyPort`."""

    path: str

    @property
    def master(self) -> Optional[int]:
        """Descriptor that tells of data."""

    @property
    def watch(self) -> Optional[int]:
        """Descriptor that tells of openings."""

    @property
    def plugged(self) -> bool:
        """It is plugged in."""

    @property
    def baud(self) -> int:
        """Speed that the host has set."""

    def plug(self) -> None:
        """Plugs it in."""

    def unplug(self) -> None:
        """Takes it away."""

    def opened_anew(self) -> bool:
        """A program came."""

    def read(self, limit: int = READ_BYTES) -> bytes:
        """What the host has sent."""

    def read_all(self) -> bytes:
        """Everything that waits."""

    def write(self, data: bytes) -> None:
        """Sends to the host."""

    def close(self) -> None:
        """Ends it."""


class PtyPort:
    """A pty in raw mode whose host side is `path`.

    A descriptor of the host's side is kept, so that programs may come and go.  While none has the port open, what the
    board sends is lost, as on a real port; so are the bytes for which a program that does not read leaves no room.

    Attributes:
        path: The device that the host opens; another one after each plugging in.
        master: Descriptor of the board's side; None while unplugged.
        watch: Descriptor that tells of openings; None where there is none.
        dropped: Bytes from the board that nobody took.
    """

    def __init__(self) -> None:
        self.path = ""
        self.dropped = 0
        self.master: Optional[int] = None
        self.watch: Optional[int] = None
        self.plug()

    def plug(self) -> None:
        """Plugs the device in, under another name than it had."""
        if self.master is not None:
            return
        master, slave = os.openpty()
        if os.ttyname(slave) == self.path:
            taken = master, slave
            master, slave = os.openpty()
            for descriptor in taken:
                os.close(descriptor)
        tty.setraw(slave)
        os.set_blocking(master, False)
        self.master, self._slave = master, slave
        self._settings = termios.tcgetattr(slave)
        self.path = os.ttyname(slave)
        self._clients = 0
        self._left = b""
        self.watch = _watch(self.path)

    def unplug(self) -> None:
        """Takes the device away; a program that has it open gets an error."""
        if self.master is None:
            return
        for descriptor in (self.master, self._slave, self.watch):
            if descriptor is not None:
                os.close(descriptor)
        self.master = self.watch = None

    @property
    def plugged(self) -> bool:
        """It is plugged in."""
        return self.master is not None

    @property
    def baud(self) -> int:
        """Speed that the host has set, if that is one of the higher ones."""
        return _FAST.get(termios.tcgetattr(self._slave)[5], USUAL_BAUD) if self.plugged else USUAL_BAUD

    @property
    def is_open(self) -> bool:
        """Whether a program has it open; true too where openings cannot be watched."""
        return self.master is not None and (self._clients > 0 or self.watch is None)

    def opened_anew(self) -> bool:
        """Takes note of programs that opened or closed the port; True if it was closed before and is open now."""
        anew = False
        for opened in _events(self.watch):
            self._clients = max(0, self._clients + (1 if opened else -1))
            if opened and self._clients == 1:
                termios.tcflush(self._slave, termios.TCIFLUSH)
                anew = True
            elif not self._clients:
                self._left_alone()
        return anew

    def _left_alone(self) -> None:
        """Keeps what the last program sent, puts back what it changed: a real device forgets it at the last close."""
        self._left += self._read(_EVERYTHING)
        fcntl.ioctl(self._slave, termios.TIOCNXCL)
        termios.tcsetattr(self._slave, termios.TCSANOW, self._settings)
        termios.tcflush(self._slave, termios.TCIFLUSH)

    def read(self, limit: int = READ_BYTES) -> bytes:
        """What the host has sent, at most `limit` bytes.

        Openings at the same moment are told as one; bytes show that a program was missed.
        """
        if self._left:
            data, self._left = self._left[:limit], self._left[limit:]
            return data
        data = self._read(limit)
        if data and not self._clients:
            self._clients = 1
        return data

    def _read(self, limit: int) -> bytes:
        if self.master is None:
            return b""
        try:
            return os.read(self.master, limit)
        except BlockingIOError:
            return b""

    def unread(self) -> int:
        """Bytes that a program could read now; they are lost if the port is unplugged first."""
        return (
            struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)))[0] if self.is_open else 0
        )

    def read_all(self) -> bytes:
        """Everything that waits."""
        data = b""
        while True:
            piece = self.read(_EVERYTHING)
            if not piece:
                return data
            data += piece

    def write(self, data: bytes) -> None:
        """Sends to the host what it has room for; the rest is lost."""
        sent = 0
        if data and self.master is not None and self.is_open:
            try:
                sent = os.write(self.master, data)
            except BlockingIOError:
                pass
        self.dropped += len(data) - sent

    def close(self) -> None:
        """Unplugs the device for good."""
        self.unplug()


def _watch(path: str) -> Optional[int]:
    """An inotify descriptor that tells of openings and closings; None where there is no inotify."""
    libc = ctypes.CDLL(None, use_errno=True)
    try:
        descriptor = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    except AttributeError:
        return None
    if descriptor < 0 or libc.inotify_add_watch(descriptor, path.encode(), _IN_OPEN | _IN_CLOSE) < 0:
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


class Link:
    """A symbolic link to the port, replaced in one step and removed if it is still ours.

    Raises:
        ConfigError: there is something else under that name, or a link to another port that exists.
    """

    def __init__(self, name: str, target: str = "") -> None:
        self._name, self._target = name, ""
        if os.path.lexists(name) and not os.path.islink(name):
            raise ConfigError(f"link {name!r} is a file or folder, expected a free name or a symbolic link")
        self.move(target)

    def move(self, target: str) -> None:
        """Points to another port; to none ("") is no link.

        Raises:
            ConfigError: it cannot be made.
        """
        if not target:
            self.remove()
            return
        there = os.path.realpath(self._name)
        if os.path.islink(self._name) and os.path.exists(there) and there not in (target, self._target):
            raise ConfigError(
                f"link {self._name!r} leads to {there}, which is in use, expected a free name; end the program there, "
                "remove the link, or choose another name"
            )
        self._target, temporary = target, f"{self._name}.{os.getpid()}"
        try:
            os.symlink(target, temporary)
            os.replace(temporary, self._name)
        except OSError as error:
            raise ConfigError(
                f"link {self._name!r} cannot be made: {os.strerror(error.errno or errno.EIO)}"
            ) from None

    def remove(self) -> None:
        """Removes the link, unless somebody else has taken the name."""
        try:
            if os.readlink(self._name) == self._target:
                os.unlink(self._name)
        except OSError:
            pass
