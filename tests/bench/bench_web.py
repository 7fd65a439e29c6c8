"""`make bench-web`: stop times of the page, CPU of `mrl web` beside `mrl monitor`, bytes of the first load.

Writes build/bench/web.json.  Chromium is real; the robot is emulated in this process.  FAST=1 measures less.
"""

import os
import signal
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from statistics import median
from typing import Callable, Dict, List

from tests.cli.terminal import Terminal
from tests.driver.emulator import Emulator
from tests.waiting import wait_until
from tests.web.browser import DESK, Browser
from tests.web.robot_page import RobotPage
from tests.web.served import Served
from tests.web.stop_chain import figures
from tests.web.stop_runs import StopRuns

from . import report

FAST = os.environ.get("FAST") == "1"
RUNS = 3 if FAST else 20
CPU_S, CPU_RUNS = (3.0, 1) if FAST else (20.0, 3)
SETTLE_S = 2.0
ROWS, COLUMNS = 40, 120
"""Size of the terminal in which the control draws."""


def local(folder: Path) -> Served:
    """`mrl web` for this computer alone."""
    return Served(folder, "--listen", "127.0.0.1:0")


def cpu_percent(pid: int) -> float:
    """Share of a core that a process takes while nothing drives."""
    time.sleep(SETTLE_S)
    begun_s, used_s = time.monotonic(), _cpu_s(pid)
    time.sleep(CPU_S)
    return 100.0 * (_cpu_s(pid) - used_s) / (time.monotonic() - begun_s)


def _cpu_s(pid: int) -> float:
    user, system = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def monitor_cpu() -> float:
    """The control: the full-screen view of `mrl monitor` [%]."""
    robot = Emulator()
    os.environ.update(LINES=str(ROWS), COLUMNS=str(COLUMNS))
    terminal = Terminal("monitor", "--port", robot.path)
    try:
        wait_until(lambda: b"sonar" in terminal.seen.lower())
        return cpu_percent(terminal.pid)
    finally:
        terminal.end(signal.SIGTERM)
        robot.close()


def web_cpu(browser: Browser, folder: Path, viewers: int) -> float:
    """`mrl web` with so many pages that watch [%]."""
    served = local(folder)
    pages = [RobotPage(browser, served.links[0], DESK) for _ in range(viewers)]
    try:
        for page in pages:
            page.arrive()
        return cpu_percent(served.process.pid)
    finally:
        for page in pages:
            page.tab.close()
        served.close()


def first_load(browser: Browser, folder: Path) -> int:
    """Bytes to the browser until the page is connected."""
    served = local(folder)
    try:
        page = RobotPage(browser, served.links[0], DESK)
        page.arrive()
        page.tab.close()
        return served.proxy.received
    finally:
        served.close()


def real_stops(browser: Browser, folder: Path) -> Dict[str, float]:
    """Times from the last fresh command to the motors' stop in real time, all links working [ms]."""
    served = local(folder)
    found: Dict[str, float] = {}
    try:
        runs = StopRuns(browser, served)
        for fault in runs.faults:
            times = report.repeat(fault, RUNS, partial(runs.measure, fault))
            found.update(_figures(fault.replace(" ", "_"), [each.after_command_s for each in times]))
    finally:
        served.close()
    return found


def simulated_stops() -> Dict[str, float]:
    """The same in simulated time: with all links, then with each that notices the fault alone [ms].

    With none the robot drives on, which has no time.
    """
    found: Dict[str, float] = {}
    for name, times in figures(runs=RUNS).items():
        if not name.endswith(": none"):
            fault, _, links = name.partition(": ")
            found.update(_figures(f"simulated_{fault} by {links}".replace(" ", "_"), times))
    return found


def _figures(name: str, times_s: List[float]) -> Dict[str, float]:
    return {
        f"{name}_stop_ms_median": round(1000.0 * median(times_s), 1),
        f"{name}_stop_ms_worst": round(1000.0 * max(times_s), 1),
    }


def cpu_figures(browser: Browser, folder: Path) -> Dict[str, float]:
    """CPU shares, each the median of runs that take turns [%]."""
    measures: Dict[str, Callable[[], float]] = {
        "monitor_cpu_percent": monitor_cpu,
        "web_cpu_percent": lambda: web_cpu(browser, folder, 0),
        "web_two_viewers_cpu_percent": lambda: web_cpu(browser, folder, 2),
    }
    found: Dict[str, List[float]] = {name: [] for name in measures}
    for number in range(CPU_RUNS):
        for name, measure in measures.items():
            print(f"{name}: run {number + 1} of {CPU_RUNS}", file=sys.stderr, flush=True)
            found[name].append(measure())
    shares = {name: round(median(every), 2) for name, every in found.items()}
    more = shares["web_two_viewers_cpu_percent"] - shares["monitor_cpu_percent"]
    return {**shares, "web_over_monitor_cpu_percent": round(more, 2)}


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        browser = Browser(folder)
        try:
            found: Dict[str, float] = {"first_load_bytes": first_load(browser, folder), "runs": RUNS}
            found.update(cpu_figures(browser, folder))
            found.update(real_stops(browser, folder))
        finally:
            browser.close()
    found.update(simulated_stops())
    for key, value in found.items():
        print(f"{key:56}{value:10,.1f}")
    print(report.write("web", found))


if __name__ == "__main__":
    main()
