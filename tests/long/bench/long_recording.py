"""Makes a recording of a long drive, as the driver writes it: telemetry at 50 Hz with checksums, commands at 20 Hz."""

import codecs
import random
from typing import Iterator, Tuple

from mrl_driver.protocol import Stamp, encode_reply, encode_request
from mrl_driver.protocol.frames import to_int16

FRAME_S, TICKS = 312 * 64e-6, 312
"""Period of the telemetry; after 65536 frames, sequence number and board time are back at their start."""
CYCLE = 65536
STARTED = "2026-03-01T12:00:00+00:00"
_BOARD = (
    b'{"robot_id": 1, "version": 2, "protocol": 2, "motor_board_version": 2.5, "battery_v": 13.6, '
    b'"temperature_c": 25.0, "capabilities": ["check", "period", "sonars", "watchdog"]}'
)
_GREETING = (
    ("!", b"opened /dev/ttyACM0"),
    ("!", b"checked"),
    ("!", b'session joined {"board": %s, "stream": 8, "checked": true, "stamp_s": 0, "frame": ""}' % _BOARD),
)


def telemetry(checked: bool = True) -> Iterator[bytes]:
    """One cycle of `@8` frames of a robot that drives slowly in curves; the counters end where they began."""
    rng = random.Random(1)
    right = left = 0
    for i in range(CYCLE):
        turn = (-3, 0, 3, 0)[i * 64 // CYCLE % 4]
        right, left = right + 8 + turn, left + 8 - turn
        sonars = [rng.randrange(15, 646) for _ in range(3)]
        stamp = Stamp(to_int16(i), to_int16(i * TICKS)) if checked else None
        yield encode_reply(8, to_int16(right), to_int16(left), *sonars, stamp=stamp, checked=checked)


def entries(frames: int) -> Iterator[Tuple[float, str, bytes]]:
    """Time, direction and bytes of each entry."""
    rng, cycle = random.Random(2), list(telemetry())
    commands = [encode_request(11, 200, turn, checked=True) for turn in range(-300, 301)]
    info = encode_reply(5, 2500, 172, 1360, 2, 1, checked=True)
    for direction, data in _GREETING:
        yield 0.0, direction, data
    for i in range(frames):
        time_s, frame = 0.1 + i * FRAME_S + rng.uniform(0.0, 0.004), cycle[i % CYCLE]
        yield time_s, "<", frame
        if i % 5 in (0, 2):
            yield time_s + 0.005, ">", commands[i % len(commands)]
        if i % 50 == 25:
            yield time_s + 0.006, ">", encode_request(5, checked=True)
            yield time_s + 0.010, "<", info


def write(path: str, frames: int, damaged: float = 0.0, cut: bool = False) -> None:
    """Write the file.

    Args:
        damaged: share of the lines in which one byte is another one.
        cut: the file ends within a line.
    """
    rng = random.Random(3)
    with open(path, "wb") as file:
        file.write(b'#mrl-recording 1 {"port": "/dev/ttyACM0", "started": "%s"}\n' % STARTED.encode())
        line = b""
        for time_s, direction, data in entries(frames):
            line = b"%.6f %s %s\n" % (time_s, direction.encode(), codecs.escape_encode(data)[0])
            if damaged and rng.random() < damaged:
                at = rng.randrange(len(line))
                line = line[:at] + bytes([rng.randrange(256)]) + line[at + 1 :]
            file.write(line)
        if cut:
            file.truncate(file.tell() - len(line) // 2)
