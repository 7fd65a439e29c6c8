"""Every test runs once and in random order; those of the marker `realtime`, which are few, run alone.

`--tier` chooses tests by the rule of `tiers.py`.  The last lines name the seed, which gives the same order again.
"""

import contextlib
import gc
import os
import pathlib
import signal
import tempfile

import pytest
from hypothesis import HealthCheck, settings

from tests import tiers
from tests.waiting import PATIENCE

EXPLORE = os.environ.get("MRL_TEST_SEED")
"""A seed for inputs that the fixed ones do not have: `make test-all SEED=n`."""
settings.register_profile(
    "any_machine", deadline=None, derandomize=not EXPLORE, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any_machine")
settings.register_profile("quick", max_examples=25)

MOST_REALTIME = 40
PC_BUILD = pathlib.Path("build/pc/libmrl_firmware.so")
WAITING = ("tests/ros/", "tests/web/", "tests/driver/", "tests/cli/")
"""Most of these tests wait for processes, ports and time."""
COMPUTERS = ("gw0", "gw1")  # Workers that take these last
FIRST = (
    "ros/test_catkin",
    "ros/test_run",
    "web/test_page",
    "web/test_stops",
    "ros/",
    "web/",
    "driver/",
    "packaging/",
    "long/measure",
    "firmware/test_build",
    "documents/test_robot_recipe",
    "calibration/",
    "experiments/",
    "conformance/",
    "sim/",
)


@pytest.fixture
def close_later():
    """Closes what it is called with at the end of the test, the last first, and returns it."""
    with contextlib.ExitStack() as stack:
        yield lambda made: stack.enter_context(contextlib.closing(made))


def pytest_addoption(parser):
    """`rest` is what `all` adds to `test`."""
    parser.addoption("--tier", choices=[*tiers.NAMES, "rest"], default="all", help="which tests to run")


def pytest_configure(config):
    """A shell ignores signals for what it starts in the background, and programs inherit that."""
    _leave_home(config)
    gc.disable()  # each look for cycles would go through all of the thousands of tests that are collected
    config.add_cleanup(gc.enable)
    if config.getoption("tier") == "quick":
        settings.load_profile("quick")
    config.addinivalue_line("markers", "realtime: asserts a wall-clock limit; runs alone, after all others")
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False  # files by their number of tests: the longest have few
    usual_of = {signal.SIGINT: signal.default_int_handler}
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual_of.get(number, signal.SIG_DFL))


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


def pytest_ignore_collect(collection_path, config):
    """Files of a higher tier are not imported, as are those that need ROS or a browser where there may be neither."""
    tier = config.getoption("tier")
    if collection_path.suffix != ".py" or tier not in ("quick", "test"):
        return None
    if tier == "test" and collection_path.name == "test_one_drive.py":
        return None
    return tiers.of_folder(collection_path) > tiers.NAMES[tier] or tiers.is_foreign(collection_path) or None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Long files first, so that no worker has one left when the others are done."""
    _keep_tier(config, items)
    realtime = sum(item.get_closest_marker("realtime") is not None for item in items)
    assert realtime <= MOST_REALTIME, (
        f"{realtime} tests are marked realtime, expected at most {MOST_REALTIME}"
    )
    items.sort(
        key=lambda item: next((i for i, name in enumerate(FIRST) if f"/{name}" in item.nodeid), len(FIRST))
    )
    if PATIENCE != 1.0:
        for item in items:
            own = item.get_closest_marker("timeout")
            usual_s = own.args[0] if own else float(config.getini("timeout"))
            item.add_marker(pytest.mark.timeout(usual_s * PATIENCE), append=False)


def _keep_tier(config, items):
    """Leaves the tests of the wanted tier; the quick one has no PC build where there is no g++."""
    name = config.getoption("tier")
    if name == "all":
        return
    least, most = (tiers.ALL, tiers.ALL) if name == "rest" else (tiers.QUICK, tiers.NAMES[name])
    kept = [item for item in items if least <= tiers.of_test(item) <= most]
    if name == "quick" and not PC_BUILD.exists():
        kept = [item for item in kept if not tiers.needs_pc_build(item)]
    config.hook.pytest_deselected(items=list(set(items).difference(kept)))
    items[:] = kept


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """The tests stay to the end, so no later look for cycles goes through them; there are few cycles to look for."""
    gc.freeze()
    gc.set_threshold(50_000)
    gc.enable()


def pytest_terminal_summary(terminalreporter, config):
    line = terminalreporter.write_line
    if "randomly_seed" in config.option:
        line(f"order: --randomly-seed={config.option.randomly_seed}")
    if config.getoption("tier") == "quick" and not PC_BUILD.exists():
        line("left out: tests of the firmware's PC build, which needs g++")
