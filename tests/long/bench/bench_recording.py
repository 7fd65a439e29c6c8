"""What recording costs, and how long the summary of ten hours takes: part of `make bench-host`.

`recording_cpu_percent_400hz` is the CPU of a process that records a checked stream of 400 frames a second.  Compared is
the same process reading the same chunks through the same kind of loop without recording, for the cost of recording is
the difference.

Time and memory of `mrl replay` are those of 1.8 million frames (10 h at 50 Hz): of a file as the driver writes it, and
of one with a wrong byte in each thousandth line that ends within a line.
"""

import itertools
import os
import subprocess
import sys
import tempfile
import time
from typing import Dict, List, Optional, Tuple

from mrl_driver.protocol import Stamp, encode_reply, encode_request
from mrl_driver.recording.recording import FROM_BOARD, TO_BOARD, Recorder
from tests.long.bench import long_recording, report

FRAMES_HZ, COMMANDS_HZ = 400, 20
RUNS, RUN_S = report.either((5, 10.0), (1, 0.5))
HOURS = 10
FRAMES = report.either(HOURS * 3600 * 50, 5000)


def worker(record: bool, seconds: float) -> float:
    """CPU that this process takes for a stream at its real pace [s]."""
    frames = [
        encode_reply(8, 50 * i, -50 * i, 150, 200, 80, stamp=Stamp(i, 39 * i), checked=True)
        for i in range(FRAMES_HZ)
    ]
    command = encode_request(11, 200, -300, checked=True)
    recorder: Optional[Recorder] = None
    with tempfile.TemporaryDirectory() as folder:
        if record:
            recorder = Recorder(os.path.join(folder, "log"))
        used_s, start_s = time.process_time(), time.monotonic()
        for i in itertools.count():
            due_s = start_s + i / FRAMES_HZ
            if due_s > start_s + seconds:
                break
            time.sleep(max(0.0, due_s - time.monotonic()))
            if recorder is not None:
                recorder.add(FROM_BOARD, frames[i % FRAMES_HZ])
                if i % (FRAMES_HZ // COMMANDS_HZ) == 0:
                    recorder.add(TO_BOARD, command)
        if recorder is not None:
            recorder.close()
            assert recorder.lost == 0, recorder.error
        return time.process_time() - used_s


def cost_percent(seconds: float = RUN_S) -> float:
    """Share of a core that recording takes: a recording process less one that only waits [%]."""

    def run(record: bool) -> float:
        command = [sys.executable, "-m", "tests.long.bench.bench_recording", str(int(record)), str(seconds)]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    return max(0.0, 100 * (run(True) - run(False)) / seconds)


def summary_cost(path: str) -> Tuple[float, float]:
    """Run `mrl replay` on this file: its time [s] and most memory [MiB]."""
    start_s = time.monotonic()
    command = [sys.executable, "-m", "mrl_driver", "replay", path, "--json"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, process.returncode, usage = os.wait4(process.pid, 0)
    assert process.returncode == 0, process.returncode
    return time.monotonic() - start_s, usage.ru_maxrss / 1024


def figures() -> Dict[str, List[float]]:
    """Time and memory of the summary of a whole file and of a damaged one, and the cost of recording."""
    found: Dict[str, List[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "drive.mrl")
        for key, damage in (("", {}), ("_damaged", {"damaged": 0.001, "cut": True})):
            long_recording.write(path, frames=FRAMES, **damage)
            name = f"summary_{HOURS}h{key}"
            cost = dict(zip(("s", "mib"), summary_cost(path)))
            found.update({f"{name}_{unit}": [value] for unit, value in cost.items()})
    found["recording_cpu_percent_400hz"] = report.repeat("recording", RUNS, cost_percent)
    return found


if __name__ == "__main__":
    print(worker(sys.argv[1] == "1", float(sys.argv[2])))
