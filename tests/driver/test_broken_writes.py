"""A write that finds that the port is gone ends the driver, or starts the search, whichever thread writes."""

import threading

import pytest

from mrl_driver.driver import Driver, Options
from mrl_driver.errors import LinkLost
from mrl_driver.protocol.table import BY_NAME
from tests.waiting import drive_until, wait_until

STOP = BY_NAME["stop"].code


@pytest.fixture
def robot(line):
    """A driver whose command lasts, with its events."""
    with Driver(line, options=Options(command_timeout_s=None)) as driver:
        driver.events = []
        driver.on_event(driver.events.append)
        yield driver


def drive_in_vain(robot, line, monkeypatch):
    """Drive while this thread's writes fail and those of the reading thread succeed, as after an ICMP error."""
    write, user = line.write, threading.current_thread()

    def broken(data):
        if threading.current_thread() is user:
            raise LinkLost("the port went away")
        write(data)

    with monkeypatch.context() as patch:
        patch.setattr(line, "write", broken)
        with pytest.raises(LinkLost, match="went away"):
            while True:
                robot.drive(0.2, 0.0)


def test_a_command_that_cannot_be_written_does_not_drive_the_robot_later(robot, line, monkeypatch):
    wait_until(lambda: robot.stopped)
    before = len(line.board.heard)
    drive_in_vain(robot, line, monkeypatch)
    wait_until(lambda: any(frame.code == STOP for frame in line.board.heard[before:]))
    robot.close()
    assert line.board.moves == [] and line.board.speeds == (0, 0)


def test_a_write_that_fails_is_told_to_the_callbacks(robot, line, monkeypatch):
    drive_in_vain(robot, line, monkeypatch)
    wait_until(lambda: robot.events)
    assert robot.events == [robot.error] and isinstance(robot.error, LinkLost)


def test_a_close_after_a_write_that_failed_stops_the_robot(robot, line, monkeypatch):
    drive_until(robot, 0.1, 0.0, lambda: line.board.speeds == (100, 0))
    drive_in_vain(robot, line, monkeypatch)
    robot.close()
    assert line.board.speeds == (0, 0)
