"""What stops a robot by itself, what is told of it, and when it may go on."""

import subprocess
import sys
import threading
import time

import pytest

from mrl_driver.driver import Driver, Options
from mrl_driver.protocol.table import FAULTS
from mrl_driver.safety.wheel_monitor import DEAD, POWERLESS
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.relay import STOP, STOP_2013
from tests.waiting import PATIENCE_S, drive_until, wait_until


@pytest.fixture
def robot(serve):
    """Drives at 0.2 m/s."""
    port = serve()
    with Driver(port.path, options=Options(command_timeout_s=None)) as driver:
        driver.fake, driver.port_of = port.board, port
        driver.heard = []
        driver.on_event(driver.heard.append)
        drive_until(driver, 0.2, 0.0, lambda: port.board.speeds == (200, 0))
        yield driver


@pytest.mark.parametrize(
    ("dead", "wheel", "cause"),
    [({"left"}, "left", DEAD), ({"right"}, "right", DEAD), ({"left", "right"}, "both", POWERLESS)],
)
def test_a_dead_wheel_stops_the_robot_and_is_named(robot, dead, wheel, cause):
    """`test_wheel_monitor` has the time that it takes."""
    drive_until(robot, 0.2, 0.0, lambda: robot.twist.linear_m_s > 0.15)
    robot.fake.dead = dead
    wait_until(lambda: robot.mismatch or robot.drive(0.2, 0.0) and None, step_s=0.02)
    wait_until(lambda: robot.fake.speeds == (0, 0))
    assert (robot.mismatch.wheel, robot.mismatch.cause) == (wheel, cause)
    assert robot.stop_reason == "wheel_mismatch" and robot.mismatch in robot.heard


# -- the reason of the last stop


def test_a_stop_because_the_machine_was_suspended(robot, monkeypatch):
    """The clock of timers stands still meanwhile; only that of the boot goes on."""
    since_boot_s = time.clock_gettime
    monkeypatch.setattr(time, "clock_gettime", lambda clock: since_boot_s(clock) + 3600.0)
    wait_until(lambda: robot.command is None)
    wait_until(lambda: robot.fake.speeds == (0, 0))
    assert robot.stop_reason == "host_paused"


@pytest.mark.parametrize("version, stop", [(1, STOP_2013), (2, STOP)])
def test_the_stop_of_a_driver_that_fails_is_repeated_until_it_is_seen(serve, monkeypatch, version, stop):
    """A callback raises, the line swallows two stops, and no watchdog helps."""
    monkeypatch.setattr(threading, "excepthook", lambda args: None)
    port = serve(version=version)
    with Driver(port.path, options=Options(watchdog_ms=0, command_timeout_s=None)) as robot:
        drive_until(robot, 0.1, 0.0, lambda: port.board.speeds == (100, 0))
        write, lost = SerialLink.write, []

        def swallow(link, data):
            if stop in data and len(lost) < 2:
                lost.append(data)
                data = data.replace(stop, b"")
            write(link, data)

        monkeypatch.setattr(SerialLink, "write", swallow)
        robot.on_telemetry(lambda _: 1 / 0)
        wait_until(lambda: robot.error is not None)
        assert port.board.speeds == (0, 0) and len(lost) == 2


FORGETFUL = """
import sys, time
from mrl_driver.driver import Driver, Options
robot = Driver(sys.argv[1], options=Options(command_timeout_s=None))
robot.connect()
robot.drive(0.1, 0.0)
time.sleep(0.3)
raise RuntimeError("of the user's own")
"""


def test_the_end_of_a_program_stops_a_robot_that_was_not_closed(serve):
    """A board of 2013 has no watchdog."""
    port = serve(version=1)
    subprocess.run(
        [sys.executable, "-c", FORGETFUL, port.path],
        stderr=subprocess.DEVNULL,
        check=False,
        timeout=PATIENCE_S,
    )
    wait_until(lambda: port.board.speeds == (0, 0))
    assert port.board.moves


def test_a_board_that_refuses_to_move_is_warned_of(serve):
    port = serve()
    port.board.faults = 1 << [name for name, _ in FAULTS].index("wiring")
    with Driver(port.path) as robot:
        assert "its bridge or wiring is not set; set it with: mrl calibrate wiring" in robot.warning
