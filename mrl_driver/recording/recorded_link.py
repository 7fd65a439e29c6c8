"""Links that pass every byte to a recorder, or to any other function, while the robot drives."""

from typing import Callable, Optional, TypeVar

from mrl_driver.transport.link import Link
from mrl_driver.transport.open_link import open_link

from .recording import CHECKED, FROM_BOARD, OPENED, PLAIN, REMARK, TO_BOARD, Recorder

Tap = Callable[[str, bytes], None]
"""Called with each chunk of bytes: its direction (`>` to the board, `<` from it), and the bytes."""


class RecordedLink:
    """A link that passes each chunk to `tap`: before it is written, or after it was read."""

    def __init__(self, link: Link, tap: Tap) -> None:
        self.port, self.link, self._tap = link.port, link, tap

    def read(self, timeout_s: float) -> bytes:
        """As `Link.read`."""
        data = self.link.read(timeout_s)
        if data:
            self._tap(FROM_BOARD, data)
        return data

    def write(self, data: bytes) -> None:
        """As `Link.write`."""
        self._tap(TO_BOARD, data)
        self.link.write(data)

    def wake(self) -> None:
        """As `Link.wake`."""
        self.link.wake()

    def close(self) -> None:
        """As `Link.close`."""
        self.link.close()

    def fileno(self) -> int:
        """As `Link.fileno`."""
        return self.link.fileno()

    def set_baud(self, baud: int) -> None:
        """As `Link.set_baud`."""
        self.link.set_baud(baud)


AnyLink = TypeVar("AnyLink", Link, Optional[Link])


def inner(link: AnyLink) -> AnyLink:
    """Return the link without its recording."""
    return link.link if isinstance(link, RecordedLink) else link


class DriverRecording:
    """Records all links of one driver, from `start` to `stop`, and calls `tap` with their bytes.

    A link that is in use is exchanged by `exchange` after `due` has been set.  The links may be used by any thread; all
    else is called by one thread at a time.

    Attributes:
        recorder: the file that is written; None without one.
        due: a recording was started or stopped, and the link in use is still the one before.
    """

    def __init__(self, port: str, baud: int, tap: Optional[Tap] = None) -> None:
        self._port, self._baud, self._tap = port, baud, tap
        self.recorder: Optional[Recorder] = None
        self._written: Optional[Recorder] = None
        """The recorder after its first remarks: what is read and written goes there."""
        self._checked: Optional[bool] = None
        self.due = False

    def start(self, path: str) -> None:
        """Create a file; bytes follow from the next `open` or `exchange`.

        Raises:
            ConfigError: the file cannot be created.
        """
        self.recorder = Recorder(path, port=self._port, baud=self._baud)
        self.due = True

    def stop(self) -> Optional[Recorder]:
        """Record no more; return the recorder, which the caller closes, or None."""
        recorder, self.recorder, self._written = self.recorder, None, None
        self.due = True
        return recorder

    def open(self, port: str, baud: int, patience_s: float) -> Link:
        """Open a link as `open_link` does; its bytes are recorded."""
        link = open_link(port, baud, patience_s)
        self._begin(port)
        return self._tapped(link)

    def exchange(self, link: Link, checked: bool, pending: bytes) -> Link:
        """Begin, or end, a recording with a link that is in use; return the link to go on with.

        `checked` is as for `note`; `pending` is the start of a frame that the board has sent already.
        """
        link = inner(link)
        self._begin(link.port)
        self.note(checked)
        if pending and self._written is not None:
            self._written.add(FROM_BOARD, pending)
        return self._tapped(link)

    def _begin(self, port: str) -> None:
        self.due, self._checked, self._written = False, None, self.recorder
        self.remark(OPENED + port.encode("utf-8", "replace"))

    def _tapped(self, link: Link) -> Link:
        return link if self.idle else RecordedLink(link, self._add)

    @property
    def idle(self) -> bool:
        """There is nothing to do with the bytes of a link."""
        return self.recorder is None and self._tap is None

    def _add(self, direction: str, data: bytes) -> None:
        recorder = self._written
        if recorder is not None:
            recorder.add(direction, data)
        if self._tap is not None:
            self._tap(direction, data)

    def note(self, checked: bool) -> None:
        """Record whether the board's frames carry a checksum from now on; writes a remark only on a change."""
        if checked != self._checked:
            self._checked = checked
            self.remark(CHECKED if checked else PLAIN)

    def remark(self, data: bytes) -> None:
        """Record a remark."""
        recorder = self._written
        if recorder is not None:
            recorder.add(REMARK, data)

    def close(self) -> None:
        """Write all pending entries, and close the file."""
        if self.recorder is not None:
            self.recorder.close()
