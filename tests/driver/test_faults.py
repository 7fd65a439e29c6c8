"""Faults with the figure that must hold, on the emulated robot in real time, and what stops a robot by itself."""

import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

import mrl_driver
from mrl_driver.driver import Driver, Options
from mrl_driver.protocol.table import BY_NAME, FAULTS
from mrl_driver.session.events import Stale
from mrl_driver.transport import relay
from mrl_driver.transport.link import SerialLink
from tests.waiting import PATIENCE_S, drive_until, is_decided, require_median, wait_until

from .emulator import DRIVE, MOVE, STOP, Emulator

RUNS = 5
"""A wall-clock limit holds for the median of at most so many runs; `test_fault_figures` has them in simulated time."""
HOST_DEAD_S, TIMEOUT_S, BEYOND_TIMEOUT_S = 0.3, 0.25, 0.05
SILENT_S = 0.3
SIGNAL_STOP_S, SIGNAL_EXIT_S = 0.1, 2.0
ON_CLOCKS_S = 0.01  # The emulated board's time may differ by so much from that of the host


@pytest.fixture
def emulate(close_later):
    """Starts an emulator in this process."""
    return lambda: close_later(Emulator())


@pytest.mark.realtime
def test_a_killed_driver_leaves_a_robot_that_stops(emulate):
    """The firmware's image has its watchdog tested in simulated time."""
    robot, times = emulate(), []
    while not is_decided(times, HOST_DEAD_S, RUNS):
        with subprocess.Popen([sys.executable, "-c", DRIVE, robot.path], stdout=subprocess.PIPE) as process:
            process.stdout.readline()
            wait_until(lambda: robot.moves)
            process.kill()
            killed_s = time.monotonic()
            times.append(robot.wait_for(STOP, killed_s) - killed_s)
        wait_until(lambda: not robot.moves)
    require_median(times, HOST_DEAD_S, "the stop of a robot whose driver is dead")


@pytest.mark.realtime
def test_a_command_source_that_dies_stops_the_robot(emulate):
    """A stop for another reason is not counted: a busy computer may hold up the driver before the last command."""
    robot, times = emulate(), []
    with Driver(robot.path, options=Options(command_timeout_s=TIMEOUT_S)) as driver:
        while not is_decided(times, TIMEOUT_S + BEYOND_TIMEOUT_S, RUNS):
            for _ in range(3):
                taken = driver.drive(0.2, 0.0)
                last_s = time.monotonic()
                time.sleep(0.05)
            stopped_s = robot.wait_for(STOP, last_s) if taken else 0.0
            if taken and driver.stop_reason == "command_timeout":
                times.append(stopped_s - last_s)
    assert TIMEOUT_S - ON_CLOCKS_S <= min(times), times
    require_median(times, TIMEOUT_S + BEYOND_TIMEOUT_S, "the stop of a robot without commands")


@pytest.mark.realtime
def test_a_silent_board_is_stale_in_time(mrl_sim):
    times = []
    with Driver(mrl_sim()) as driver:
        heard = []
        driver.on_event(lambda event: heard.append((time.monotonic(), event)))
        while not is_decided(times, SILENT_S, RUNS):
            heard.clear()
            os.kill(mrl_sim.process.pid, signal.SIGSTOP)
            stopped_s = time.monotonic()
            wait_until(lambda: any(isinstance(event, Stale) for _, event in heard))
            times.append(next(at for at, event in heard if isinstance(event, Stale)) - stopped_s)
            os.kill(mrl_sim.process.pid, signal.SIGCONT)
            wait_until(lambda: driver.ready)
    require_median(times, SILENT_S, "noticing a silent board")


def test_a_port_that_takes_no_bytes_blocks_nobody_for_long(serve):
    """`test_link` has the time after which a write is given up."""
    port = serve()
    with Driver(port.path) as driver:
        port.held.set()

        def blocked():
            driver.request(30)
            return driver.link.statistics.blocked_writes

        wait_until(blocked, step_s=0.0)
        port.held.clear()
        wait_until(lambda: driver.ready)


def stop_by(robot, number):
    """Seconds from a signal at `mrl drive` to the stop at the motor board, and to its exit, and its exit code."""
    command = [sys.executable, "-m", "mrl_driver", "drive", "--port", robot.path, "--linear", "0.2"]
    begun_s = time.monotonic()
    process = subprocess.Popen([*command, "--for", "60"], stderr=subprocess.DEVNULL)
    robot.wait_for(MOVE, begun_s)
    sent_s = time.monotonic()
    process.send_signal(number)
    stopped_s = robot.wait_for(STOP, sent_s)
    process.wait(PATIENCE_S)
    return stopped_s - sent_s, time.monotonic() - sent_s, process.returncode


@pytest.mark.realtime
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_stop_the_robot_and_end_the_program(emulate, number, code):
    robot, stops, exits = emulate(), [], []
    while not is_decided(stops, SIGNAL_STOP_S, RUNS) or not is_decided(exits, SIGNAL_EXIT_S, RUNS):
        stop_s, exit_s, found = stop_by(robot, number)
        stops.append(stop_s)
        exits.append(exit_s)
        assert found == code
        assert robot.stop_reason == "host"  # not its watchdog
        wait_until(lambda: not robot.moves)
    require_median(stops, SIGNAL_STOP_S, "the stop after a signal")
    require_median(exits, SIGNAL_EXIT_S, "the end after a signal")


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0])
def test_the_wall_clock_may_jump(serve, monkeypatch, jump_s):
    with Driver(serve().path, options=Options(command_timeout_s=None)) as driver:
        seen, events, real = [], [], time.time
        driver.on_telemetry(seen.append)
        driver.on_event(events.append)

        def driven_through_a_jump():
            """False if the driver noticed a silence, as when the host is held up: then once more."""
            drive_until(driver, 0.2, 0.0, lambda: driver.twist.linear_m_s > 0.15)
            seen.clear()
            events.clear()
            with monkeypatch.context() as jump:
                jump.setattr(time, "time", lambda: real() + jump_s)
                wait_until(lambda: len(seen) > 20)
            return not events and driver.command == (0.2, 0.0)

        wait_until(driven_through_a_jump)
        assert all(0.1 < each.twist.linear_m_s < 0.3 for each in seen)
        assert driver.link.age_s < 1.0


def test_nothing_in_the_driver_asks_for_the_time_of_day():
    """What goes to people or other programs has the date on which it was made; nothing else has one."""
    files = pathlib.Path(mrl_driver.__file__).parent.rglob("*.py")
    users = {
        f"{file.parent.name}/{file.name}"
        for file in files
        if re.search(r"time\.time\(|datetime|\btime_ns", file.read_text())
    }
    assert users <= {
        "recording/recording.py",
        "calibration/calibration_files.py",
        "commands/doctor.py",
        "host/certificate.py",
        "driver/parameter_file.py",
        "commands/monitor.py",
        "review/page.py",
        "measure/report.py",
    }


def test_a_wall_clock_that_is_set_back_holds_up_no_wait(cable, monkeypatch, tmp_path):
    """Before Python 3.11 the time-outs of `threading` come hours later; here they never come."""
    wait, file = threading.Condition.wait, tmp_path / "drive.txt"
    monkeypatch.setattr(threading.Condition, "wait", lambda condition, timeout=None: wait(condition))
    with Driver(cable.path, options=Options(reconnect=True, record=str(file))) as robot:
        assert not robot.wait(0.01)
        wait_until(lambda: " < " in file.read_text())
        for _ in range(100):  # more than may wait for the line
            robot.request(30)
        cable.unplug()
        wait_until(lambda: not robot.ready)
        cable.plug()
        wait_until(lambda: robot.ready)


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


def turn_by_request(robot):
    robot.stop()
    robot.request(BY_NAME["move_motors"].code, 20, 20)


@pytest.mark.parametrize("turn", [lambda robot: None, turn_by_request])
def test_a_stop_because_the_machine_was_suspended(robot, monkeypatch, turn):
    """The clock of timers stands still meanwhile; only that of the boot goes on."""
    turn(robot)
    since_boot_s = time.clock_gettime
    monkeypatch.setattr(time, "clock_gettime", lambda clock: since_boot_s(clock) + 3600.0)
    wait_until(lambda: robot.stop_reason == "host_paused")
    wait_until(lambda: robot.fake.speeds == (0, 0))
    assert robot.command is None


@pytest.mark.parametrize("version, stop", [(1, relay.STOP_2013), (2, relay.STOP)])
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
        assert "its bridge, pins or wiring are not set; see mrl doctor" in robot.warning
