"""Links that pass every byte to a recorder, or to any other function, while the robot drives."""

from typing import Callable, Optional

from mrl_driver.transport.link import Link
from mrl_driver.transport.open_link import open_link

from .recording import CHECKED, FROM_BOARD, OPENED, PLAIN, REMARK, TO_BOARD, Recorder

Tap = Callable[[str, bytes], None]
"""Called with each chunk of bytes: its direction (`>` to the board, `<` from it), and the bytes."""


class RecordedLink:
    """A link that passes each chunk to `tap`: before it is written, or after it was read."""

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


class DriverRecording:
    """Records all links that one driver opens; `recorder` is None without a `path`.

    Raises:
        ConfigError: the file cannot be created.
    """

    def __init__(self, path: Optional[str], port: str, baud: int, tap: Optional[Tap] = None) -> None:
        self.recorder = Recorder(path, port=port, baud=baud) if path is not None else None
        self._tap = tap
        self._checked: Optional[bool] = None

    def _record(self, direction: str, data: bytes) -> None:
        if self.recorder is not None:
            self.recorder.add(direction, data)
        if self._tap is not None and direction != REMARK:
            self._tap(direction, data)

    def open(self, port: str, baud: int, patience_s: float) -> RecordedLink:
        """Open a link as `open_link` does; its bytes are recorded."""
        link = RecordedLink(open_link(port, baud, patience_s), self._record)
        self._record(REMARK, OPENED + port.encode("utf-8", "replace"))
        self._checked = None
        return link

    def note(self, checked: bool) -> None:
        """Record whether the board's frames carry a checksum from now on; writes a remark only on a change."""
        if checked != self._checked:
            self._checked = checked
            self._record(REMARK, CHECKED if checked else PLAIN)

    def close(self) -> None:
        """Write all pending entries, and close the file."""
        if self.recorder is not None:
            self.recorder.close()
