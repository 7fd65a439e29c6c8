"""The one way in which tests wait: for an event, with a generous time-out.

MRL_TEST_PATIENCE multiplies every time-out of the tests, that of pytest too: 3 on a machine that is kept busy.
"""

import os
import time
from typing import Callable, TypeVar

PATIENCE = float(os.environ.get("MRL_TEST_PATIENCE", "1"))
PATIENCE_S = 30.0 * PATIENCE
"""Time-out for what takes far less on an idle machine [s]."""

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
