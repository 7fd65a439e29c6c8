"""From a finger on the page in Chromium to the motors, in real time: whatever fails, the robot stops in time.

`test_stop_chain` has each link in simulated time.  These tests have what that cannot show: the browser, the socket and
the server are processes of their own.
"""

import pytest

from tests.waiting import is_decided, require_median

from .stop_runs import StopRuns

FURTHER = 3
"""In the first run the page sends so many messages more before the finger is lifted, and nothing moves."""
STOP_S, RUNS = 0.3, 3  # Limit for the median of so many runs at most


@pytest.fixture(scope="module")
def runs(browser, served):
    return StopRuns(browser, served)


@pytest.mark.realtime
@pytest.mark.parametrize(
    "fault",
    ["finger lifted", "tab hidden", "browser stopped", "socket stalled", "server killed", "server stopped"],
)
def test_the_robot_stops_in_time_and_waits_until_the_control_is_released(runs, fault):
    times = []
    while not is_decided(times, STOP_S, RUNS):
        times.append(runs.measure(fault, 0 if times else FURTHER).after_command_s)
    require_median(times, STOP_S, "the stop")
