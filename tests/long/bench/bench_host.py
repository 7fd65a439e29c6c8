"""`make bench-host`: decoding, the driver's load, and recording; build/bench/host.json.  FAST=1 is shorter.

Rates count the CPU time of this process, which other processes hardly change; how fast that CPU is, and what shares
its caches, shows in the references that run between the others: a bare loop that splits the same pieces and converts
the same numbers without any check, and a driverless read of the same stream.
"""

import itertools
import subprocess
import sys
import time
from typing import Callable, Dict, List

from mrl_driver.protocol import REPLIES, FrameDecoder
from tests.long.bench import bench_recording, long_recording, report

FRAMES = report.either(20000, 2000)
PIECE = 4096
RUNS = report.either(9, 1)
DRIVER_RUNS, DRIVER_S = report.either((5, 20), (1, 1))


def stream(checked: bool) -> bytes:
    """A stream of `@8` frames, as a board sends it."""
    return b"\r\n" + b"".join(itertools.islice(long_recording.telemetry(checked), FRAMES))


def rate(count: int, work: Callable[[], None]) -> float:
    start_s = time.process_time()
    work()
    return count / (time.process_time() - start_s)


def pieces_of(data: bytes) -> List[bytes]:
    return [data[i : i + PIECE] for i in range(0, len(data), PIECE)]


def decode_rate(data: bytes, checked: bool) -> float:
    pieces = pieces_of(data)

    def work() -> None:
        decoder = FrameDecoder(REPLIES, checked)
        assert sum(len(decoder.feed(piece)) for piece in pieces) == FRAMES

    return rate(FRAMES, work)


def bare_rate(data: bytes) -> float:
    """The least that a loop over frames can do with the same pieces: split and convert all, right or wrong."""
    pieces = pieces_of(data)

    def work() -> None:
        rest, count = b"", 0
        for piece in pieces:
            *frames, rest = (rest + piece).split(b"e")
            for frame in frames:
                _, *numbers = frame.split(b",")
                tuple(map(int, numbers))
            count += len(frames)
        assert count == FRAMES

    return rate(FRAMES, work)


def cpu_percent_50hz(reader: str, *fitted: str) -> float:
    """CPU of a `port_reader` of an emulated board's stream of 50 frames a second [%].

    `fitted` are further options of the board.
    """
    board = subprocess.Popen(
        [sys.executable, "-m", "sim_arduino.serve.main", "--robot", "traxbot", *fitted],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert board.stdout is not None
        port = board.stdout.readline().split()[0]
        command = [sys.executable, "-m", "tests.long.bench.port_reader", reader, port, str(DRIVER_S)]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    finally:
        board.terminate()
        board.wait()


def in_turn(runs: int, measures: Dict[str, Callable[[], float]]) -> Dict[str, List[float]]:
    """Each measure in `runs` rounds, in which they take turns, so that a busy machine is one for all."""
    rounds = report.repeat("round", runs, lambda: {key: measure() for key, measure in measures.items()})
    return {key: [one[key] for one in rounds] for key in measures}


def over(ours: List[float], reference: List[float]) -> List[float]:
    return [one / other for one, other in zip(ours, reference)]


def figures() -> Dict[str, report.Measured]:
    plain, checked = stream(False), stream(True)
    found = in_turn(
        RUNS,
        {
            "bare_split_frames_per_s": lambda: bare_rate(plain),
            "decode_frames_per_s": lambda: decode_rate(plain, False),
            "bare_split_checked_frames_per_s": lambda: bare_rate(checked),
            "decode_checked_frames_per_s": lambda: decode_rate(checked, True),
        },
    )
    found.update(
        in_turn(
            DRIVER_RUNS,
            {
                "cpu_percent_raw_read_50hz": lambda: cpu_percent_50hz("raw"),
                "cpu_percent_driver_50hz": lambda: cpu_percent_50hz("driver"),
                "cpu_percent_driver_and_imu_50hz": lambda: cpu_percent_50hz("driver", "--imu"),
            },
        )
    )
    driver = found["cpu_percent_driver_50hz"]
    found["decode_over_bare"] = over(found["decode_frames_per_s"], found["bare_split_frames_per_s"])
    found["decode_checked_over_bare"] = over(
        found["decode_checked_frames_per_s"], found["bare_split_checked_frames_per_s"]
    )
    found["driver_over_raw_read_cpu"] = over(driver, found["cpu_percent_raw_read_50hz"])
    found["cpu_percent_more_with_imu_50hz"] = [
        both - alone for both, alone in zip(found["cpu_percent_driver_and_imu_50hz"], driver)
    ]
    return {**found, **bench_recording.figures()}
