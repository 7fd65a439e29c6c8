"""A failure that the machine made is told from a defect: a test that was possibly held up gets another try.

Much here runs in real time: drivers, boards and ROS nodes with time-outs of tenths of a second.  A busy machine may
hold any process up for longer, and then a robot rightly stops that a test wanted to see moving.  A defect fails every
try; each has fixtures of its own, those of the module too.  `pytest --once` shows what needs another try.
"""

import contextlib
import signal
import time

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import HealthCheck, settings

settings.register_profile(
    "any_machine", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any_machine")

TRIES = 4
HELD_UP_S = 0.1
"""The shortest delay that any process here takes amiss; a test that fails sooner was not held up."""
TRIES_END_S = 70.0
"""No further try so long after the first began; the time-out of pytest holds for all of them together."""
FIRST = (
    "ros/test_catkin",
    "experiments/test_exp",
    "ros/test_run",
    "ros/",
    "driver/test_emulator",
    "driver/",
    "sim/",
)
LOST_CASES = 3
"""So many tests of one worker that fail every try are no accident: the rest get one try."""

_lost = []


def pytest_configure(config):
    """A shell ignores signals for what it starts in the background, and programs inherit that."""
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False  # files by their number of tests: the longest have few
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


def pytest_collection_modifyitems(items):
    """Long files first, so that no worker has one left when the others are done."""
    items.sort(
        key=lambda item: next((i for i, name in enumerate(FIRST) if f"/{name}" in item.nodeid), len(FIRST))
    )


def pytest_addoption(parser):
    parser.addoption("--once", action="store_true", help="no second try for a test that fails")


def _outcome(item, nextitem):
    """The reports of one try, and why it failed; None where it did not."""
    reports = runtestprotocol(item, nextitem=nextitem, log=False)
    failed = next((report for report in reports if report.failed), None)
    return reports, failed and f"{failed.when}: {failed.longreprtext.strip().splitlines()[-1]}"


def _tries(item, nextitem):
    begun_s, reasons = time.monotonic(), []
    for _ in range(TRIES):
        try_s = time.monotonic()
        reports, reason = _outcome(item, nextitem)
        if reason is None:
            break
        reasons.append(reason)
        now = time.monotonic()
        if now - try_s < HELD_UP_S or now - begun_s > TRIES_END_S:
            break
        with contextlib.suppress(Exception):
            item.session._setupstate.teardown_exact(item.getparent(pytest.Module).parent)
    return reports, reasons, reason is None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    if item.config.getoption("once") or len(_lost) >= LOST_CASES:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports, reasons, passed = _tries(item, nextitem)
    if len(reasons) > 1 and not passed:
        _lost.append(item.nodeid)
    for report in reports:
        if passed and reasons and report.when == "call":
            report.user_properties.append(("failed_before", "; ".join(reasons)))
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_terminal_summary(terminalreporter):
    """Names what passed only at a later try."""
    for report in terminalreporter.getreports("passed"):
        for reasons in (text for name, text in report.user_properties if name == "failed_before"):
            terminalreporter.line(f"another try passed: {report.nodeid}: {reasons}")
