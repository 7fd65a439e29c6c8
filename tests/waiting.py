"""The one way in which tests wait: for an event, with a generous time-out.

MRL_TEST_PATIENCE multiplies every time-out of the tests, that of pytest too: 3 on a machine that is kept busy.
"""

import os
import time
from statistics import median
from typing import Any, Callable, Sequence, TypeVar

PATIENCE = float(os.environ.get("MRL_TEST_PATIENCE", "1"))
PATIENCE_S = 30.0 * PATIENCE  # Time-out for what takes far less on an idle machine [s]

Result = TypeVar("Result")


def wait_until(
    condition: Callable[[], Result], timeout_s: float = 30.0, step_s: float = 0.002, what: str = "it"
) -> Result:
    """Calls `condition` every `step_s` until it returns something true, and returns that.

    Raises:
        AssertionError: nothing true within `timeout_s` times MRL_TEST_PATIENCE.
    """
    limit_s = timeout_s * PATIENCE
    deadline_s = time.monotonic() + limit_s
    while True:
        result = condition()
        if result:
            return result
        assert time.monotonic() < deadline_s, f"{what} did not happen within {limit_s:g} s"
        time.sleep(step_s)


def drive_until(robot: Any, linear_m_s: float, angular_rad_s: float, condition: Callable[[], Any]) -> None:
    """Gives the command again and again until `condition` returns something true.

    A driver drops its command when the host was held up, and expects a new one.

    Raises:
        AssertionError: nothing true within the time of `wait_until`.
    """
    wait_until(lambda: robot.drive(linear_m_s, angular_rad_s) and condition(), step_s=0.02)


def is_decided(took_s: Sequence[float], at_most_s: float, runs: int) -> bool:
    """Whether the median of an odd number of runs is on one side of a limit, however long those to come take."""
    within = sum(each <= at_most_s for each in took_s)
    return max(within, len(took_s) - within) > runs // 2


def require_median(took_s: Sequence[float], at_most_s: float, what: str = "it") -> None:
    """Asserts a wall-clock limit on the median of several runs; the first line of a failure has figure and limit.

    Raises:
        AssertionError: the median is above the limit, or there is none.
    """
    assert took_s, f"{what} was not measured"
    figure_s = median(took_s)
    runs = ", ".join(f"{each:.3f}" for each in sorted(took_s))
    assert figure_s <= at_most_s, (
        f"{what} took {figure_s:.3f} s, expected at most {at_most_s:g} s (runs: {runs})"
    )
