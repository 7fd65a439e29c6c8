"""Findings about the line: damage, losses, silences, delays."""

import math
from typing import Iterator, List, NamedTuple, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.errors import LinkLost
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.recording.recording import ENDED, FROM_BOARD, LOST, TO_BOARD
from mrl_driver.session.events import Ready, Stale
from mrl_driver.session.session import LATE_S, STALE_S

from .evidence import (
    INFO,
    SETTLING_S,
    STATUS,
    TELEMETRY,
    Finding,
    command_at,
    finding,
    heard,
    interruptions,
    outside,
    ready_s,
    restarts,
    times,
)

LEAST, LEAST_SHARE = 3, 1e-4
"""A line is bad if at least this many frames are damaged, and this share of all.  A USB cable in order damages none."""
BURSTS, BURST_S = 10, 1.0
"""Damage comes in bursts if at least this many pieces fall on half as many times of `BURST_S` as chance would give."""
SLOW_S = 0.05
"""A round trip or a delay above this is slow [s], as in `mrl doctor`: the line takes 3 ms, a USB adapter up to 16 ms
more."""
SLOW_SHARE = 0.05  # telemetry is late if more than this share of it is slower than `SLOW_S`
UNANSWERED_SHARE, LATE_ANSWER_S, ANSWER_S = 0.02, 0.25, 1.0
"""Requests get lost if more than this share has no answer within `ANSWER_S`, or come late if it has none within
`LATE_ANSWER_S` [s]: in that time the board's watchdog stops the robot."""
TEXTS = 3
GAP = 5  # more lost frames than this in a row are a silence, not single losses
AT_ONCE_S = 0.02  # more than `GAP` frames within this time came at once [s]: the stream has one
ASLEEP_S, AWAKE_S = 0.03, 0.11
"""While a command is in force, the driver repeats it every 0.1 s, but not if it received nothing for `LATE_S`.  A
computer that is awake therefore most often sends a frame in this part of a silence [s]."""
ASKS_S = 0.05
"""A driver that receives nothing sends no commands; it greets the board within this time after `STALE_S` [s]."""
RESUMED_S, RESUMED = 1.5, 3
"""Commands come too rarely if they time out this often, and another one follows within this time [s]."""


_LOST = LOST.decode(), ENDED.decode() + LinkLost.__name__
"""Remarks on a lost port begin with one of these."""


class _Silence(NamedTuple):
    """A time without telemetry."""

    begin_s: float
    end_s: float
    moving: bool
    asleep: bool  # the host sent nothing either, though it had to
    unsure: bool  # the host sent nothing either, and had nothing to send
    held: bool  # the frames of this time came afterwards
    lost: int  # frames that never came


def check(drive: DriveData) -> Iterator[Finding]:
    """Return what is wrong with the line."""
    for part in (_damage, _losses, _unanswered, _texts, _command_gaps, _skipped, _break):
        yield from part(drive)
    yield from _silent_end(drive)
    silences = _silences(drive)
    for of_silences in (_late_host, _silent, _slow):
        yield from of_silences(drive, silences)


def _damage(drive: DriveData) -> Iterator[Finding]:
    pieces = [each for each in drive.garbage if each[1] == FROM_BOARD and each[2] != "text"]
    kept = outside([each[0] for each in pieces], interruptions(drive))
    pieces = [each for each, keep in zip(pieces, kept) if keep]
    count = len(pieces)
    if count < LEAST or count < LEAST_SHARE * len(drive.heard):
        return
    places = max(1.0, drive.duration_s / BURST_S)
    expected = places * -math.expm1(-count / places)
    bursts = len({int(each[0] / BURST_S) for each in pieces})
    share = f"{count} pieces of data from the board were damaged, among {len(drive.heard)} good frames"
    if count >= BURSTS and bursts < 0.5 * expected:
        kind = "noise_bursts"
        text = f"{share}, all within {bursts} s of the drive: something disturbs the line for short times."
    else:
        kind = "bad_cable"
        text = f"{share}. Damaged frames are not used, so the robot misses telemetry and the board misses commands."
    yield finding(kind, 76, text, _piece(pieces[0]))


def _piece(garbage: Tuple[float, str, str, bytes]) -> Tuple[float, str, bytes]:
    """Return moment, direction and bytes of data that is not a frame, for a `Finding`."""
    return garbage[0], garbage[1], garbage[3]


def _losses(drive: DriveData) -> Iterator[Finding]:
    steps = np.diff(drive.lost.values, prepend=0.0)
    single = outside(drive.lost.time_s, interruptions(drive)) & (steps <= GAP) & (steps > 0)
    count = int(steps[single].sum())
    if count >= LEAST + 2 * _damaged(drive) and count >= LEAST_SHARE * len(drive.heard):
        text = f"{count} frames never arrived, among {len(drive.heard)} that did. The next one follows the first gap."
        yield finding("frames_lost", 70, text, heard(drive, drive.lost.time_s[single][0]))


def _damaged(drive: DriveData) -> int:
    """Return how many pieces from the board were damaged; the frames that they were are missing too."""
    return sum(direction == FROM_BOARD for _, direction, _, _ in drive.garbage)


def _unanswered(drive: DriveData) -> Iterator[Finding]:
    """Requests for status and info that were answered late or never, while telemetry came in time."""
    telemetry, asked, answered, missed = drive.poses.time_s, 0, 0, []
    gaps = np.flatnonzero(np.diff(telemetry) > LATE_S)
    down = interruptions(drive) + [(float(telemetry[i]) - ANSWER_S, float(telemetry[i + 1])) for i in gaps]
    for code in (STATUS, INFO):
        requests, answers = drive.sent.times_of(code), drive.heard.times_of(code)
        if not len(requests) or not len(answers):
            continue
        requests = requests[outside(requests, down) & (requests < drive.duration_s - ANSWER_S)]
        waited = np.append(answers, math.inf)[np.searchsorted(answers, requests)] - requests
        asked += len(requests)
        counted = outside(answers, down) & (answers < drive.duration_s - ANSWER_S + LATE_ANSWER_S)
        answered += int(counted.sum())
        late = waited > LATE_ANSWER_S
        missed += [(float(at), code, float(s)) for at, s in zip(requests[late], waited[late])]
    if len(missed) < LEAST or len(missed) < UNANSWERED_SHARE * asked:
        return
    at, code, _ = min(missed)
    late_s = [waited_s for _, _, waited_s in missed if waited_s <= ANSWER_S]
    never = max(asked - answered, len(missed) - len(late_s))
    if late_s and 2 * never < len(missed):
        kind = "requests_late"
        text = (
            f"{len(missed)} of {asked} answers took up to {max(late_s):.1f} s, while the board's telemetry arrived "
            "in time. Commands come as late, and the board's watchdog stops the robot meanwhile."
        )
    elif never <= 2 * asked * _missing_share(drive):
        return  # the answers are missing, as much other data of the board is
    else:
        kind = "requests_lost"
        text = f"{never} of {asked} requests had no answer, while the board's telemetry arrived. Commands get lost too."
    yield finding(kind, 86, text, (at, TO_BOARD, drive.sent.at(at, code)))


def _missing_share(drive: DriveData) -> float:
    """Share of the board's frames that were damaged or lost."""
    missing = max([float(_damaged(drive)), *drive.lost.values[-1:].tolist()])
    return missing / max(1.0, missing + len(drive.heard))


def _silences(drive: DriveData) -> List[_Silence]:
    """All gaps in the telemetry that are longer than `LATE_S`, but for those in which nothing was recorded."""
    arrivals, stamps = drive.poses.time_s, drive.stamps_s
    sends = np.frombuffer(drive.sent.times_s, dtype=float)
    lost_at, lost = np.append(drive.lost.time_s, math.inf), np.append(0.0, drive.lost.values)
    frames = drive.heard.times_of(*TELEMETRY)
    found = []
    first_s = ready_s(drive) + SETTLING_S
    for i in np.flatnonzero(np.diff(arrivals) > LATE_S):
        begin_s, end_s = float(arrivals[i]), float(arrivals[i + 1])
        if begin_s < first_s or any(gap.begin_s < end_s and gap.end_s > begin_s for gap in drive.gaps):
            continue
        moving = bool(np.any(command_at(drive, [begin_s])))
        inside = sends[(sends > begin_s + 0.005) & (sends < end_s - 0.002)]
        quiet_s = float(np.max(np.diff([begin_s, *inside, end_s])))
        asleep = quiet_s > 2 * STALE_S
        if moving and end_s - begin_s > STALE_S + ASKS_S:
            asleep = quiet_s > STALE_S + ASKS_S
        elif moving:
            asleep = not np.any((inside > begin_s + ASLEEP_S) & (inside < begin_s + AWAKE_S))
        unsure = not asleep and quiet_s > 0.7 * (end_s - begin_s)
        unused = frames[(frames > begin_s) & (frames < end_s)]  # while the driver greeted the board again
        at_once = bool(np.any(unused[GAP:] - unused[:-GAP] < AT_ONCE_S))
        held = at_once or bool(stamps[i + 1] < end_s - 0.5 * (end_s - begin_s))
        missing = (
            lost[np.searchsorted(lost_at, end_s + 1e-3)] - lost[np.searchsorted(lost_at, begin_s + 1e-3)]
        )
        found.append(_Silence(begin_s, end_s, moving, asleep, unsure, held, int(missing)))
    return found


def _pauses(silences: List[_Silence]) -> List[_Silence]:
    """Silences in which the host slept; if it did once, those in which it had nothing to send count too."""
    driven = [each for each in silences if each.held and each.moving]
    if 2 * sum(each.asleep for each in driven) < len(driven):
        return []  # awake in most of them: the line held the data back
    sure = any(each.asleep and each.held for each in silences)
    return [each for each in silences if each.held and (each.asleep or (sure and each.unsure))]


def _late_host(drive: DriveData, silences: List[_Silence]) -> Iterator[Finding]:
    """Times in which this computer neither sent nor read: what arrived came at once afterwards."""
    paused = _pauses(silences)
    stops = [stop for stop in drive.stops if stop.reason == StopReason.HOST_PAUSED]
    if not stops and not _long(paused) and len(paused) < LEAST:
        return
    longest_s = max((each.end_s - each.begin_s for each in paused), default=0.0)
    at_s = min([each.end_s for each in paused[:1]] + [stop.time_s for stop in stops[:1]])
    seen = f"; the longest took {longest_s * 1000:.0f} ms" if paused else ""
    text = (
        f"The program paused {times(max(len(paused), len(stops)))}{seen}. Meanwhile it neither sent nor read anything; "
        "the board's frames waited for it."
    )
    yield finding("late_host", 82, text, heard(drive, at_s, *TELEMETRY))


def _long(silences: List[_Silence]) -> List[_Silence]:
    """Return the silences after which the driver no longer trusts its telemetry."""
    return [each for each in silences if each.end_s - each.begin_s > STALE_S]


def _silent(drive: DriveData, silences: List[_Silence]) -> Iterator[Finding]:
    """Times without telemetry in which this computer was awake."""
    paused, restarted = _pauses(silences), restarts(drive)
    long = [each for each in _long(silences) if each not in paused and not _covers(each, restarted)]
    held = [each for each in long if each.held]
    short = [each for each in silences if each.held]
    if not paused and len(short) >= LEAST:
        held = short
    unnumbered, ran_on = not len(drive.delays.time_s), restarts(drive, ran_on=True)
    gone = [each for each in long if not each.held]
    cut = [each for each in gone if each.lost or unnumbered or _covers(each, ran_on)]
    yield from _lost_link(drive, cut)
    stalled = [each for each in gone if each not in cut]
    for kind, weight, found, why in (
        ("line_stalled", 79, held, "The data came at once afterwards."),
        ("board_silent", 78, stalled, "No frame is missing: the board made none."),
    ):
        if found:
            longest_s = max(each.end_s - each.begin_s for each in found)
            text = (
                f"No telemetry arrived {times(len(found))}, for up to {longest_s:.1f} s. {why} This is the first frame "
                "after it."
            )
            yield finding(kind, weight, text, heard(drive, found[0].end_s, *TELEMETRY))


def _silent_end(drive: DriveData) -> Iterator[Finding]:
    """The telemetry stopped, and did not come back before the recording ended; the port was still there."""
    states = [(time_s, event) for time_s, event in drive.events if isinstance(event, (Ready, Stale))]
    frames = drive.heard.times_of(*TELEMETRY)
    if not states or not isinstance(states[-1][1], Stale) or not len(frames) or frames[-1] > states[-1][0]:
        return
    last_s = float(frames[-1])
    if not any(time_s >= last_s and text.startswith(_LOST) for time_s, text in drive.remarks):
        text = (
            f"No telemetry arrived from {last_s:.1f} s to the end of the recording, for "
            f"{drive.duration_s - last_s:.1f} s: the board or the line failed. This is the last frame."
        )
        title = "The board fell silent, and stayed silent"
        yield finding("board_silent", 84, text, heard(drive, last_s, *TELEMETRY), title=title)


def _lost_link(drive: DriveData, cut: List[_Silence]) -> Iterator[Finding]:
    """The connection ended, for the time of these silences or for good."""
    lost = [stop for stop in drive.stops if stop.reason == StopReason.LINK_LOST]
    ended_s = [time_s for time_s, text in drive.remarks if text.startswith(_LOST[1])]
    begins_s = [each.begin_s for each in cut] + [stop.time_s for stop in lost] + ended_s
    begins_s += [time_s for time_s, _ in drive.opened[1:]]
    if begins_s:
        total_s = sum(each.end_s - each.begin_s for each in cut)
        text = (
            f"It was lost {times(max(len(cut), len(lost), 1))}"
            + (f", for {total_s:.1f} s in all; the board went on meanwhile" if cut else "")
            + ("; the program ended then" if ended_s else "")
            + ". This is the last frame before."
        )
        arrivals, last_s = drive.poses.time_s, min(begins_s)
        if len(arrivals):
            last_s = arrivals[max(0, int(np.searchsorted(arrivals, last_s, side="right")) - 1)]
        frame = heard(drive, last_s, *TELEMETRY)
        yield finding("link_lost", 84, text, frame, title="The connection to the robot was lost")


def _covers(silence: _Silence, times_s: List[float]) -> bool:
    """Return whether one of the times is in a silence, or shortly after it."""
    return any(silence.begin_s <= time_s <= silence.end_s + SETTLING_S for time_s in times_s)


def _slow(drive: DriveData, silences: List[_Silence]) -> Iterator[Finding]:
    down = interruptions(drive) + [(each.begin_s, each.end_s + SETTLING_S) for each in silences]
    trips = drive.round_trips.values[outside(drive.round_trips.time_s, down)]
    free = outside(drive.delays.time_s, down)
    delays = drive.delays.values[free]
    middle_s = float(np.median(trips)) if len(trips) >= LEAST else 0.0
    late = float(np.mean(delays > SLOW_S)) if len(delays) else 0.0
    if middle_s > SLOW_S:
        text = f"The median time from a request to its answer was {middle_s:.3f} s, expected at most {SLOW_S:g} s."
        slowest = int(np.argmax(drive.round_trips.values))
        frame = heard(drive, drive.round_trips.time_s[slowest], INFO)
    elif late > SLOW_SHARE:
        text = f"{late:.0%} of the telemetry came more than {SLOW_S:g} s late."
        frame = heard(drive, drive.delays.time_s[free][int(np.argmax(delays))], *TELEMETRY)
    else:
        return
    yield finding("slow_line", 68, f"{text} The robot answers and stops later.", frame)


def _texts(drive: DriveData) -> Iterator[Finding]:
    texts = [each for each in drive.garbage if each[2] == "text" and each[0] > ready_s(drive) + SETTLING_S]
    if len(texts) >= TEXTS and 2 * len(texts) >= len(drive.garbage):
        text = f"{len(texts)} lines of text arrived. They take time on the line, and delay telemetry and commands."
        yield finding("debug_text", 30, text, _piece(texts[0]))


def _command_gaps(drive: DriveData) -> Iterator[Finding]:
    commands = drive.commands
    moving = commands.time_s[np.any(commands.values != 0.0, axis=1)]
    gaps = []
    for stop in drive.stops:
        after = moving[np.searchsorted(moving, stop.time_s, side="right") :]
        if stop.reason == StopReason.COMMAND_TIMEOUT and len(after) and after[0] - stop.time_s <= RESUMED_S:
            gaps.append(stop)
    if len(gaps) >= RESUMED:
        text = (
            f"The driver stopped the robot {times(len(gaps))} because no new command came in time, and it drove on "
            "soon after."
        )
        yield finding("command_gaps", 48, text, gaps[0].frame)


def _skipped(drive: DriveData) -> Iterator[Finding]:
    if drive.skipped_lines:
        text = f"{drive.skipped_lines} lines are damaged or missing: figures near them may be wrong."
        for gap in drive.gaps[:1]:
            text += f" From {gap.begin_s:.1f} s to {gap.end_s:.1f} s nothing could be written: {gap.reason}."
        at_s = drive.gaps[0].begin_s if drive.gaps else drive.duration_s
        yield finding("recording_damaged", 15, text, (at_s, "", b""))


def _break(drive: DriveData) -> Iterator[Finding]:
    """The end of the recording is missing, and the last command moves the robot."""
    if drive.breaks_off and np.any(command_at(drive, [np.nextafter(drive.duration_s, math.inf)])):
        at_s = float(drive.commands.time_s[-1])
        text = "Its end is missing, and its last command moves the robot. What happened then is not in it."
        yield finding("recording_breaks_off", 83, text, (at_s, TO_BOARD, drive.sent.at(at_s)))
