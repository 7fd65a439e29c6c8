"""What recording costs: CPU of a process that records a checked stream of 400 frames a second.

Writes `recording_cpu_percent_400hz` into build/bench/reliability.json.  Compared is the same process reading the same
chunks through the same kind of loop without recording, for the cost of recording is the difference.
"""

import itertools
import os
import resource
import subprocess
import sys
import tempfile
import time
from typing import Optional

from mrl_driver.protocol import Stamp, encode_reply, encode_request
from mrl_driver.recording.recording import FROM_BOARD, TO_BOARD, Recorder
from tests.bench import report

FRAMES_HZ, COMMANDS_HZ = 400, 20
RUNS, RUN_S = 5, 10.0
GOAL_PERCENT = 2.0


def cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


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
        used_s, start_s = cpu_s(), time.monotonic()
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
        return cpu_s() - used_s


def cost_percent(seconds: float = RUN_S) -> float:
    """Share of a core that recording takes: a recording process less one that only waits [%]."""

    def run(record: bool) -> float:
        command = [sys.executable, "-m", "tests.bench.bench_recording", str(int(record)), str(seconds)]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    return max(0.0, 100 * (run(True) - run(False)) / seconds)


def main() -> None:
    if len(sys.argv) == 3:
        print(worker(sys.argv[1] == "1", float(sys.argv[2])))
        return
    percent = round(report.median_of("recording", RUNS, cost_percent), 2)
    print(f"recording_cpu_percent_400hz {percent}  <= {GOAL_PERCENT}")
    print(report.write("reliability", {"recording_cpu_percent_400hz": percent}))


if __name__ == "__main__":
    main()
