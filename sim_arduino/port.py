"""The emulated USB port: a pseudo-terminal that behaves like a serial device which stays plugged in."""

import ctypes
import errno
import fcntl
import os
import struct
import termios
import tty
from typing import Optional, Tuple

from mrl_driver.errors import ConfigError

_IN_OPEN, _IN_CLOSE = 0x20, 0x08 | 0x10
_EVENT = struct.Struct("iIII")
READ_BYTES = 256
_EVERYTHING = 65536


class PtyPort:
    """A pty in raw mode whose host side is `path`.

    A descriptor of the host's side is kept, so that programs may come and go.  While none has the port open, what the
    board sends is lost, as on a real port; so are the bytes for which a program that does not read leaves no room.

    Attributes:
        path: The device that the host opens.
        is_open: Whether a program has it open, as far as is known.
        dropped: Bytes from the board that nobody took.
    """

    def __init__(self) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._settings = termios.tcgetattr(self._slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self._slave)
        self.dropped = 0
        self._clients = 0
        self._left = b""
        self.watch = _watch(self.path)

    @property
    def is_open(self) -> bool:
        """True too where openings cannot be watched."""
        return self._clients > 0 or self.watch is None

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
        try:
            return os.read(self.master, limit)
        except BlockingIOError:
            return b""

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
        if data and self.is_open:
            try:
                sent = os.write(self.master, data)
            except BlockingIOError:
                pass
        self.dropped += len(data) - sent

    def close(self) -> None:
        """Unplugs the device."""
        for descriptor in (self.master, self._slave, self.watch):
            if descriptor is not None:
                os.close(descriptor)


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
        ConfigError: there is something else under that name, or it cannot be made.
    """

    def __init__(self, name: str, target: str) -> None:
        self._name, self._target = name, target
        if os.path.lexists(name) and not os.path.islink(name):
            raise ConfigError(f"link {name!r} is a file or folder, expected a free name or a symbolic link")
        temporary = f"{name}.{os.getpid()}"
        try:
            os.symlink(target, temporary)
            os.replace(temporary, name)
        except OSError as error:
            raise ConfigError(
                f"link {name!r} cannot be made: {os.strerror(error.errno or errno.EIO)}"
            ) from None

    def remove(self) -> None:
        """Removes the link, unless somebody else has taken the name."""
        try:
            if os.readlink(self._name) == self._target:
                os.unlink(self._name)
        except OSError:
            pass
