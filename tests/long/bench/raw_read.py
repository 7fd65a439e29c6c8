"""Reads a board's stream of 50 frames a second raw for some seconds, and prints the CPU share it took [%]: the least
that any driver takes.
"""

import os
import select
import sys
import time
import tty

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME
from tests.long.bench.driver_alone import cpu_s

PERIOD_MS = 20
BOOT_S, SETTLE_S = 0.5, 1.0


def read_until(poll: "select.poll", fd: int, end_s: float) -> None:
    while time.monotonic() < end_s:
        if poll.poll(1000):
            os.read(fd, 4096)


def main() -> None:
    fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
    tty.setraw(fd)
    poll = select.poll()
    poll.register(fd, select.POLLIN)
    time.sleep(BOOT_S)
    os.write(fd, encode_request(BY_NAME["start_stream"].code, PERIOD_MS))
    read_until(poll, fd, time.monotonic() + SETTLE_S)
    start_s, used_s = time.monotonic(), cpu_s()
    read_until(poll, fd, start_s + float(sys.argv[2]))
    print(100 * (cpu_s() - used_s) / (time.monotonic() - start_s))
    os.close(fd)


if __name__ == "__main__":
    main()
