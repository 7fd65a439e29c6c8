"""Recording while driving: links that tell a recorder every byte, and remarks on how to read them."""

from typing import Optional

from .link import Link
from .recording import FROM_BOARD, REMARK, TO_BOARD, Recorder

CHECKED, PLAIN = b"checked", b"plain"
"""Remarks: from here on the board's frames carry a check value, or none."""


class RecordedLink(Link):
    """A link that gives each chunk to `recorder`: what is sent before it goes, what comes when it is read."""

    def __init__(self, port: str, baud: int, recorder: Recorder) -> None:
        super().__init__(port, baud)
        self._recorder = recorder

    def read(self, timeout_s: float) -> bytes:
        """As `Link.read`."""
        data = super().read(timeout_s)
        if data:
            self._recorder.add(FROM_BOARD, data)
        return data

    def write(self, data: bytes) -> None:
        """As `Link.write`."""
        self._recorder.add(TO_BOARD, data)
        super().write(data)


class Tape:
    """The recording of one driver, over all links that it opens.

    Raises:
        ConfigError: the file cannot be created.
    """

    def __init__(self, path: str, port: str, baud: int) -> None:
        self.recorder = Recorder(path, port=port, baud=baud)
        self._checked: Optional[bool] = None

    def open(self, port: str, baud: int) -> RecordedLink:
        """A link that is recorded; as `Link`."""
        link = RecordedLink(port, baud, self.recorder)
        self.recorder.add(REMARK, b"opened " + port.encode("utf-8", "replace"))
        self._checked = None
        return link

    def note(self, checked: bool) -> None:
        """The board's frames carry a check value from now on, or none; remarked when it changes."""
        if checked != self._checked:
            self._checked = checked
            self.recorder.add(REMARK, CHECKED if checked else PLAIN)

    def close(self) -> None:
        """Write what waits, and close the file."""
        self.recorder.close()
