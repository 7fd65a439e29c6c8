"""Reads recordings line by line and byte by byte: what the fast reader must give."""

import codecs
import re
import warnings
from collections import Counter

from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_CODE, SENSOR_BY_NAME
from mrl_driver.recording.decoded import RecordedRobot, decode, sensors_in
from mrl_driver.recording.lines import AHEAD
from mrl_driver.recording.recording import FROM_BOARD, REMARK, TO_BOARD, Entry


def entries(path):
    """Entries of a file, and the numbers of the lines that are skipped."""
    with open(path, "rb") as file:
        lines = list(enumerate(file, 1))[1:]
    found = [(number, entry) for number, line in lines if line.strip() for entry in [entry_of(line)]]
    good = [(number, entry) for number, entry in found if entry]
    skipped = {number for number, entry in found if not entry}
    kept, last_s = [], 0.0
    for i, (number, entry) in enumerate(good):
        behind = [later.time_s for _, later in good[i + 1 : i + 1 + AHEAD]]
        ahead = sum(time_s < entry.time_s for time_s in behind) > AHEAD // 2
        if ahead or entry.time_s < last_s:
            skipped.add(number)
        else:
            kept.append(entry)
            last_s = entry.time_s
    return kept, skipped


def entry_of(line):
    """The entry on a line, or None."""
    if not line.endswith(b"\n"):
        return None
    stamp, _, rest = line.strip(b"\r\n").partition(b" ")
    direction, _, text = rest.partition(b" ")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            time_s, data = float(stamp), codecs.escape_decode(text)[0]
    except (ValueError, Warning):
        return None
    wide = re.search(
        rb"(?<!\\)(\\\\)*\\[4-7][0-7]{2}", text
    )  # before 3.12 Python wraps such a number silently
    known = not wide and direction in (b">", b"<", b"!") and 0.0 <= time_s < 1e9
    return Entry(time_s, direction.decode(), data) if known else None


def summary(path):
    """The figures of `summarise` that depend on the lines, but `skipped`."""
    kept, skipped = entries(path)
    robot, sizes, frames, requests, garbage, sensors = (
        RecordedRobot(None),
        Counter({FROM_BOARD: 0, TO_BOARD: 0}),
        Counter(),
        Counter(),
        Counter(),
        {},
    )
    for time_s, direction, data, events in decode(kept):
        if direction == REMARK:
            robot.begin_again()
            continue
        sizes[direction] += len(data)
        for event in events:
            if direction == TO_BOARD:
                requests.update([event.code] if isinstance(event, Frame) else [])
            elif isinstance(event, Frame):
                frames[event.code] += 1
                robot.take(event, time_s)
                for name, reading in sensors_in(event, time_s).items():
                    sensors.setdefault(name, []).extend(reading.values)
            else:
                garbage[event.reason] += 1
    moves = robot.model is not None and robot.model.drives
    named = lambda codes: {BY_CODE[code].name: count for code, count in sorted(codes.items())}  # noqa: E731
    return {
        "robot": robot.model.name if robot.model else None,
        "robot_id": robot.robot_id,
        "bytes_from_board": sizes[FROM_BOARD],
        "bytes_to_board": sizes[TO_BOARD],
        "frames": named(frames),
        "requests": named(requests),
        "garbage": dict(sorted(garbage.items())),
        "lost": robot.counters.lost,
        "duplicates": robot.counters.duplicates,
        "refused_counts": (robot.odometry.baseline.refused if robot.odometry else 0) if moves else None,
        "pose": (robot.odometry.pose if robot.odometry else ORIGIN)._asdict() if moves else None,
        "sensors": {
            name: {
                "least": min(values),
                "most": max(values),
                "unit": SENSOR_BY_NAME[name].fields[0].base_unit,
            }
            for name, values in sensors.items()
        },
        "imu": robot.imu_state,
        "skipped_lines": len(skipped),
    }
