"""Radios of several processes that share a world by its name: each has two files in the folder of the robots' files.

One file describes the radio, the other is its socket.

A radio is there as long as its process holds the lock on its file, so that a killed process leaves no radio behind.
Packets of other processes come through the socket.  Distances come from the poses in the robots' files.
"""

import contextlib
import json
import os
import socket
import struct
import time
from typing import Dict, List, NamedTuple, Optional

from mrl_driver.errors import ConfigError

from .radio import Place, Radio, RadioMedium, RadioPacket, Station
from .robots import RobotRegistry
from .shared_robots import folder_of, held_file, is_held, is_locked

_SUFFIX = ".radio"
_ROW_BYTES = 512  # a file always has this size: JSON, and blanks behind it
_HEAD = struct.Struct("<ddQH?")
"""Time of the monotonic clock [s], delay [s], 64-bit and network address of the sender, whether it is a broadcast; the
text follows."""
_LONGEST = 1024
OLD_S = 1.0  # a packet that its process has not taken after this time is lost, as with a board that hangs [s]


class _Own(NamedTuple):
    """The file and the socket of a radio of this process."""

    fd: int
    path: str
    socket: socket.socket
    socket_path: str


class SharedRadioMedium(RadioMedium):
    """The radios of all processes that share a world by name, with its robots; ConfigError if the name is not valid."""

    def __init__(self, world_name: str, robots: RobotRegistry) -> None:
        super().__init__()
        self._world_name, self._robots = world_name, robots
        self._folder = folder_of(world_name)
        self._own: Dict[int, _Own] = {}
        self._sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._folder_fd = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY)
        self._sender.setblocking(False)

    # ---- the radios

    def join(self, radio: Radio) -> None:
        """Adds a radio of this process; raises ConfigError if another radio of the world has its address."""
        address = radio.station.address
        path = os.path.join(self._folder, f"{address:016x}{_SUFFIX}")
        if is_held(path):
            raise ConfigError(
                f"radio address {address:016x} is in world {self._world_name!r} already, expected another one"
            )
        with contextlib.ExitStack() as undo:
            super().join(radio)
            undo.callback(super().leave, radio)
            bound = self._bind(address)
            undo.callback(bound.close)
            fd = held_file(path, _row(radio.station))
            undo.pop_all()
        self._own[address] = _Own(fd, path, bound, os.path.join(self._folder, f"{address:016x}"))

    def leave(self, radio: Radio) -> None:
        """Removes a radio of this process, if it is there."""
        super().leave(radio)
        own = self._own.pop(radio.station.address, None)
        if own is None:
            return
        for path in (own.path, own.socket_path):
            with contextlib.suppress(OSError):
                os.unlink(path)
        own.socket.close()
        os.close(own.fd)
        if not self._own:
            self._sender.close()
            os.close(self._folder_fd)

    def changed(self, radio: Radio) -> None:
        """A radio has another range, loss or cut: the other processes see it at their next transmission."""
        os.pwrite(self._own[radio.station.address].fd, _row(radio.station), 0)

    def stations(self) -> List[Station]:
        """All radios of all processes."""
        names = sorted(name for name in os.listdir(self._folder) if name.endswith(_SUFFIX))
        found = (_read(os.path.join(self._folder, name)) for name in names)
        return super().stations() + [each for each in found if each and each.address not in self._own]

    def _place_of(self, station: Station) -> Optional[Place]:
        if station.address in self._own:
            return super()._place_of(station)
        for mover in self._robots.others(""):
            if mover.name == station.robot:
                return mover.pose.x_m, mover.pose.y_m
        return None

    # ---- packets

    def _path_of(self, address: int) -> str:
        """Path of a socket; that through the folder's descriptor is never too long for a socket."""
        return f"/proc/self/fd/{self._folder_fd}/{address:016x}"

    def _bind(self, address: int) -> socket.socket:
        """A new socket in place of one that a killed process may have left."""
        path = self._path_of(address)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)
        bound = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        bound.bind(path)
        bound.setblocking(False)
        return bound

    def _deliver(self, station: Station, packet: RadioPacket, sent_s: float, delay_s: float) -> bool:
        if station.address in self._own:
            return super()._deliver(station, packet, sent_s, delay_s)
        now_s = time.monotonic()
        data = _HEAD.pack(now_s, delay_s, packet.source, packet.network, packet.broadcast) + packet.text
        try:
            self._sender.sendto(data, self._path_of(station.address))
        except OSError:
            return False
        return True

    def fileno(self, radio: Radio) -> Optional[int]:
        """The socket of a radio."""
        return self._own[radio.station.address].socket.fileno()

    def poll(self, radio: Radio) -> None:
        """Passes packets of other processes on to a radio."""
        bound = self._own[radio.station.address].socket
        with contextlib.suppress(BlockingIOError):
            while True:
                data = bound.recv(_LONGEST)
                sent_s, delay_s, source, network, broadcast = _HEAD.unpack_from(data)
                if time.monotonic() - sent_s > OLD_S:
                    continue
                radio.arrive(RadioPacket(source, network, broadcast, data[_HEAD.size :]), 0.0, delay_s)


def _row(station: Station) -> bytes:
    return json.dumps(station).encode().ljust(_ROW_BYTES)


def _read(path: str) -> Optional[Station]:
    """The radio in a file; None if its process is dead."""
    try:
        fd = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        return Station(*json.loads(os.pread(fd, _ROW_BYTES, 0))) if is_locked(fd) else None
    finally:
        os.close(fd)
