"""From a finger on the page in Chromium to the motors, in real time: whatever fails, the robot stops in time.

`test_stop_chain` has each link in simulated time.  These tests have what that cannot show: the browser, the socket and
the server are processes of their own.
"""

import pytest

from tests.waiting import require_median

from .stop_runs import StopRuns

FURTHER = (0, 0, 3)
"""Three runs; in the last, the page sends so many messages more before the finger is lifted, and nothing moves."""
STOP_S = 0.3


@pytest.fixture(scope="module")
def runs(browser, served):
    return StopRuns(browser, served)


@pytest.mark.realtime
@pytest.mark.parametrize(
    "fault",
    ["finger lifted", "tab hidden", "browser stopped", "socket stalled", "server killed", "server stopped"],
)
def test_the_robot_stops_in_time_and_waits_until_the_control_is_released(runs, fault):
    times = [runs.measure(fault, further).after_command_s for further in FURTHER]
    require_median(times, STOP_S, "the stop")
