"""What is measured on the bare link, by requests and answers of the command table: no driver stands between.

Times are those of the link's clock, or of the board where a row says so.  Nothing moves without `moves`.
"""

import math
from statistics import median
from typing import Any, Callable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, Garbage, encode_reply, encode_request
from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.table import BY_NAME, TICK_S
from mrl_driver.robot.odometry import Wheels
from mrl_driver.session.board_clock import BoardClock
from mrl_driver.transport.link import Link

from .rows import OLD_TURNAROUNDS, TURNAROUNDS, Row, absent, failed

ANSWER_S, PATIENCE_S, AGAIN_S = 0.5, 10.0, 0.25
"""Time for an answer, for the first one, and from one attempt at that to the next [s]."""
ATTEMPTS = 5
BYTE_S = 1360 / 16e6  # a byte on the line, at the rate of the chip that is next to 115200 Bd [s]
REQUESTS, STREAM_S, CLOCK_S = 100, 3.0, 10.0
PERIOD_MS, SETTLING_S = 20, 0.1
TYPICAL_BYTES = 27  # length of the frames of the emulated figure
FED_S, DISTURBED_S = 0.6, 0.1
"""A board ends its checksums if it receives nothing for 2 s, also because two requests in a row were damaged.  Requests
delay the frames of this time [s]."""
WATCHDOG_MS, TRIALS = 250, 3
ROLL_S, STEADY_S, LONGEST_S = 1.6, 0.4, 1.2
"""Time to reach a speed also with weak gains and a weak battery, to measure it, and of the way to rest [s]."""
Clock = Callable[[], float]
FEED_S, SPEED_MM_S, LEAST_COUNTS_S = 0.1, 120, 25.0
STOPS, STILL_S = 10, 0.1
"""A stop is repeated until no wheel counts in `STILL_S` [s]."""


def no_answer(name: str) -> BoardTimeout:
    """Return the error of a board that has stopped answering."""
    return BoardTimeout(f"no answer to request {name} in {ATTEMPTS} attempts, expected one")


class Heard(NamedTuple):
    """A frame of the board, and the time at which it was read [s]."""

    frame: Frame
    time_s: float


class Line:
    """A bare link: requests, answers, and what was damaged.  `old` is one to a board of 2013.

    Attributes:
        damaged: Pieces that the decoder refused.
        bytes_in: Bytes that were read.
    """

    def __init__(self, link: Link, clock: Clock, old: bool = False) -> None:
        self._link, self.clock, self.old = link, clock, old
        self._decoder = FrameDecoder(REPLIES)
        self.damaged = self.bytes_in = 0

    def send(self, name: str, *args: int) -> None:
        """Send a request."""
        code = BY_NAME[name].code
        checked = (
            self._decoder.checked and name != "stop"
        )  # a damaged checksum must not keep a stop from the board
        self._link.write(encode_request(code, *args, checked=checked, wrapped=self.old))

    def heard(self, seconds: float) -> Iterator[Heard]:
        """Yield the frames of a duration as they arrive."""
        end_s = self.clock() + seconds
        while self.clock() < end_s:
            data = self._link.read(end_s - self.clock())
            self.bytes_in += len(data)
            for event in self._decoder.feed(data):
                if isinstance(event, Garbage):
                    self.damaged += 1
                else:
                    yield Heard(event, self.clock())

    def ask(self, name: str, *args: int, wait_s: float = ANSWER_S) -> Optional[Heard]:
        """Send a request and return its answer; None if there is none in time."""
        self.send(name, *args)
        code = BY_NAME[name].code
        return next((each for each in self.heard(wait_s) if each.frame.code == code), None)

    def surely(self, name: str, *args: int) -> Frame:
        """As `ask`, in several attempts; BoardTimeout if none is answered."""
        found = None
        for _ in range(ATTEMPTS):
            found = found or self.ask(name, *args)
        if found is None:
            raise no_answer(name)
        return found.frame

    def set_checked(self, checked: bool) -> None:
        """Turn checksums, sequence numbers and board time on or off; BoardTimeout if no answer confirms it."""
        for _ in range(ATTEMPTS):
            self.send("set_check", int(checked))
            self._decoder.checked = checked
            expected = Frame(BY_NAME["set_check"].code, (int(checked),))
            if any(each.frame == expected for each in self.heard(ANSWER_S)):
                return
        raise no_answer("set_check")

    def stand(self) -> bool:
        """Stop until the wheels stand; False if that was not seen."""
        for _ in range(STOPS):
            self.send("stop")
            first, _, later = self.ask("read_encoders"), list(self.heard(STILL_S)), self.ask("read_encoders")
            if first is not None and later is not None and not any(_turned(first, later)):
                return True
        return False

    def end(self, moved: bool = False) -> None:
        """End what these measurements, or a program before them, may have started.

        If they have `moved` the wheels, the watchdog stays on until these stand.
        """
        stands = not moved or self.stand()
        for name, *args in _ENDS[:2] if self.old else _ENDS:
            if stands or name != "set_watchdog":
                self.send(name, *args)

    def quiet(self) -> None:
        """As `end`, and forget what was damaged until then."""
        self.end()
        if self.old:
            list(self.heard(ANSWER_S))
        else:
            self.set_checked(False)
        self.damaged = 0


_ENDS: Sequence[Tuple[Any, ...]] = (
    *(("stop",), ("stop_stream",), ("stop_imu_stream",), ("stop_wheel_stream",)),
    *(("set_watchdog", 0), ("set_check", 0)),
)
"""Requests; boards of 2013 know two of them."""


def rows(link: Link, clock: Clock, moves: bool, old: bool = False) -> Iterator[Row]:
    """Measure all rows of the line; the wheels turn only with `moves`.  A board of 2013, which is `old`, has fewer."""
    line = Line(link, clock, old)
    yield first_answer(line)
    line.quiet()
    try:
        for key, name in (OLD_TURNAROUNDS if old else TURNAROUNDS).items():
            yield turnaround(line, key, name)
        yield plain_stream(line)
        if not old:
            yield from _checked(line, moves)
        yield damaged(line)
    except BoardTimeout:
        yield damaged(line)  # the likely cause
        raise
    finally:
        line.end(moves)


def damaged(line: Line) -> Row:
    """Data that were damaged until now."""
    return Row("frames_damaged", line.damaged, number=line.bytes_in, note=f"in {line.bytes_in} bytes")


def _checked(line: Line, moves: bool) -> Iterator[Row]:
    """Measure what needs checksums, sequence numbers, board time and the watchdog."""
    line.set_checked(True)
    full = streamed(line, STREAM_S)
    yield Row("checked_share", full.bytes_s * BYTE_S, 1.0, len(full.heard))
    slow = streamed(line, CLOCK_S, PERIOD_MS)
    yield from clocks(slow)
    numbered = len(full.heard) + len(slow.heard)
    yield Row("frames_lost", lost(full.heard) + lost(slow.heard), number=numbered)
    yield watchdog(line) if moves else absent("watchdog_ms", "wheels must turn: give --wheels-off-ground")


def first_answer(line: Line) -> Row:
    """Time from the opened port to the first answer; raise BoardTimeout if there is none."""
    start_s = line.clock()
    line.send("stop")
    while line.ask("robot_info" if line.old else "read_protocol", wait_s=AGAIN_S) is None:
        if line.clock() - start_s > PATIENCE_S:
            raise BoardTimeout(
                f"no answer to '@29e' within {PATIENCE_S:g} s, expected one; run: mrl doctor --port PORT"
            )
    took_s = line.clock() - start_s
    if line.old:
        return Row("first_answer_s", took_s)
    uptime_s = line.surely("read_status").args[1]
    reset = uptime_s <= took_s + 1.0
    note = "the board was reset" if reset else f"no reset, the board is up for {uptime_s} s"
    return Row("first_answer_s", took_s, note=note)


def turnaround(line: Line, key: str, name: str) -> Row:
    """Time from a request to the end of its answer; it is expected to be that of both on the line.

    BoardTimeout if several in a row are not answered.
    """
    times_us: List[float] = []
    size = missed = 0
    for _ in range(REQUESTS):
        start_s = line.clock()
        found = line.ask(name)
        missed = missed + 1 if found is None else 0
        if missed == ATTEMPTS:
            raise no_answer(name)
        if found is not None:
            times_us.append(1e6 * (found.time_s - start_s))
            size = len(encode_reply(found.frame.code, *found.frame.args))
    expected_us = 1e6 * BYTE_S * (len(encode_request(BY_NAME[name].code)) + size)
    return Row(key, median(times_us), expected_us, len(times_us), percentile(times_us, 0.99))


def percentile(values: Sequence[float], share: float) -> float:
    """Return the value that this share of all does not exceed."""
    return sorted(values)[math.ceil(share * len(values)) - 1]


# -- streams


class Streamed(NamedTuple):
    """Frames of a stream, the bytes of all data in a second, and the times at which the board was sent something."""

    heard: List[Heard]
    bytes_s: float
    fed_s: List[float]


def streamed(line: Line, seconds: float, *period_ms: int) -> Streamed:
    """Run the stream of 8, by default as fast as the line allows, and end it; BoardTimeout if there is none.

    That of January 2013 has the reply of 6.
    """
    codes = [BY_NAME[name].code for name in ("read_encoders_and_sonars", "read_encoders")[: 1 + line.old]]
    for _ in range(ATTEMPTS):
        line.send("start_stream", *period_ms)
        if any(each.frame.code in codes for each in line.heard(ANSWER_S)):
            break
    else:
        raise no_answer("start_stream")
    found, fed_s, sizes = [], [line.clock()], []
    for each in line.heard(SETTLING_S + seconds):
        if each.frame.code not in codes:
            continue
        found.append(each)
        sizes.append(line.bytes_in)
        if each.time_s - fed_s[-1] > FED_S:
            line.send("get_stream")
            fed_s.append(line.clock())
    line.send("stop_stream")
    list(line.heard(SETTLING_S))
    kept = [i for i, each in enumerate(found) if each.time_s > fed_s[0] + SETTLING_S]
    if len(kept) < 2:
        return Streamed([], 0.0, fed_s)
    first, last = kept[0], kept[-1]
    rate = (sizes[last] - sizes[first]) / max(1e-9, found[last].time_s - found[first].time_s)
    return Streamed(found[first:], rate, fed_s)


def plain_stream(line: Line) -> Row:
    """Rate of the stream without checksums.

    An old board is slower than the line, whatever the length of its frames.
    """
    full = streamed(line, STREAM_S)
    if line.old and full.heard:
        took_s = full.heard[-1].time_s - full.heard[0].time_s
        return Row("stream_hz", (len(full.heard) - 1) / took_s, number=len(full.heard))
    return Row("stream_hz", full.bytes_s / TYPICAL_BYTES, 1 / BYTE_S / TYPICAL_BYTES, len(full.heard))


def lost(heard: Sequence[Heard]) -> int:
    """Number of frames that are missing by their sequence numbers."""
    numbers = [each.frame.stamp.sequence for each in heard if each.frame.stamp]
    return sum(max(0, to_int16(later - earlier) - 1) for earlier, later in zip(numbers, numbers[1:]))


def clocks(seen: Streamed) -> Iterator[Row]:
    """Jitter of a stream with a period, board time against this computer's clock, and the delays of its frames."""
    clock, delays_ms, gaps_us, before = BoardClock(), [], [], None
    for heard in seen.heard:
        stamp = heard.frame.stamp
        if stamp is None:
            continue
        following = before is not None and to_int16(stamp.sequence - before.sequence) == 1
        clock.update(stamp.time, heard.time_s, following)
        delays_ms.append(1000 * clock.latency_s)
        if following and before is not None and not _disturbed(heard.time_s, seen.fed_s):
            gaps_us.append(1e6 * TICK_S * to_int16(stamp.time - before.time))
        before = stamp
    if len(gaps_us) < 2:
        keys = "stream_jitter_us", "clock_percent", "delay_ms"
        yield from (absent(key, "no frames with board time") for key in keys)
        return
    yield Row("stream_jitter_us", max(gaps_us) - min(gaps_us), number=len(gaps_us))
    yield Row("clock_percent", 100 * abs(clock.drift), number=len(delays_ms))
    yield Row("delay_ms", percentile(delays_ms, 0.99), number=len(delays_ms))


def _disturbed(time_s: float, fed_s: Sequence[float]) -> bool:
    return any(0 <= time_s - each < DISTURBED_S for each in fed_s)


# -- the watchdog


class Way(NamedTuple):
    """Counts of both wheels from a moment on until the robot stands, and the speed of each before it [1/s]."""

    counts: float
    wheels_s: Sequence[float]  # right, left

    @property
    def counts_s(self) -> float:
        """Their speed together [1/s]."""
        return sum(self.wheels_s)


def watchdog(line: Line) -> Row:
    """Time from the last byte to the watchdog's stop, by board time.

    The wheels roll on for this time, then come to rest as after a stop.  So their way from the last byte on is longer
    than that after a stop by this time, times their speed, which the board's own counts and times give.
    """
    line.surely("set_watchdog", WATCHDOG_MS)
    tried = [(way(line, SPEED_MM_S, stops=True), way(line, -SPEED_MM_S, stops=False)) for _ in range(TRIALS)]
    line.surely("set_watchdog", 0)
    whole = [(stopped, silent) for stopped, silent in tried if stopped and silent]
    if not whole:
        return absent("watchdog_ms", "answers were lost in each trial")
    slowest = [min(speeds) for speeds in zip(*(silent.wheels_s for _, silent in whole))]
    still = [name for name, counts_s in zip(Wheels._fields, slowest) if counts_s < LEAST_COUNTS_S]
    if still:
        cause = "wheel_dead" if len(still) < len(slowest) else "wheels_powerless"
        return failed("watchdog_ms", f"wheels that did not turn: {' and '.join(still)}", cause)
    times_ms = [1000 * (silent.counts - stopped.counts) / silent.counts_s for stopped, silent in whole]
    return Row("watchdog_ms", median(times_ms), WATCHDOG_MS, len(times_ms))


def way(line: Line, speed_mm_s: int, stops: bool) -> Optional[Way]:
    """Roll, then stop or fall silent; None if an answer was lost."""
    _roll(line, speed_mm_s, ROLL_S)
    before = line.ask("read_encoders")
    _roll(line, speed_mm_s, STEADY_S)
    if stops:
        line.send("stop")
    last = line.ask("read_encoders")
    list(line.heard(LONGEST_S))
    end = line.ask("read_encoders")
    line.send("stop")
    if before is None or last is None or end is None:
        return None
    stamps = last.frame.stamp, before.frame.stamp
    if stamps[0] is None or stamps[1] is None:
        return None
    seconds = to_int16(stamps[0].time - stamps[1].time) * TICK_S
    return Way(sum(_turned(last, end)), [each / seconds for each in _turned(before, last)])


def _roll(line: Line, speed_mm_s: int, seconds: float) -> None:
    for _ in range(round(seconds / FEED_S)):
        line.send("move_differential", speed_mm_s, 0)
        list(line.heard(FEED_S))


def _turned(first: Heard, second: Heard) -> List[int]:
    """Counts of the right and of the left wheel between two answers."""
    return [
        abs(to_int16(after - before)) for before, after in zip(first.frame.args[:2], second.frame.args[:2])
    ]
