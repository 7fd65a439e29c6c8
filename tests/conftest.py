"""Every test runs once and in random order; those of the marker `realtime` run alone, and few may have a second try.

The last lines name the seed, which gives the same order again, and count what the markers allow.
"""

import gc
import os
import signal
import tempfile

import pytest
from hypothesis import HealthCheck, settings

from tests.waiting import PATIENCE

settings.register_profile(
    "any_machine", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any_machine")

REALTIME, REALTIME_S = 40, 60.0
"""The most tests that may assert a wall-clock limit, and how long they may take together [s]."""
FLAKY, RERUNS = 10, 2
"""The most tests that may have a second try, and the most second tries of one run."""
REFUSED = pytest.StashKey[str]()
WAITING = ("tests/ros/", "tests/web/", "tests/driver/", "tests/cli/")
"""Most of these tests wait for processes, ports and time."""
COMPUTERS = ("gw0", "gw1")
"""Workers that take these last."""
FIRST = (
    "ros/test_catkin",
    "ros/test_run",
    "web/test_page",
    "web/test_stops",
    "ros/",
    "web/",
    "driver/test_emulator",
    "driver/test_greeting",
    "driver/",
    "packaging/",
    "calibration/test_own_robot",
    "experiments/test_experiments",
    "conformance/test_motion",
    "conformance/test_bridge",
    "firmware/test_build",
    "firmware/test_fuzz",
    "documents/test_sensor",
    "test_rules",
    "review/test_findings",
    "calibration/",
    "experiments/",
    "sim/",
)


def pytest_configure(config):
    """A shell ignores signals for what it starts in the background, and programs inherit that."""
    _leave_home(config)
    gc.disable()  # each look for cycles would go through all of the thousands of tests that are collected
    config.add_cleanup(gc.enable)
    config.addinivalue_line("markers", "realtime: asserts a wall-clock limit; runs alone, after all others")
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False  # files by their number of tests: the longest have few
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


def _leave_home(config):
    """Gives tests, and what they start, a home of their own before any is imported; caches stay where they are."""
    os.environ.setdefault("XDG_CACHE_HOME", os.path.expanduser("~/.cache"))
    home = tempfile.TemporaryDirectory(prefix="mrl-home-")
    config.add_cleanup(home.cleanup)
    os.environ.update(HOME=home.name, XDG_CONFIG_HOME=os.path.join(home.name, ".config"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Two workers take the files that compute first, so that a core has work while the others' tests wait."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class TwoKinds(LoadFileScheduling):
        def _assign_work_unit(self, node):
            computes = node.gateway.id in COMPUTERS
            wanted = (file for file in self.workqueue if file.startswith(WAITING) != computes)
            self.workqueue.move_to_end(next(wanted, next(iter(self.workqueue))), last=False)
            super()._assign_work_unit(node)

    return TwoKinds(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Long files first, so that no worker has one left when the others are done."""
    _check_markers(items)
    items.sort(
        key=lambda item: next((i for i, name in enumerate(FIRST) if f"/{name}" in item.nodeid), len(FIRST))
    )
    if PATIENCE != 1.0:
        for item in items:
            own = item.get_closest_marker("timeout")
            usual_s = own.args[0] if own else float(config.getini("timeout"))
            item.add_marker(pytest.mark.timeout(usual_s * PATIENCE), append=False)


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """The tests stay to the end, so no later look for cycles goes through them."""
    gc.freeze()
    gc.enable()


def _check_markers(items):
    """Tests that must not be marked as they are fail; workers of xdist cannot end the run."""
    for name, most in (("realtime", REALTIME), ("flaky", FLAKY)):
        marked = [item for item in items if item.get_closest_marker(name)]
        if len(marked) > most:
            for item in marked:
                item.stash[REFUSED] = f"{len(marked)} tests are marked {name}, expected at most {most}"
    for item in items:
        flaky = item.get_closest_marker("flaky")
        if flaky and not (flaky.kwargs.get("reason") and flaky.kwargs.get("reruns") == 1):
            item.stash[REFUSED] = f'{flaky}: expected flaky(reruns=1, reason="...")'


def pytest_runtest_setup(item):
    """Refuses a test for its markers."""
    if REFUSED in item.stash:
        pytest.fail(item.stash[REFUSED], pytrace=False)


def _reports(config, name=""):
    """Reports of all phases of the tests with this marker."""
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    noted = sum(terminal.stats.values(), []) if terminal else []  # those that were left out, too
    return [each for each in noted if isinstance(each, pytest.TestReport) and name in each.keywords]


def _reruns(config):
    return sum(report.outcome == "rerun" for report in _reports(config, "flaky"))


def _realtime_s(config):
    return sum(report.duration for report in _reports(config, "realtime"))


def pytest_sessionfinish(session, exitstatus):
    """Too many second tries, or too long in real time, fail the run."""
    over = _reruns(session.config) > RERUNS or _realtime_s(session.config) > REALTIME_S * PATIENCE
    if over and exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    """The seed, and what the markers have used."""
    line = terminalreporter.write_line
    if "randomly_seed" in config.option:
        line(f"order: --randomly-seed={config.option.randomly_seed}")
    realtime = {report.nodeid for report in _reports(config, "realtime")}
    if realtime:
        line(f"realtime: {len(realtime)} tests, {_realtime_s(config):.1f} s of at most {REALTIME_S:g} s")
    flaky = {report.nodeid for report in _reports(config, "flaky")}
    line(f"second tries: {_reruns(config)} of at most {RERUNS}, for {len(flaky)} tests that may have one")
