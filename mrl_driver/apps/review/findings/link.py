"""Findings about the line: damage, losses, silences, delays."""

import math
from typing import List, NamedTuple, Tuple

import numpy as np

from mrl_driver.apps.review.drive_data import DriveData
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.recording.recording import FROM_BOARD
from mrl_driver.session.session import LATE_S, STALE_S

from .evidence import (
    INFO,
    SETTLING_S,
    STATUS,
    TELEMETRY,
    command_at,
    heard,
    interruptions,
    outside,
    ready_s,
    restarts,
    sent,
    times,
)
from .finding import Finding

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
`LATE_ANSWER_S` [s]: in that time the board's watchdog stops the robot.
"""
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


class _Silence(NamedTuple):
    """A time without telemetry."""

    begin_s: float
    end_s: float
    moving: bool
    asleep: bool  # the host sent nothing either, though it had to
    unsure: bool  # the host sent nothing either, and had nothing to send
    held: bool  # the frames of this time came afterwards
    lost: int  # frames that never came


def check(drive: DriveData) -> List[Finding]:
    """Return what is wrong with the line."""
    silences = _silences(drive)
    return [
        *_damage(drive),
        *_losses(drive),
        *_unanswered(drive),
        *_late_host(drive, silences),
        *_silent(drive, silences),
        *_slow(drive, silences),
        *_texts(drive),
        *_command_gaps(drive),
        *_skipped(drive),
    ]


def _damage(drive: DriveData) -> List[Finding]:
    pieces = [each for each in drive.garbage if each[1] == FROM_BOARD and each[2] != "text"]
    kept = outside([each[0] for each in pieces], interruptions(drive))
    pieces = [each for each, keep in zip(pieces, kept) if keep]
    count = len(pieces)
    if count < LEAST or count < LEAST_SHARE * len(drive.heard):
        return []
    places = max(1.0, drive.duration_s / BURST_S)
    expected = places * -math.expm1(-count / places)
    bursts = len({int(each[0] / BURST_S) for each in pieces})
    first = pieces[0]
    share = f"{count} pieces of data from the board were damaged, among {len(drive.heard)} good frames"
    if count >= BURSTS and bursts < 0.5 * expected:
        return [
            Finding(
                "noise_bursts",
                "The line was disturbed in bursts",
                f"{share}, all within {bursts} s of the drive: something disturbs the line for short times.",
                first[0],
                first[1],
                first[3],
                76,
            )
        ]
    return [
        Finding(
            "bad_cable",
            "The cable or the radio link damages data",
            f"{share}. Damaged frames are not used, so the robot misses telemetry and the board misses commands.",
            first[0],
            first[1],
            first[3],
            76,
        )
    ]


def _losses(drive: DriveData) -> List[Finding]:
    steps = np.diff(drive.lost.values, prepend=0.0)
    single = outside(drive.lost.time_s, interruptions(drive)) & (steps <= GAP) & (steps > 0)
    count = int(steps[single].sum())
    damaged = sum(
        direction == FROM_BOARD for _, direction, _, _ in drive.garbage
    )  # a damaged frame is missing too
    if count < LEAST + 2 * damaged or count < LEAST_SHARE * len(drive.heard):
        return []
    first = drive.lost.time_s[single][0]
    return [
        Finding(
            "frames_lost",
            "Frames of the board were lost",
            f"{count} frames never arrived, among {len(drive.heard)} that did. The next one follows the first gap.",
            *heard(drive, first),
            70,
        )
    ]


def _unanswered(drive: DriveData) -> List[Finding]:
    """Requests for status and info that were answered late or never, while telemetry came in time."""
    telemetry, asked, answered, missed = drive.poses.time_s, 0, 0, []
    down = interruptions(drive)
    gaps = [
        (float(telemetry[i]), float(telemetry[i + 1])) for i in np.flatnonzero(np.diff(telemetry) > LATE_S)
    ]
    down += [(begin_s - ANSWER_S, end_s) for begin_s, end_s in gaps]
    for code in (STATUS, INFO):
        requests = np.array([t for t, c in zip(drive.sent.times_s, drive.sent.codes) if c == code])
        answers = np.array([t for t, c in zip(drive.heard.times_s, drive.heard.codes) if c == code])
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
        return []
    at, code, _ = min(missed)
    late_s = [waited_s for _, _, waited_s in missed if waited_s <= ANSWER_S]
    never = max(asked - answered, len(missed) - len(late_s))
    if not late_s or 2 * never >= len(missed):
        if never <= 2 * asked * _missing_share(drive):
            return []  # the answers are missing, as much other data of the board is
        kind, title = "requests_lost", "Requests did not reach the board"
        text = f"{never} of {asked} requests had no answer, while the board's telemetry arrived. Commands get lost too."
    else:
        kind, title = "requests_late", "Requests reached the board late"
        text = (
            f"{len(missed)} of {asked} answers took up to {max(late_s):.1f} s, while the board's telemetry arrived "
            "in time. Commands come as late, and the board's watchdog stops the robot meanwhile."
        )
    return [Finding(kind, title, text, *sent(drive, at, code), 86)]


def _missing_share(drive: DriveData) -> float:
    """Share of the board's frames that were damaged or lost."""
    damaged = sum(direction == FROM_BOARD for _, direction, _, _ in drive.garbage)
    missing = max([float(damaged), *drive.lost.values[-1:].tolist()])
    return missing / max(1.0, missing + len(drive.heard))


def _silences(drive: DriveData) -> List[_Silence]:
    """All gaps in the telemetry that are longer than `LATE_S`."""
    arrivals, stamps = drive.poses.time_s, drive.stamps_s
    sends = np.frombuffer(drive.sent.times_s, dtype=float)
    lost_at, lost = np.append(drive.lost.time_s, math.inf), np.append(0.0, drive.lost.values)
    frames = np.frombuffer(drive.heard.times_s, dtype=float)
    frames = frames[np.isin(np.frombuffer(drive.heard.codes, dtype=np.int16), TELEMETRY)]
    found = []
    first_s = ready_s(drive) + SETTLING_S
    for i in np.flatnonzero(np.diff(arrivals) > LATE_S):
        begin_s, end_s = float(arrivals[i]), float(arrivals[i + 1])
        if begin_s < first_s:
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


def _late_host(drive: DriveData, silences: List[_Silence]) -> List[Finding]:
    """Times in which this computer neither sent nor read: what arrived came at once afterwards."""
    paused = _pauses(silences)
    stops = [stop for stop in drive.stops if stop.reason == StopReason.HOST_PAUSED]
    long = [each for each in paused if each.end_s - each.begin_s > STALE_S]
    if not stops and not long and len(paused) < LEAST:
        return []
    longest_s = max((each.end_s - each.begin_s for each in paused), default=0.0)
    count = max(len(paused), len(stops))
    at_s = min([each.end_s for each in paused[:1]] + [stop.time_s for stop in stops[:1]])
    seen = f"; the longest took {longest_s * 1000:.0f} ms" if paused else ""
    return [
        Finding(
            "late_host",
            "The computer was too busy to drive the robot",
            f"The program paused {times(count)}{seen}. Meanwhile it neither sent nor read anything; the board's "
            "frames waited for it.",
            *heard(drive, at_s, *TELEMETRY),
            82,
        )
    ]


def _silent(drive: DriveData, silences: List[_Silence]) -> List[Finding]:
    """Times without telemetry in which this computer was awake."""
    paused = _pauses(silences)
    long = [each for each in silences if each.end_s - each.begin_s > STALE_S and each not in paused]
    long = [each for each in long if not _covers(each, restarts(drive))]
    lost = [stop for stop in drive.stops if stop.reason == StopReason.LINK_LOST]
    ended_s = [time_s for time_s, text in drive.remarks if text.startswith("ended LinkLost")]
    held = [each for each in long if each.held]
    short = [each for each in silences if each.held]
    if not paused and len(short) >= LEAST:
        held = short
    unnumbered, ran_on = not len(drive.delays.time_s), restarts(drive, ran_on=True)
    cut = [each for each in long if not each.held and (each.lost or unnumbered or _covers(each, ran_on))]
    stalled = [each for each in long if not each.held and each not in cut]
    findings = []
    if cut or lost or ended_s or drive.opened[1:]:
        begins_s = [each.begin_s for each in cut] + [stop.time_s for stop in lost] + ended_s
        begins_s += [time_s for time_s, _ in drive.opened[1:]]
        total_s = sum(each.end_s - each.begin_s for each in cut)
        findings.append(
            Finding(
                "link_lost",
                "The connection to the robot was lost",
                f"It was lost {times(max(len(cut), len(lost), 1))}"
                + (f", for {total_s:.1f} s in all; the board went on meanwhile" if cut else "")
                + ("; the program ended then" if ended_s else "")
                + ". This is the last frame before.",
                *_last_before(drive, min(begins_s)),
                84,
            )
        )
    if held:
        findings.append(
            _long(
                drive,
                held,
                "line_stalled",
                "The line held data back",
                "The data came at once afterwards.",
                79,
            )
        )
    if stalled:
        findings.append(
            _long(
                drive,
                stalled,
                "board_silent",
                "The board sent nothing for a while",
                "No frame is missing: the board made none.",
                78,
            )
        )
    return findings


def _covers(silence: _Silence, times_s: List[float]) -> bool:
    """Return whether one of the times is in a silence, or shortly after it."""
    return any(silence.begin_s <= time_s <= silence.end_s + SETTLING_S for time_s in times_s)


def _long(drive: DriveData, found: List[_Silence], kind: str, title: str, why: str, weight: float) -> Finding:
    longest_s = max(each.end_s - each.begin_s for each in found)
    text = (
        f"No telemetry arrived {times(len(found))}, for up to {longest_s:.1f} s. {why} This is the first frame after "
        "it."
    )
    return Finding(kind, title, text, *heard(drive, found[0].end_s, *TELEMETRY), weight)


def _last_before(drive: DriveData, time_s: float) -> Tuple[float, str, bytes]:
    arrivals = drive.poses.time_s
    index = max(0, int(np.searchsorted(arrivals, time_s, side="right")) - 1)
    return heard(drive, arrivals[index] if len(arrivals) else time_s, *TELEMETRY)


def _slow(drive: DriveData, silences: List[_Silence]) -> List[Finding]:
    paused = [(each.begin_s, each.end_s + SETTLING_S) for each in silences]
    down = [*interruptions(drive), *(each for each in paused)]
    trips = drive.round_trips.values[outside(drive.round_trips.time_s, down)]
    free = outside(drive.delays.time_s, down)
    delays = drive.delays.values[free]
    middle_s = float(np.median(trips)) if len(trips) >= LEAST else 0.0
    late = float(np.mean(delays > SLOW_S)) if len(delays) else 0.0
    if middle_s <= SLOW_S and late <= SLOW_SHARE:
        return []
    if middle_s > SLOW_S:
        text = f"The median time from a request to its answer was {middle_s:.3f} s, expected at most {SLOW_S:g} s."
        slowest = int(np.argmax(drive.round_trips.values))
        frame = heard(drive, drive.round_trips.time_s[slowest], INFO)
    else:
        text = f"{late:.0%} of the telemetry came more than {SLOW_S:g} s late."
        frame = heard(drive, drive.delays.time_s[free][int(np.argmax(delays))], *TELEMETRY)
    return [
        Finding(
            "slow_line",
            "The line to the robot was slow",
            f"{text} The robot answers and stops later.",
            *frame,
            68,
        )
    ]


def _texts(drive: DriveData) -> List[Finding]:
    texts = [each for each in drive.garbage if each[2] == "text" and each[0] > ready_s(drive) + SETTLING_S]
    if len(texts) < TEXTS or 2 * len(texts) < len(drive.garbage):
        return []
    first = texts[0]
    return [
        Finding(
            "debug_text",
            "The board sends text between its frames",
            f"{len(texts)} lines of text arrived. They take time on the line, and delay telemetry and commands.",
            first[0],
            first[1],
            first[3],
            30,
        )
    ]


def _command_gaps(drive: DriveData) -> List[Finding]:
    commands = drive.commands
    moving = commands.time_s[np.any(commands.values != 0.0, axis=1)]
    gaps = []
    for stop in drive.stops:
        after = moving[np.searchsorted(moving, stop.time_s, side="right") :]
        if stop.reason == StopReason.COMMAND_TIMEOUT and len(after) and after[0] - stop.time_s <= RESUMED_S:
            gaps.append(stop)
    if len(gaps) < RESUMED:
        return []
    first = gaps[0]
    return [
        Finding(
            "command_gaps",
            "Commands came too rarely",
            f"The driver stopped the robot {times(len(gaps))} because no new command came in time, and it drove on "
            "soon after.",
            first.time_s,
            first.direction,
            first.data,
            48,
        )
    ]


def _skipped(drive: DriveData) -> List[Finding]:
    if not drive.skipped_lines:
        return []
    return [
        Finding(
            "recording_damaged",
            "Parts of the recording cannot be read",
            f"{drive.skipped_lines} lines were skipped: figures near them may be wrong.",
            drive.duration_s,
            "",
            b"",
            15,
        )
    ]
