"""Recordings that are started and stopped while the robot drives, as `Driver.recorder`."""

import threading
from typing import Any, Optional

from mrl_driver.arguments import require_number, require_text, shown
from mrl_driver.errors import ConfigError
from mrl_driver.recording.recording import OWN_REMARKS, Recorder

from .connection import Connection

EXCHANGE_S = 1.0  # `start` waits at most this long for the reading thread, which may be in a callback [s]
LONGEST_REMARK = 1000


class DriverRecorder:
    """Records all bytes of one driver in both directions."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def file(self) -> Optional[Recorder]:
        """The file that is written, with the lines it `lost` and its last `error`; None without a recording."""
        recording = self._connection.links.recording
        return recording.recorder if recording is not None else None

    @property
    def loss(self) -> str:
        """What the file lacks, in words; empty if it is complete, and without a recording."""
        file = self.file
        return file.loss if file is not None else ""

    def start(self, path: str) -> None:
        """Record from now on, as the option `record`; an existing file is overwritten.

        The recording begins between two frames of the board, and contains all later ones.

        Raises:
            ConfigError: a recording is running, the file cannot be created, or the driver was given an open `Link`.
            LinkLost: the driver is not connected, or was closed.
        """
        connection = self._connection
        with connection.stop_if_refused():
            require_text("path", path, "the name of a file")
        connection.connected()
        connection.links.start_recording(path)
        with connection.changed:
            if threading.current_thread() is connection.thread:
                connection.exchange_link()
            elif connection.link is not None:
                connection.link.wake()
                connection.changed.wait_for(self._has_begun, EXCHANGE_S)
        connection.flush()

    def _has_begun(self) -> bool:
        connection, recording = self._connection, self._connection.links.recording
        return not (recording and recording.due and connection.link) or connection.closing

    def stop(self) -> str:
        """End the recording, and close its file.

        Returns:
            What the file lacks, in words, such as after a full disk; empty if it is complete.

        Raises:
            ConfigError: no recording is running.
        """
        recorder = self._connection.links.stop_recording()
        if threading.current_thread() is self._connection.thread:  # it must not wait for a disk
            try:
                threading.Thread(target=recorder.close, name="recorder-end", daemon=True).start()
            except RuntimeError:  # no thread can be started
                recorder.close()
        else:
            recorder.close()
        return recorder.loss

    def remark(self, text: str) -> None:
        """Write a remark into the recording; nothing happens while none is running.

        Raises:
            ConfigError: the text is empty, longer than `LONGEST_REMARK`, or begins like a remark of the driver.
        """
        with self._connection.stop_if_refused():
            _require_remark(text)
        self._connection.remark(text.encode("utf-8", "replace"))

    def note_clock(self, ahead_s: float) -> None:
        """Write into the recording, if one is running, that the wall clock is ahead of `now_s` by this much [s], from
        the event on whose callback calls this.

        Raises:
            ConfigError: it is not a finite number.
        """
        with self._connection.stop_if_refused():
            self._connection.ahead_s = require_number("ahead_s", ahead_s)
        self._connection.note_clock()


def _require_remark(text: Any) -> None:
    """Raise ConfigError unless it is a remark of the user."""
    fits = isinstance(text, str) and 0 < len(text) <= LONGEST_REMARK
    if not fits or text.split(" ")[0].encode("utf-8", "replace") in OWN_REMARKS:
        own = ", ".join(word.decode() for word in OWN_REMARKS)
        raise ConfigError(
            f"the remark is {shown(text)}, expected 1 to {LONGEST_REMARK} characters that do not begin with {own}"
        )
