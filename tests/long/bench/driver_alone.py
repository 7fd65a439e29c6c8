"""Runs the driver without ROS on a port for some seconds, and prints the CPU share it took after connecting [%]."""

import resource
import sys
import time

from mrl_driver.driver import Driver


def cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    with Driver(sys.argv[1]):
        time.sleep(1)
        start_s, used_s = time.monotonic(), cpu_s()
        time.sleep(float(sys.argv[2]))
        print(100 * (cpu_s() - used_s) / (time.monotonic() - start_s))


if __name__ == "__main__":
    main()
