"""What processes have used so far."""

import os
from pathlib import Path
from typing import Union

Process = Union[int, str]  # An id, or `self`


def cpu_s(process: Process = "self") -> float:
    """CPU time, in ticks of 10 ms [s]."""
    user, system = Path(f"/proc/{process}/stat").read_text(errors="replace").rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def rss_mib(process: Process = "self") -> float:
    """Memory in RAM [MiB]."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
