"""`make bench-web`: stop times of the page, CPU of `mrl web` beside `mrl monitor`, bytes of the first load.

Writes build/bench/web.json.  Chromium is real; the robot is emulated in this process.  FAST=1 measures less.
"""

import os
import signal
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Callable, Dict

from tests.cli.terminal import Terminal
from tests.driver.emulator import Emulator
from tests.web.browser import DESK, Browser
from tests.web.robot_page import RobotPage
from tests.web.served import Served
from tests.web.stop_runs import StopRuns

from . import processes, report

RUNS = report.either(20, 1)
CPU_S, CPU_RUNS, SETTLE_S = report.either((20.0, 3, 2.0), (1.0, 1, 0.3))
ROWS, COLUMNS = 40, 120  # Size of the terminal in which the control draws


def local(folder: Path) -> Served:
    """`mrl web` for this computer alone."""
    return Served(folder, "--listen", "127.0.0.1:0")


def cpu_percent(pid: int) -> float:
    """Share of a core that a process takes while nothing drives."""
    time.sleep(SETTLE_S)
    begun_s, used_s = time.monotonic(), processes.cpu_s(pid)
    time.sleep(CPU_S)
    return 100.0 * (processes.cpu_s(pid) - used_s) / (time.monotonic() - begun_s)


def monitor_cpu() -> float:
    """The control: the full-screen view of `mrl monitor` [%]."""
    robot = Emulator()
    os.environ.update(LINES=str(ROWS), COLUMNS=str(COLUMNS))
    terminal = Terminal("monitor", "--port", robot.path)
    try:
        terminal.wait_for("(?i)sonar")
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
    served = local(folder)
    try:
        page = RobotPage(browser, served.links[0], DESK)
        page.arrive()
        page.tab.close()
        return served.proxy.received
    finally:
        served.close()


def real_stops(browser: Browser, folder: Path) -> Dict[str, report.Measured]:
    """Times from the last fresh command to the motors' stop in real time, all links working [ms]."""
    served = local(folder)
    found: Dict[str, report.Measured] = {}
    try:
        runs = StopRuns(browser, served)
        for fault in runs.faults:
            times = report.repeat(fault, RUNS, partial(runs.measure, fault))
            ms = [1000.0 * each.after_command_s for each in times]
            key = fault.replace(" ", "_")
            found.update({f"{key}_stop_ms_median": ms, f"{key}_stop_ms_worst": max(ms)})
    finally:
        served.close()
    return found


def cpu_figures(browser: Browser, folder: Path) -> Dict[str, report.Measured]:
    """CPU shares of runs that take turns [%]."""
    measures: Dict[str, Callable[[], float]] = {
        "monitor_cpu_percent": monitor_cpu,
        "web_cpu_percent": lambda: web_cpu(browser, folder, 0),
        "web_two_viewers_cpu_percent": lambda: web_cpu(browser, folder, 2),
    }
    return report.by_key(
        report.repeat("CPU", CPU_RUNS, lambda: {name: measure() for name, measure in measures.items()})
    )


def figures() -> Dict[str, report.Measured]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        browser = Browser(folder)
        try:
            found: Dict[str, report.Measured] = {"first_load_bytes": first_load(browser, folder)}
            found.update(cpu_figures(browser, folder))
            found.update(real_stops(browser, folder))
        finally:
            browser.close()
    return found
