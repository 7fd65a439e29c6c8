"""Recordings: all bytes of both directions with their times, as lines of text.

    #mrl-recording 1 {"port": "/dev/ttyACM0", "clock_us": 81230412, "started": "2026-03-01T12:00:00+00:00"}
    0.000000 > @5e
    0.004211 < @5,2500,172,1180,2,1e\\r\\n
    1.250000 ! checked

`>` marks bytes to the board, `<` bytes from it, `!` a remark of the driver.  Times are seconds since the recording
began, on a monotonic clock.  Bytes outside printable ASCII, and the backslash, are escaped as in a Python string.  A
crash or a full disk may leave an incomplete line; it is skipped, and all other lines are read.

The driver's clock counts whole microseconds, so that a recording holds its times exactly: `clock_us` is that clock when
the recording began, and (clock_us + time in us) / 1e6 is the time at which the driver took the bytes of a `<` line.  A
`<` line without bytes is a time at which nothing had arrived, and the driver noticed something or greeted the board.
So the driver can be played again, step by step (`driver.recorded`).
"""

import codecs
import contextlib
import datetime
import errno
import fcntl
import itertools
import json
import math
import os
import re
import stat
import threading
import time
from collections import deque
from typing import Any, BinaryIO, Callable, Deque, Dict, Iterator, List, NamedTuple, Optional, Tuple

from mrl_driver.clocks import wait_until
from mrl_driver.errors import ConfigError, shortage, shortages
from mrl_driver.files import open_plain
from mrl_driver.json_text import exact_json

VERSION = 1
TO_BOARD, FROM_BOARD, REMARK = ">", "<", "!"
OPENED = b"opened "  # a remark: the port that follows was opened
CHECKED, PLAIN = b"checked", b"plain"
"""Remarks: from here on the board's frames carry a checksum, or carry none."""
PHONE = b"phone "
"""A remark: a JSON object follows, with a reading of the sensors of the phone that drives the robot."""
SESSION = b"session "
"""A remark: from here on the driver takes the bytes of the port that was opened.  `new`: it greets a board.  `again
same` or `again other`: it greets the board that was lost, or one that may be another.  `joined` and a JSON object: the
recording begins after the greeting; the object holds the board, the code of its stream, whether frames carry a
checksum, and the last frame of the stream with its time."""
MODEL = b"model "  # a remark: the robot's model follows, as a JSON object with the keys of its YAML file
POSE = b"pose "
"""A remark: the odometry continues from this x, y, yaw and covariance (xx xy x-yaw yy y-yaw yaw-yaw) [m rad]."""
STOP = b"stop "
"""A remark: the driver dropped the command in force; the reason follows, for a wheel that did not follow its command
with a JSON object of `wheel_monitor.Mismatch`."""
CLOCK = b"clock "
"""A remark: the wall clock is ahead of the driver's by this much [s], from the bytes of the same time on."""
LOST, RECONNECTED, SLOWED = b"lost ", b"reconnected ", b"slowed "
"""Remarks: the port was lost (a JSON object of `events.Lost`, with `reported`: listeners got the event), was found
again (its name), or now has this baud rate."""
ENDED, CLOSED = b"ended ", b"closed"
"""A remark: the listeners of the driver get nothing more; `closed` or the error that ended it follows."""
LACKS = b"file_lacks "
"""A remark: lines before it could not be written.  A JSON object follows: their number `lines`, the time `since_s` of
the last one before them [s], and the `reason`."""
ENDS = b"file_ends"
"""A remark, the last one: the recording was ended.  If it is missing and the header has `marks_end`, the program was
killed, the computer lost its power, the disk stayed full, or the file was cut."""
_OWN = (OPENED, CHECKED, PLAIN, SESSION, MODEL, POSE, STOP, CLOCK, LOST, RECONNECTED, SLOWED, ENDED)
OWN_REMARKS = tuple(word.strip() for word in (*_OWN, LACKS, ENDS))
"""First words of the driver's own remarks.  Readers ignore those that they do not know."""
_MAGIC = "#mrl-recording"
_BLANK = b"\xef\xbb\xbf \t\r\n"
"""Bytes before the first line that are skipped: a byte-order mark, blank lines."""
_ENTRY = re.compile(rb"^\d{1,9}\.\d{6} [<>!] ", re.M)
_MOST_SKIPPED = 100_000
_OTHERS = {
    b"\x1f\x8b": "compressed by gzip; unpack it with gunzip",
    b"PK\x03\x04": "a zip archive; unpack it with unzip",
    b"\xff\xfe": "text in UTF-16; save it as UTF-8, or take the file as it was recorded",
    b"\xfe\xff": "text in UTF-16; save it as UTF-8, or take the file as it was recorded",
}
"""What files begin with that are a recording no more."""
_NUMBER = re.compile(r"[0-9]{1,9}")
FLUSH_S, HOLD_S = 0.2, 0.05
"""The file is written this often; an entry waits for this time, because a thread may pause before it adds an older one
[s]."""
SET_S, SURE_S = 0.1, 0.01
"""The wall clock was set if it differs by more than `SET_S`; both clocks must be read within `SURE_S` for that [s]."""
SYNC_S = 1.0  # the file is put on the disk this often, because a computer without power forgets the rest [s]
_MOST_WAITING = 20000
LONGEST_LINE = 1 << 20
AHEAD = 7  # a line is later than most of this many lines behind it: its time is damaged, not theirs
_MOST_HELD = 1000  # a line waits for at most this many behind it: they may all be damaged
_LINE_END = rb"\r\n"  # as it is written behind a frame of the board
_ESCAPE = re.compile(rb"""\\(?:[\\'"abfnrtv]|[0-3][0-7]{2}|[0-7]{1,2}(?![0-7])|x[0-9a-fA-F]{2})""")


class Entry(NamedTuple):
    """One line: time [s since the start], direction (`>`, `<` or `!`), and the bytes."""

    time_s: float
    direction: str
    data: bytes


Skip = Callable[[int, str], None]
_Line = Tuple[int, Optional[Entry], str]
"""Number of a line, and its entry, or what is wrong with it; nothing is wrong with a blank one."""


def now_s() -> float:
    """The clock of the driver and of its recordings: `time.monotonic()` in whole microseconds [s]."""
    return time.monotonic_ns() // 1000 / 1e6


class Recorder:
    """Appends to a recording from any thread without ever blocking or stopping its caller.

    A separate thread writes five times a second, so at most a quarter of a second is lost if the process is killed,
    unless the disk is slow.  Once a second it puts the file on the disk, for a loss of power.  It notes when the wall
    clock is set, unless the program does that: after a first `CLOCK` remark, it leaves them to the program.
    After a failed write, `error` holds the reason, `lost` counts the lost lines, and the next write is tried.  With a
    `clock` of simulated time there is no such thread; `add` writes.  Only this user can read a new file.  ConfigError
    if it cannot be created, or another recorder writes it.
    """

    def __init__(self, path: str, clock: Optional[Callable[[], float]] = None, **header: Any) -> None:
        self.path = path
        self.lost = 0
        self.error = ""
        self._torn = False
        self._dropped = self._noted = self._missing = 0
        """Lines that found no place, those of them that were noted, and the lost lines that the next write reports."""
        self._waiting: Deque[Entry] = deque()
        self._held: List[Entry] = []
        self._written_s = self._kept_s = 0.0
        """Time of the last line that was made, and of the last one that is whole in the file [s]."""
        self._ended = threading.Event()
        try:
            self._fd = _open_alone(path)
        except OSError as error:
            reason = shortage(error) or f"{error.strerror}; give a file that can be written"
            raise ConfigError(f"cannot record to {path!r}: {reason}") from None
        self._clock = clock or now_s
        self._start_s = self._clock()
        started = datetime.datetime.now(datetime.timezone.utc)
        self._ahead_s, self._follows_clock = started.timestamp() - self._start_s, True
        facts = {"clock_us": round(self._start_s * 1e6), "started": started.isoformat(), "marks_end": True}
        header.update(facts)
        self._write(f"{_MAGIC} {VERSION} {exact_json(header)}\n", 1)
        self._thread: Optional[threading.Thread] = None
        if clock is None:
            self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
            try:
                with shortages(f"cannot record to {path!r}", ConfigError):
                    self._thread.start()
            except BaseException:
                os.close(self._fd)
                raise

    def add(self, direction: str, data: bytes, at_s: Optional[float] = None) -> None:
        """Record `data`, which was sent in `direction` just now, or at this time of the driver's clock [s]."""
        if len(self._waiting) >= _MOST_WAITING:
            self.lost += 1
            self._dropped += 1
            self.error = self.error or "the disk is too slow"
            return
        if direction == REMARK and data.startswith(CLOCK):
            self._follows_clock = False
        time_s = (self._clock() if at_s is None else at_s) - self._start_s
        self._waiting.append(Entry(time_s, direction, bytes(data)))
        if self._thread is None and len(self._waiting) >= _MOST_WAITING // 10:
            self._save()

    @property
    def loss(self) -> str:
        """Description of the lines that are missing; empty if none is."""
        text = f"{self.path} lacks {self.lost} lines: {self.error}; free disk space, then record again"
        return text if self.lost else ""

    def close(self) -> None:
        """Write all pending lines, and close the file."""
        if not self._ended.is_set():
            self._ended.set()
            if self._thread is not None:
                self._thread.join()
            else:
                self._save_rest()
            with contextlib.suppress(OSError):  # a forked child has the descriptor, too
                fcntl.flock(self._fd, fcntl.LOCK_UN)
            os.close(self._fd)

    def _run(self) -> None:
        synced_s = self._start_s
        while not wait_until(self._ended.is_set, FLUSH_S):
            self._follow_clock()
            self._save(self._clock() - self._start_s - HOLD_S)
            if self._clock() >= synced_s + SYNC_S:
                self._sync()
                synced_s = self._clock()
        self._save_rest()
        self._sync()

    def _save_rest(self) -> None:
        self._save()
        self._save(ends=True)  # after a report of lines for which there was no place

    def _follow_clock(self) -> None:
        """Note the wall clock if it was set."""
        before_s, wall_s, after_s = self._clock(), time.time(), self._clock()
        ahead_s = wall_s - before_s
        if self._follows_clock and after_s - before_s < SURE_S and abs(ahead_s - self._ahead_s) > SET_S:
            self._ahead_s = ahead_s
            self._waiting.append(Entry(before_s - self._start_s, REMARK, CLOCK + repr(ahead_s).encode()))

    def _sync(self) -> None:
        """Put what was written on the disk."""
        with contextlib.suppress(OSError):  # a pipe has no disk; of one that is gone, the next write says so
            os.fdatasync(self._fd)

    def _save(self, before_s: float = math.inf, ends: bool = False) -> None:
        """Write the entries from before this time, in the order of their times; `ends`: they are the last ones."""
        dropped = self._dropped
        self._held += [self._waiting.popleft() for _ in range(len(self._waiting))]
        self._held.sort(key=lambda entry: entry.time_s)  # a thread may pause before it appends
        count = sum(entry.time_s < before_s for entry in self._held)
        entries = self._held[:count]
        del self._held[:count]
        if ends:
            entries.append(Entry(self._clock() - self._start_s, REMARK, ENDS))
        if entries and self._missing:
            facts = {"lines": self._missing, "since_s": round(self._kept_s, 6), "reason": self.error}
            entries.insert(0, Entry(entries[0].time_s, REMARK, LACKS + exact_json(facts).encode()))
        if entries:
            self._write("".join(map(self._line, entries)), count)
        self._missing += dropped - self._noted  # they are later than the ones that waited
        self._noted = dropped

    def _line(self, entry: Entry) -> str:
        """The entry as a line, not before the last one: the time of an entry that missed its turn is moved."""
        self._written_s = max(self._written_s, entry.time_s)
        text = codecs.escape_encode(entry.data)[0].decode()
        return f"{self._written_s:.6f} {entry.direction} {text}\n"

    def _write(self, text: str, lines: int) -> None:
        data, lost = (("\n" if self._torn else "") + text).encode(), lines
        try:
            done = os.write(self._fd, data)
        except OSError as error:
            self.error = error.strerror or str(error)
        else:
            lost = min(lines, data[done:].count(b"\n"))
            kept = data[:done].lstrip(b"\n").rpartition(b"\n")[0]
            if kept:  # the first line, with the report of those before
                self._missing = 0
                if not kept.startswith(_MAGIC.encode()):
                    self._kept_s = float(kept.rpartition(b"\n")[2].partition(b" ")[0])
            self._torn = done < len(data)
            if self._torn:
                self.error = "the disk accepted only a part of a line"
                self._cut(len(data[:done].rpartition(b"\n")[2]))
        self.lost += lost
        self._missing += lost

    def _cut(self, torn: int) -> None:
        """Remove the bytes of a torn line at the end of the file, which could pass for a whole one."""
        with contextlib.suppress(OSError):  # a pipe has no end
            os.lseek(self._fd, -torn, os.SEEK_CUR)
            os.ftruncate(self._fd, os.lseek(self._fd, 0, os.SEEK_CUR))
            self._torn = False


def _open_alone(path: str) -> int:
    """Open a file for writing and empty it, unless another recorder writes it."""
    # A pipe that nobody reads is refused; without O_NONBLOCK it would hold the caller until somebody does.
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK, 0o600)
    if stat.S_ISREG(os.fstat(fd).st_mode):
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(fd)
            raise OSError(errno.EBUSY, "another recording is being written to it") from None
        except OSError:
            pass  # a file system without locks
        os.ftruncate(fd, 0)
    return fd


def _is_written(fd: int) -> bool:
    """Return whether a recorder writes a file that was opened for reading."""
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False


def started_s(header: Dict[str, Any]) -> float:
    """The wall clock when the recording began [s]; 0 if the file does not hold it."""
    try:
        return datetime.datetime.fromisoformat(str(header.get("started"))).timestamp()
    except (ValueError, OverflowError, OSError):
        return 0.0


class Recording:
    """Reads a recording as a stream: memory does not grow with the file.

    `header` holds the facts that the recorder wrote, none if it is damaged; `skipped` maps the number of each line that
    cannot be read (at most 100) to the reason; `grows` says whether a recorder still writes the file.  ConfigError if
    the file does not exist or is not a plain file (reading a port would wait for bytes), is not a recording, or has a
    newer version.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self.skipped: Dict[int, str] = {}
        self.skipped_count = 0
        try:
            with open_plain(path) as file:
                text = file.read(LONGEST_LINE)
                self.grows = _is_written(file.fileno())
        except OSError as error:
            raise ConfigError(f"cannot read {path!r}: {error.strerror}; give a recording") from None
        for start, what in _OTHERS.items():
            if text.startswith(start):
                raise ConfigError(f"cannot read {path!r}: it is {what}")
        self.header: Dict[str, Any] = {}
        skipped = len(text) - len(text.lstrip(_BLANK))
        self._line = text[:skipped].count(b"\n") + 1
        line = text[skipped:].partition(b"\n")[0]
        self._damage = self._read_header(line)
        if self._damage and not _ENTRY.search(text):
            raise ConfigError(f"{path}:{self._line}: {self._damage}: the file is not a recording")
        if _ENTRY.match(line):  # the header is missing
            self._line -= 1
        else:
            skipped += len(line) + 1
        self._begin = skipped  # where the entries begin, behind the line `_line`

    def _read_header(self, line: bytes) -> str:
        """Read the header; return what is wrong with it, and all that can be read without it is read."""
        magic, _, rest = line.decode(errors="replace").strip().partition(" ")
        version, _, header = rest.partition(" ")
        if magic != _MAGIC or not _NUMBER.fullmatch(version):
            return f"got {line[:40]!r}, expected '{_MAGIC} {VERSION} ...'"
        if int(version) > VERSION:
            raise ConfigError(
                f"{self.path}:{self._line}: recording version {version}, expected at most {VERSION}: update mrl-driver"
            )
        with contextlib.suppress(ValueError, RecursionError):
            found = json.loads(header or "{}")
            if isinstance(found, dict):
                self.header = found
                return ""
        return f"the header {header[:40]!r} is damaged, expected a JSON object"

    @property
    def start_us(self) -> int:
        """The driver's clock when the recording began [us]; 0 in files of older versions."""
        found = self.header.get("clock_us")
        return found if type(found) is int and abs(found) < 1 << 60 else 0

    def __iter__(self) -> Iterator[Entry]:
        """Entries in the order of the file; a line that cannot be read is noted in `skipped`.

        ConfigError if more than 100 000 lines cannot be read, and less than half of them can.
        """
        self.skipped.clear()
        self.skipped_count = 0
        if self._damage:
            self._skip(max(1, self._line), self._damage)
        with open_plain(self.path) as file:
            file.seek(self._begin)
            yield from read_lines(file, self._skip, self._line)

    def _skip(self, number: int, problem: str) -> None:
        self.skipped_count += 1
        if self.skipped_count > _MOST_SKIPPED and 2 * self.skipped_count > number:
            raise ConfigError(
                f"{self.path}:{number}: {self.skipped_count} of the lines so far cannot be read ({problem}), expected "
                "at most half of them; copy the file again, or cut the damaged part out"
            )
        if len(self.skipped) < 100:
            self.skipped[number] = problem


def read_lines(file: BinaryIO, skip: Skip, line: int = 1) -> Iterator[Entry]:
    """Yield the entries of all lines behind the line of this number, where `file` stands.

    `skip` is called in order with the number of each line that cannot be read and the reason.
    """
    waiting: Deque[_Line] = deque()
    times: Deque[float] = deque()  # of the entries that wait
    last_s = 0.0
    for found in itertools.chain(_lines(file, line), (None,)):
        if found is not None:
            waiting.append(found)
            if found[1] is not None:
                times.append(found[1].time_s)
        ends = found is None
        while waiting and (ends or waiting[0][1] is None or len(times) > AHEAD or len(waiting) > _MOST_HELD):
            number, entry, problem = waiting.popleft()
            if entry is not None:
                problem = _disorder(times.popleft(), last_s, times)
            if entry is None or problem:
                skip(number, problem)
            else:
                last_s = entry.time_s
                yield entry


def _disorder(time_s: float, last_s: float, behind: Deque[float]) -> str:
    """Return what is wrong with the time of a line, by those before and behind it; empty if nothing is."""
    if behind and min(behind) < time_s and sum(each < time_s for each in behind) > AHEAD // 2:
        return f"time {time_s} is after that of most of the {AHEAD} lines behind it"
    return f"time {time_s} is before {last_s} of an earlier line" if time_s < last_s else ""


def _lines(file: BinaryIO, number: int) -> Iterator[_Line]:
    """Yield all lines that are not blank behind the line of this number."""
    while True:
        text = file.readline(LONGEST_LINE + 1)
        number += 1
        if not text:
            return
        if len(text) > LONGEST_LINE:
            while text and not text.endswith(b"\n"):
                text = file.readline(LONGEST_LINE)
            yield number, None, f"longer than {LONGEST_LINE} bytes"
        elif not text.strip():
            continue
        elif not text.endswith(b"\n"):
            yield number, None, "incomplete"
        else:
            yield (number, *_parse(text))


def _parse(line: bytes) -> Tuple[Optional[Entry], str]:
    """The entry on a line, or None and what is wrong with it."""
    stamp, _, rest = line.strip(b"\r\n").partition(b" ")
    direction, _, text = rest.partition(b" ")
    try:
        time_s = float(stamp)
    except ValueError:
        return None, f"time is {stamp[:20]!r}, expected seconds"
    if not 0.0 <= time_s < 1e9:
        return None, f"time is {time_s}, expected 0 or more seconds"
    if direction not in (b">", b"<", b"!"):
        return None, f"direction is {direction[:20]!r}, expected '>', '<' or '!'"
    if text.endswith(_LINE_END) and text.count(b"\\") == 2:  # the common case
        text = text[: -len(_LINE_END)] + b"\r\n"
    elif b"\\" in text:
        if b"\\" in _ESCAPE.sub(b"", text):
            return None, f"bytes {text[:20]!r} are not escaped as in a Python string"
        text = codecs.escape_decode(text)[0]
    return Entry(time_s, direction.decode(), text), ""
