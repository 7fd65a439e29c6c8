"""Reads an emulated board's stream of 50 frames a second, and prints the CPU share that it took [%].

`python -m tests.long.bench.port_reader driver|raw PORT SECONDS`: by the driver, or raw, the least that a driver takes.
"""

import os
import select
import sys
import time
import tty
from typing import Callable

from mrl_driver.driver import Driver
from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME

PERIOD_MS = 20
BOOT_S, SETTLE_S = 0.5, 1.0


def measure(wait: Callable[[float], None], seconds: float) -> None:
    """Print the CPU share of a time that follows the first second."""
    wait(SETTLE_S)
    start_s, used_s = time.monotonic(), time.process_time()
    wait(seconds)
    print(100 * (time.process_time() - used_s) / (time.monotonic() - start_s))


def raw(port: str, seconds: float) -> None:
    fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(fd)
    time.sleep(BOOT_S)
    os.write(fd, encode_request(BY_NAME["start_stream"].code, PERIOD_MS))

    def read(for_s: float) -> None:
        end_s = time.monotonic() + for_s
        while time.monotonic() < end_s:
            if select.select([fd], [], [], 1.0)[0]:
                os.read(fd, 4096)

    measure(read, seconds)


def driver(port: str, seconds: float) -> None:
    with Driver(port):
        measure(time.sleep, seconds)


if __name__ == "__main__":
    (driver if sys.argv[1] == "driver" else raw)(sys.argv[2], float(sys.argv[3]))
