"""What stops a robot by itself, what is told of it, and when it may go on."""

import math
import os
import subprocess
import sys
import threading
import time

import pytest

from mrl_driver.driver import Driver, Options
from mrl_driver.errors import FrameError
from mrl_driver.protocol.table import FAULTS, STOP_REASONS
from mrl_driver.safety.wheel_monitor import DEAD, POWERLESS, Mismatch
from mrl_driver.session import session
from mrl_driver.session.motion_command import STOPS
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


def mismatches(robot):
    return [event for event in robot.heard if isinstance(event, Mismatch)]


@pytest.mark.parametrize(
    ("dead", "wheel", "cause"),
    [({"left"}, "left", DEAD), ({"right"}, "right", DEAD), ({"left", "right"}, "both", POWERLESS)],
)
def test_a_dead_wheel_stops_the_robot_and_is_named(robot, dead, wheel, cause):
    """`test_wheel_monitor` has the time that it takes."""
    drive_until(robot, 0.2, 0.0, lambda: robot.twist.linear_m_s > 0.15)
    robot.fake.dead = dead
    wait_until(lambda: mismatches(robot) or robot.drive(0.2, 0.0) and None, step_s=0.02)
    wait_until(lambda: robot.fake.speeds == (0, 0))
    assert (mismatches(robot)[0].wheel, mismatches(robot)[0].cause) == (wheel, cause)
    assert robot.stop_reason == "wheel_mismatch" and robot.mismatch == mismatches(robot)[0]


def until_mismatch(robot, *dead):
    robot.fake.dead = set(dead)
    wait_until(lambda: robot.mismatch or robot.drive(0.2, 0.0) and None, step_s=0.02)


@pytest.mark.parametrize("stop", [Driver.stop, lambda robot: robot.drive(0.0, 0.0)], ids=["stop", "zero"])
def test_after_a_mismatch_a_stop_must_come_before_the_next_command(robot, stop):
    """A planner that goes on sending must not drag a blocked wheel along in jerks."""
    until_mismatch(robot, "left")
    assert not robot.drive(0.2, 0.0)
    assert robot.fake.moves[-1] == (200, 0) and robot.command is None
    robot.fake.dead = set()
    stop(robot)
    assert robot.mismatch is None
    drive_until(robot, 0.1, 0.0, lambda: robot.fake.speeds == (100, 0))




# -- the reason of the last stop


def test_reasons_of_stops_of_the_program(serve):
    assert set(STOPS) & set(STOP_REASONS) == {"none"}
    with Driver(serve().path, options=Options(command_timeout_s=0.1)) as robot:
        assert robot.stop_reason == "none"
        robot.stop()
        assert robot.stop_reason == "user"
        with pytest.raises(FrameError):
            robot.drive(math.nan, 0.0)
        assert robot.stop_reason == "not_a_number"
        robot.drive(0.1, 0.0)
        wait_until(lambda: robot.command is None)
        assert robot.stop_reason == "command_timeout"


def test_a_stop_because_motor_power_went_off(robot):
    def stopped_by_it():
        """A held-up host drops its command, which is new then."""
        robot.fake.battery = 20 if robot.drive(0.2, 0.0) else 1200
        return robot.stop_reason == "battery"

    wait_until(stopped_by_it)
    assert robot.command is None


def test_a_stop_because_telemetry_stays_away(prompt, robot, monkeypatch):
    for limit in ("PAUSE_S", "LATE_HOST_S"):  # a held-up host is another reason
        monkeypatch.setattr(session, limit, PATIENCE_S)
    robot.fake.mute = True
    wait_until(lambda: robot.command is None)
    assert robot.stop_reason == "stale"


def test_a_stop_because_the_port_went_away(serve, tmp_path):
    port = serve()
    os.symlink(port.path, tmp_path / "robot")
    with Driver(str(tmp_path / "robot"), options=Options(reconnect=True, command_timeout_s=None)) as robot:
        robot.drive(0.1, 0.0)
        os.remove(tmp_path / "robot")
        port.unplug()
        wait_until(lambda: not robot.ready)
        assert robot.stop_reason == "link_lost"


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


@pytest.mark.parametrize("reason", ["motor_board", "wheel_blocked", "encoder", "undervoltage"])
def test_a_stop_by_the_board_is_told_with_its_status(robot, reason):
    robot.fake.stop_reason = STOP_REASONS.index(reason)
    wait_until(lambda: robot.stop_reason == reason)


def test_a_board_that_refuses_to_move_is_warned_of(serve):
    port = serve()
    port.board.faults = 1 << [name for name, _ in FAULTS].index("wiring")
    with Driver(port.path) as robot:
        assert "its bridge or wiring is not set; set it with: mrl calibrate wiring" in robot.warning
