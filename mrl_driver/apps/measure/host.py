"""What is measured with the driver: this computer, telemetry, the stop, and the cable that is pulled."""

import math
import operator
import os
import time
from statistics import median
from typing import Callable, Iterator, List, Optional

from mrl_driver.cli.doctor import board
from mrl_driver.cli.doctor.findings import FAULT, WARNING, Finding
from mrl_driver.driver import Driver
from mrl_driver.protocol.stop_reason import PASSING
from mrl_driver.session.events import Lost, Reconnected
from mrl_driver.view.words import fault_code, stop_error

from .line import percentile
from .rows import Row, absent, failed

WAITS, WAIT_S = 250, 0.02
DRIVE_S, DRIVE_M_S, STOPS = 0.6, 0.1, 5
MOST_STOP_S, MOST_PULL_S = 3.0, 60.0
Ask = Callable[[str], Callable[[], bool]]
"""Asks the user to do something; returns what reports whether the user has refused."""


def rows(driver: Driver, moves: bool) -> Iterator[Row]:
    """Measure all rows of this computer; the robot drives only with `moves`."""
    yield from waits(driver)
    seen = board.watch(driver)
    unknown = None if seen.expected_hz else math.inf  # a board of 2013 does not say what it sends
    yield Row("telemetry_hz", seen.rate_hz, seen.expected_hz or 0.0, allowed=unknown)
    trips_ms = [1000 * each for each in seen.round_trips_s]
    yield Row("driver_delay_ms", median(trips_ms), number=len(trips_ms), p99=percentile(trips_ms, 0.99))
    yield stops(driver, moves)


def findings(driver: Driver) -> List[Finding]:
    """Return the faults and warnings of `mrl doctor` about the board, its supply and its health."""
    of_robot = [*board.supply(driver.board, driver.model)]
    of_robot += board.health(driver.status, driver.parameters.wiring_problem())
    checks = [*board.identity(driver.board, driver.model), *board.of_robot(driver, iter(of_robot))]
    return [each for each in checks if each.level in (FAULT, WARNING)]


def waits(driver: Driver) -> Iterator[Row]:
    """How late waits end, and the processor time of the driver meanwhile."""
    late_ms: List[float] = []
    start_s, used_s = driver.now_s, time.process_time()
    for _ in range(WAITS):
        due_s = driver.now_s + WAIT_S
        driver.wait(WAIT_S)
        late_ms.append(1000 * (driver.now_s - due_s))
    used_s, took_s = time.process_time() - used_s, driver.now_s - start_s
    yield Row("host_late_ms", percentile(late_ms, 0.99), number=WAITS)
    yield Row("driver_cpu_percent", 100 * used_s / took_s)


def stops(driver: Driver, moves: bool) -> Row:
    """Time from a stop to the telemetry that confirms it."""
    if driver.model is None or not driver.model.drives:
        return absent("stop_confirmed_ms", "the board has no motors")
    times_ms: List[float] = []
    for number in range(STOPS):
        before = driver.telemetry
        for _ in range(round(DRIVE_S / WAIT_S) if moves else 0):
            driver.drive(-DRIVE_M_S if number % 2 else DRIVE_M_S, 0.0)
            driver.wait(WAIT_S)
            if driver.command is None and driver.stop_reason not in PASSING:
                error = stop_error(driver, "stopped early")
                code = error.code if driver.mismatch is None else fault_code(driver.mismatch)
                return failed("stop_confirmed_ms", str(error), code)
        after = driver.telemetry
        if moves and before and after and any(map(operator.eq, before.counts[:2], after.counts[:2])):
            return failed("stop_confirmed_ms", "a wheel did not turn", "wheel_dead")
        start_s = driver.now_s
        driver.stop()
        while not driver.stopped and driver.now_s - start_s < MOST_STOP_S:
            driver.wait(0.005)
        times_ms.append(1000 * (driver.now_s - start_s))
    return Row("stop_confirmed_ms", median(times_ms), number=STOPS, note="" if moves else "while it stands")


def unplugged(driver: Driver, port: str, ask: Optional[Ask]) -> Iterator[Row]:
    """Ask the user to pull the cable and to plug it in again; `driver` searches its port.  None: nobody can do it.

    Each takes at most `MOST_PULL_S`.
    """
    if ask is None:
        yield from (absent(key, "nobody was there to pull the cable") for key in ("lost_ms", "return_s"))
        return
    seen: List[object] = []
    ages_s: List[float] = []

    def note(event: object) -> None:
        if isinstance(event, (Lost, Reconnected)):
            seen.append(event)
            ages_s.append(driver.link.age_s)

    driver.on_event(note)
    refused = ask("Pull the cable out of the board now; press Enter to leave this out.")
    _until(driver, lambda: bool(seen) or refused())
    if not seen:
        yield from (absent(key, "the cable was not pulled") for key in ("lost_ms", "return_s"))
        return
    yield Row("lost_ms", 1000 * ages_s[0])
    ask("Plug it in again.")
    plugged = _until(driver, lambda: driver.ready or os.path.exists(port))
    start_s = driver.now_s
    back = plugged and _until(driver, lambda: driver.ready)
    yield Row("return_s", driver.now_s - start_s) if back else absent("return_s", "the board did not return")


def _until(driver: Driver, done: Callable[[], bool]) -> bool:
    end_s = driver.now_s + MOST_PULL_S
    while not done() and driver.now_s < end_s:
        driver.wait(0.01)
    return done()
