"""What processes have used so far."""

import os
import time
from pathlib import Path
from typing import Union

Process = Union[int, str]  # An id, or `self`


def cpu_s(process: Process = "self") -> float:
    """CPU time, by the clock of the process, as clock_getcpuclockid(3) names it [s]; `/proc` has ticks of 10 ms."""
    pid = os.getpid() if process == "self" else int(process)
    return time.clock_gettime(~pid << 3 | 2)


def rss_mib(process: Process = "self") -> float:
    """Memory in RAM [MiB]."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
