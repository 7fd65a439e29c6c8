"""How many functions one telemetry frame and one command pass through: few enough to count on the fingers."""

import pytest

from mrl_driver.driver import Driver, Options
from tests.call_lists import CallLists, listed
from tests.waiting import wait_until

MOST_CALLS, MOST_VALUES = 20, 3
FRAMES, COMMANDS = 150, 20
READ = "mrl_driver/transport/link.py:read"
DRIVE = "mrl_driver/driver/driver.py:drive"
LASTING = Options(command_timeout_s=None)


def frames_of(board, speed_m_s, frames=FRAMES):
    """The steps of the reading thread while the robot drives at this speed."""
    lists, heard = CallLists(READ).install(), []
    try:
        with Driver(board.path, "traxbot", options=LASTING) as robot:
            robot.on_telemetry(heard.append)
            robot.drive(speed_m_s, 0.0)
            wait_until(lambda: len(heard) > 10)
            lists.steps.clear()
            wait_until(lambda: len(heard) > frames)
    finally:
        lists.remove()
    return lists


@pytest.mark.parametrize("speed_m_s", [0.0, 0.2], ids=["standing", "driving"])
def test_a_steady_frame_takes_few_calls(serve, speed_m_s):
    """From the bytes that are read to the callback, with nothing else due."""
    step = frames_of(serve(), speed_m_s).steady("mrl_driver/robot/odometry.py:update")
    print(listed(step))
    assert len(step.calls) <= MOST_CALLS, listed(step)
    assert len(step.values) <= MOST_VALUES, listed(step)


def test_a_command_takes_few_calls(serve):
    lists = CallLists(DRIVE)
    with Driver(serve().path, "traxbot", options=LASTING) as robot:
        lists.begin()
        for n in range(COMMANDS):
            robot.drive(0.1 + n / 100, 0.1)
            lists.remove()
            robot.wait(0.03)
            lists.begin()
        lists.remove()
    step = lists.steady("mrl_driver/transport/link.py:write")
    print(listed(step))
    assert len(step.calls) <= MOST_CALLS, listed(step)
