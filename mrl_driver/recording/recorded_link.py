"""Listening while driving: links that tell a recorder, or any listener, every byte."""

from typing import Callable, Optional

from mrl_driver.transport.link import Link
from mrl_driver.transport.open_link import open_link

from .recording import CHECKED, FROM_BOARD, OPENED, PLAIN, REMARK, TO_BOARD, Recorder

Tap = Callable[[str, bytes], None]
"""Told of each chunk of bytes: which way (`>` to the board, `<` from it), and the bytes."""


class RecordedLink(Link):
    """A link that gives each chunk to `tap`: what is sent before it goes, what comes when it is read."""

    def __init__(self, link: Link, tap: Tap) -> None:
        self.port, self._link, self._tap = link.port, link, tap

    def read(self, timeout_s: float) -> bytes:
        """As `Link.read`."""
        data = self._link.read(timeout_s)
        if data:
            self._tap(FROM_BOARD, data)
        return data

    def write(self, data: bytes) -> None:
        """As `Link.write`."""
        self._tap(TO_BOARD, data)
        self._link.write(data)

    def wake(self) -> None:
        """As `Link.wake`."""
        self._link.wake()

    def close(self) -> None:
        """As `Link.close`."""
        self._link.close()

    def fileno(self) -> int:
        """As `Link.fileno`."""
        return self._link.fileno()

    def set_baud(self, baud: int) -> None:
        """As `Link.set_baud`."""
        self._link.set_baud(baud)


class Tape:
    """The recording of one driver, over all links that it opens; `recorder` is None without a `path`.

    Raises:
        ConfigError: the file cannot be created.
    """

    def __init__(self, path: Optional[str], port: str, baud: int, tap: Optional[Tap] = None) -> None:
        self.recorder = Recorder(path, port=port, baud=baud) if path is not None else None
        self._tap = tap
        self._checked: Optional[bool] = None

    def _hear(self, way: str, data: bytes) -> None:
        if self.recorder is not None:
            self.recorder.add(way, data)
        if self._tap is not None and way != REMARK:
            self._tap(way, data)

    def open(self, port: str, baud: int, patience_s: float) -> RecordedLink:
        """A link that is listened to; as `open_link`."""
        link = RecordedLink(open_link(port, baud, patience_s), self._hear)
        self._hear(REMARK, OPENED + port.encode("utf-8", "replace"))
        self._checked = None
        return link

    def note(self, checked: bool) -> None:
        """The board's frames carry a check value from now on, or none; remarked when it changes."""
        if checked != self._checked:
            self._checked = checked
            self._hear(REMARK, CHECKED if checked else PLAIN)

    def close(self) -> None:
        """Write what waits, and close the file."""
        if self.recorder is not None:
            self.recorder.close()
