"""What of a driver's events goes to the log, and what boards without a clock report."""

import time

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.imu import IN_USE, SILENT
from mrl_driver.robot.odometry import Twist, Wheels
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import ImuChanged, Lost, PathUnknown, Ready, Reconnected, Reply, Stale
from mrl_driver.session.handshake import Board
from mrl_driver.session.link_counters import Counters
from ros1_bridge.status.link_report import ERROR, OK, WARN, News, values

BOARD = Board(1, 2, 1.72, 12.0, 25.0)
LOST, BACK = Lost("/dev/ttyACM0", "it went away"), Reconnected("/dev/ttyACM1")
AGAIN, RESTARTED, UNKNOWN = (Ready(BOARD, *how) for how in ((False, True), (True, True), (True, False)))


def telemetry(sequence):
    now_s = time.monotonic()
    pose, twist = Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0)
    return Telemetry(now_s - 0.001, now_s, pose, twist, {}, (), Wheels(0, 0), sequence)


@pytest.mark.parametrize(
    "events, levels",
    [
        ((Stale(0.3), AGAIN), [ERROR, OK]),
        ((RESTARTED,), [WARN]),
        ((Stale(0.3), UNKNOWN), [ERROR, OK]),
        ((LOST, RESTARTED, BACK), [ERROR, None, OK]),
        ((LOST, BACK, RESTARTED), [ERROR, OK, WARN]),
        ((PathUnknown(3.0, 0.9, 1.0),), [WARN]),
        ((Reply(()),), [None]),
        ((ImuChanged(False, SILENT, "lost"), ImuChanged(True, IN_USE, "back")), [WARN, OK]),
    ],
)
def test_events_are_told_once(events, levels):
    news = News()
    assert [told and told.level for told in map(news.of, events)] == levels


@pytest.mark.parametrize("sequence, latency", [(7, "1.00 ms"), (None, "not measured")])
def test_latency_is_that_of_the_boards_clock(sequence, latency):
    told = values("port", 115200, BOARD, Counters().snapshot(), 0.0, telemetry(sequence))
    assert told["Computed Latency"] == latency


def test_changes_of_a_hold_are_logged_once():
    """Not the state at the start if nobody holds the robot, nor its counters."""
    news, free = News(), Hold("free", 0, 0, 0, 0)
    held, silent = free._replace(state="held", holders=1), free._replace(state="silent", holders=1)
    told = [news.of(each) for each in (free, held, held._replace(ignored=1), silent, free)]
    assert [each and each.level for each in told] == [None, WARN, None, ERROR, OK]
