"""What the driver sends, and what one damaged byte makes of it."""

import re
from functools import lru_cache
from typing import Iterator, List, NamedTuple

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory
from tests.scripted_line import ScriptedLine

SILENT_S = 1.0  # The board starts so much later than the driver [s]
SPEEDS = ((0.2, -0.1), (0.05, 0.05), (-0.3, 0.0), (0.0, 0.0))
"""Linear and angular speed [m/s, rad/s]: beyond 100 on the wire, within it, negative, zero."""
FRAME = re.compile(rb"@[^@]*?e")


class Fault(NamedTuple):
    """One damaged byte of a request: what happened to which one, and what arrives."""

    kind: str
    place: int
    wire: bytes


def faults(wire: bytes) -> Iterator[Fault]:
    """Each byte lost, doubled, swapped with the next one, and each of its bits flipped."""
    for i in range(len(wire)):
        yield Fault("lost", i, wire[:i] + wire[i + 1 :])
        yield Fault("doubled", i, wire[: i + 1] + wire[i:])
        for bit in range(8):
            yield Fault(f"bit {bit}", i, wire[:i] + bytes([wire[i] ^ 1 << bit]) + wire[i + 1 :])
        if wire[i : i + 1] != wire[i + 1 : i + 2] != b"":
            yield Fault("swapped", i, wire[:i] + wire[i + 1 : i + 2] + wire[i : i + 1] + wire[i + 2 :])


class Sent(NamedTuple):
    """The different requests of a session, in the order in which they were first sent."""

    greeting: List[bytes]
    drive: List[bytes]  # From the end of the greeting to the end of the session


@lru_cache(maxsize=None)
def sent(board: factory.Options, check: bool = True) -> Sent:
    """Greet, drive and leave a board that prints text, and starts late: each question is then asked in each form."""
    text = [b"[INFO] text"]
    line = ScriptedLine(
        factory.make(board).board,
        to_host=lambda data: data if line.now_s < SILENT_S or not text else text.pop() + data,
        start_s=SILENT_S,
    )
    driver = SteppedDriver(
        line, board.robot, Options(check=check, build="environment" if board.environment else "")
    )
    driver.connect()
    driven_s = line.now_s
    for speeds in SPEEDS:
        driver.drive(*speeds)
        driver.wait(0.4)
    driver.stop()
    driver.wait(1.2)
    driver.close()
    pieces = [(at_s >= driven_s, frame) for at_s, data in line.sent for frame in FRAME.findall(data)]
    found = [[frame for driven, frame in pieces if driven is phase] for phase in (False, True)]
    return Sent(*(list(dict.fromkeys(frames)) for frames in found))
