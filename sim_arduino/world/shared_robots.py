"""Robots of several processes in one world: each writes its pose to a small file that the other processes map.

The files are in a folder with the world's name that only this user can enter.  A robot exists as long as its process
holds the lock on its file, so that a killed process leaves no robot behind.
"""

import contextlib
import fcntl
import mmap
import os
import stat
import struct
import tempfile
import time
from typing import Dict, List, Optional

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose

from .robots import NAME, NAME_TEXT, Mover, RobotRegistry
from .shapes import Footprint

_ROW = struct.Struct("<Q5d?7x")  # version, odd while being written; x y yaw, length width, whether a circle
_VERSION = struct.Struct("<Q")
_SUFFIX = ".robot"
LOOK_S = 0.5  # the folder is searched for new and removed robots after this time [s]
_TRIES = 20


class _Row:
    """A mapped file, and the robot in it as it was read or written last; `access` is one of `mmap.ACCESS_*`."""

    def __init__(self, fd: int, access: int) -> None:
        self.fd = fd
        try:
            self.memory = mmap.mmap(fd, _ROW.size, access=access)
        except BaseException:
            os.close(fd)
            raise
        self.version = -1
        self.mover: Optional[Mover] = None

    def close(self) -> None:
        self.memory.close()
        os.close(self.fd)


def folder_of(world_name: str) -> str:
    """The folder of a shared world; it is created if necessary.

    ConfigError if the name is not valid, or the folder or one above it is a symbolic link or another user's.
    """
    given = os.environ.get("XDG_RUNTIME_DIR")
    base = os.path.realpath(given) if given else os.path.join(tempfile.gettempdir(), f"mrl-sim-{os.getuid()}")
    shared = os.path.join(base, "mrl-sim")
    folder = os.path.join(shared, _checked("world name", world_name))
    for each in (base, shared, folder):
        try:
            os.makedirs(each, mode=0o700, exist_ok=True)
            found = os.lstat(each)
        except OSError as error:
            raise ConfigError(f"world {world_name!r}: folder {each}: {error.strerror}") from None
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
            raise ConfigError(
                f"world {world_name!r}: folder {each} is a symbolic link or belongs to another user, expected one of "
                "your own; remove it, or set XDG_RUNTIME_DIR to a folder of your own"
            )
    return folder


def _checked(what: str, name: str) -> str:
    if not NAME.fullmatch(name):
        raise ConfigError(f"{what} is {name!r}, expected {NAME_TEXT}")
    return name


class SharedRegistry(RobotRegistry):
    """The robots of all processes that share a world by its name; ConfigError if that is not valid."""

    def __init__(self, world_name: str) -> None:
        super().__init__()
        self._folder = folder_of(world_name)
        self._world_name = world_name
        self._mine: Dict[str, _Row] = {}
        self._theirs: Dict[str, _Row] = {}
        self._look_due_s = 0.0

    def place(self, name: str, pose: Pose, footprint: Footprint) -> None:
        """Puts a robot into the world, or moves it; ConfigError if another process has one of this name."""
        row = self._mine.get(name)
        if row is None:
            self._join(name, pose, footprint)
            return
        version = row.version
        data = _ROW.pack(version + 2, *pose, *footprint)
        # pack_into would first write zeros, which a reader takes for a robot at the origin, of version 0
        row.memory[: _VERSION.size] = _VERSION.pack(version + 1)
        row.memory[_VERSION.size :] = data[_VERSION.size :]
        row.memory[: _VERSION.size] = data[: _VERSION.size]
        row.version, row.mover = version + 2, Mover(name, pose, footprint)

    def remove(self, name: str) -> None:
        """Takes one of this process's robots out of the world."""
        row = self._mine.pop(name, None)
        if row is not None:
            os.unlink(self._path(name))
            row.close()

    def others(self, name: str) -> List[Mover]:
        """All robots but that one."""
        now_s = time.monotonic()
        if now_s >= self._look_due_s:
            self._look_due_s = now_s + LOOK_S
            self._look()
        found = [row.mover for other, row in self._mine.items() if other != name]
        for other, row in self._theirs.items():
            if other == name:
                continue
            if _VERSION.unpack_from(row.memory)[0] != row.version:
                self._read(other, row)
            found.append(row.mover)
        return [mover for mover in found if mover is not None]

    def close(self) -> None:
        """Takes this process's robots out of the world."""
        for name in list(self._mine):
            self.remove(name)
        for row in self._theirs.values():
            row.close()
        self._theirs.clear()

    def _path(self, name: str) -> str:
        return os.path.join(self._folder, name + _SUFFIX)

    def _join(self, name: str, pose: Pose, footprint: Footprint) -> None:
        """Creates the robot's file."""
        path = self._path(_checked("robot name", name))
        if is_held(path):
            raise ConfigError(
                f"robot {name!r} is in world {self._world_name!r} already, expected another name"
            )
        fd = held_file(path, _ROW.pack(0, *pose, *footprint))
        row = self._mine[name] = _Row(fd, mmap.ACCESS_WRITE)
        row.version, row.mover = 0, Mover(name, pose, footprint)
        self._look_due_s = 0.0

    def _look(self) -> None:
        """Adds the new robots, and drops the removed ones."""
        present = {f[: -len(_SUFFIX)] for f in os.listdir(self._folder) if f.endswith(_SUFFIX)}
        for name in list(self._theirs):
            if name not in present or not self._is_current(name):
                self._theirs.pop(name).close()
        for name in present - set(self._theirs) - set(self._mine):
            row = self._open(name)
            if row is not None:
                self._theirs[name] = row

    def _is_current(self, name: str) -> bool:
        """Whether the mapped file is still the one with this name, and its owner is alive."""
        row = self._theirs[name]
        try:
            same = os.stat(self._path(name)).st_ino == os.fstat(row.fd).st_ino
        except OSError:
            return False
        return same and is_locked(row.fd)

    def _open(self, name: str) -> Optional[_Row]:
        """Maps a robot's file; if its owner is dead, removes the file and returns None."""
        try:
            fd = os.open(self._path(name), os.O_RDONLY)
        except OSError:
            return None
        if is_locked(fd):
            return _Row(fd, mmap.ACCESS_READ)
        os.close(fd)
        with contextlib.suppress(OSError):
            os.unlink(self._path(name))
        return None

    def _read(self, name: str, row: _Row) -> None:
        """Reads pose and outline of a robot; the last known ones stay if its owner is writing at each attempt."""
        for _ in range(_TRIES):
            version, x, y, yaw, *sizes = _ROW.unpack_from(row.memory)
            if version % 2 == 0 and _VERSION.unpack_from(row.memory)[0] == version:
                row.version, row.mover = version, Mover(name, Pose(x, y, yaw), Footprint(*sizes))
                break


def held_file(path: str, data: bytes) -> int:
    """Creates a file, locked and filled before other processes can see it; returns its descriptor."""
    folder, name = os.path.split(path)
    temporary = os.path.join(folder, f".{name}.{os.getpid()}")
    fd = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
    with contextlib.ExitStack() as undo:
        undo.callback(os.close, fd)
        fcntl.flock(fd, fcntl.LOCK_EX)
        os.write(fd, data)
        os.rename(temporary, path)
        undo.pop_all()
    return fd


def is_held(path: str) -> bool:
    """Whether another open descriptor holds the lock on a file; False if there is no file."""
    try:
        fd = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        return is_locked(fd)
    finally:
        os.close(fd)


def is_locked(fd: int) -> bool:
    """Whether another open descriptor holds the file's lock."""
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False
