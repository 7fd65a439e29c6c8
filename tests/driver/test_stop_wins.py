"""Nothing that happens beside a stop, or beside the end of a command, lets the robot drive on."""

import os
import threading
import time

import pytest

from mrl_driver.driver import Driver, Options, connection
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, MrlError
from mrl_driver.protocol.table import BAUD, BY_NAME, MAX_FRAME, STOP_CODE
from mrl_driver.recording import recording
from mrl_driver.session import session
from mrl_driver.session.polling import BUSY_S
from tests.conformance.bench import Bench
from tests.radio_board import PEER
from tests.scripted_line import ScriptedLine
from tests.waiting import PATIENCE_S, wait_until

from .line import Line

MOVE_MOTORS, COUNTERS = BY_NAME["move_motors_pid"].code, BY_NAME["read_counters"].code
WATCHDOG_S, STEP_S = 0.25, 0.05
NOISE_M_S = 0.003  # A wheel that is slower stands still


def whole(data):
    return data


def cut(data):
    return b""


def full(data):
    raise BoardTimeout("the port has accepted no data for 100 ms")


class Stepped:
    """A robot in simulated time."""

    def __init__(self, environment=False, **options):
        self.bench = Bench("python", environment=environment, battery_v=12.0)
        self.line = ScriptedLine(self.bench.board)
        self.driver = SteppedDriver(self.line, self.bench.model, options=Options(**options))
        self.driver.connect()

    def drive(self, seconds=1.0):
        for _ in range(round(seconds / STEP_S)):
            self.driver.drive(0.2, 0.0)
            self.driver.wait(STEP_S)

    @property
    def turning(self):
        return any(abs(speed) > NOISE_M_S for speed in self.bench.wheels())

    def turned_for_s(self, most_s):
        """How long the wheels go on turning."""
        begun_s, last_s = self.driver.now_s, 0.0
        while self.driver.now_s - begun_s < most_s:
            self.driver.wait(STEP_S)
            last_s = self.driver.now_s - begun_s if self.turning else last_s
        return last_s


@pytest.mark.parametrize("environment", [False, True], ids=["sonar build", "environment build"])
def test_what_a_request_turns_stops_without_another_request(environment):
    """The polls of the environment sensors feed the watchdog, so it does not stop the motors."""
    robot = Stepped(environment)
    robot.driver.wait(1.0)
    robot.driver.request(MOVE_MOTORS, 20, 20)
    assert 1.0 < robot.turned_for_s(6.0) <= BUSY_S + WATCHDOG_S + STEP_S


def test_requests_that_go_on_turn_the_motors_on():
    robot = Stepped()
    for _ in range(40):
        robot.driver.request(MOVE_MOTORS, 20, 20)
        robot.driver.wait(0.1)
    assert robot.turning and robot.driver.stop_reason != "command_timeout"


def lower(driver):
    driver.limits = driver.limits._replace(angular_rad_s=0.5)


LIMITED = pytest.mark.parametrize(
    "limit", [lower, lambda driver: driver.restrict(lambda speeds, now: (0.0, 0.0))]
)


@LIMITED
def test_a_request_that_turns_motors_is_refused_while_speeds_are_limited(limit):
    """The board would turn them faster."""
    robot = Stepped()
    limit(robot.driver)
    with pytest.raises(MrlError, match=r"use drive\(\)"):
        robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.wait(1.0)
    assert not robot.turning


@LIMITED
def test_what_a_request_turns_stops_as_soon_as_speeds_are_limited(limit):
    robot = Stepped()
    robot.driver.wait(1.0)
    robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.wait(0.3)
    assert robot.turning
    limit(robot.driver)
    assert robot.turned_for_s(1.0) < 0.5


def test_a_request_of_a_stop_stops():
    """Otherwise the next repeat would send the old command."""
    robot = Stepped()
    robot.drive()
    robot.driver.request(STOP_CODE)
    robot.driver.wait(STEP_S)
    assert robot.driver.command is None and robot.driver.stop_reason == "user"


def test_a_command_of_zero_while_telemetry_is_late_is_a_stop():
    """A command would not be sent then."""
    robot = Stepped()
    robot.drive()
    robot.line.to_host = cut
    robot.driver.wait(0.12)
    robot.driver.drive(0.0, 0.0)
    robot.driver.wait(0.01)
    assert not robot.bench.is_driven() and robot.driver.stop_reason == "user"


def test_a_command_that_the_port_did_not_accept_is_held_back_while_telemetry_is_late():
    """The request would let the board go on with the command from before."""
    robot = Stepped()
    robot.drive()
    robot.line.to_board = full
    assert not robot.driver.drive(0.02, 0.0)
    robot.line.to_board, robot.line.to_host = whole, cut
    robot.driver.wait(0.12)
    robot.driver.request(COUNTERS)
    robot.driver.wait(0.01)
    assert not robot.bench.is_driven() and robot.driver.stop_reason == "no_telemetry"


def test_a_robot_whose_line_was_cut_is_not_called_stopped_while_it_may_turn():
    robot = Stepped(command_timeout_s=2.0)
    robot.drive()
    robot.line.to_board = robot.line.to_host = cut
    robot.driver.wait(0.3)
    assert robot.driver.command is None and robot.turning and not robot.driver.stopped
    robot.driver.wait(1.0)
    robot.line.to_board = robot.line.to_host = whole
    robot.driver.wait(2.0)
    assert robot.driver.stopped


@pytest.fixture
def line():
    line = Line()
    line.board.capabilities.add("xbee")
    return line


@pytest.fixture
def driver(line):
    driver = Driver(line, "traxbot")
    driver.connect()
    yield driver
    line.open.set()
    driver.close()


@pytest.fixture
def hung(driver, line):
    """The robot drives, and a callback hangs for so long that telemetry is late."""
    hangs, goes_on = threading.Event(), threading.Event()

    def hang(telemetry):
        hangs.set()
        goes_on.wait(PATIENCE_S)

    driver.drive(0.2, 0.0)
    wait_until(lambda: line.board.moves, what="the move")
    driver.on_telemetry(hang)
    assert hangs.wait(PATIENCE_S)
    wait_until(lambda: driver.link.age_s >= session.LATE_S, what="late telemetry")
    yield driver
    goes_on.set()


NEWER = {
    "slower": lambda driver: driver.drive(0.02, 0.0),
    "in the zone": lambda driver: driver.restrict(lambda speeds, now: (0.0, 0.0)),
    "lower limit": lambda driver: setattr(driver, "limits", driver.limits._replace(linear_m_s=0.02)),
    "none": lambda driver: wait_until(lambda: driver.link.age_s >= session.STALE_S, what="stale telemetry"),
}
SENDERS = {
    "request": lambda driver: driver.request(COUNTERS),
    "text": lambda driver: driver.radio.send(PEER, "x"),
}


@pytest.mark.parametrize("newer", NEWER)
@pytest.mark.parametrize("sender", SENDERS)
def test_what_feeds_the_watchdog_while_a_callback_hangs_comes_after_a_stop(hung, line, newer, sender):
    """Otherwise the board goes on with the command from before."""
    NEWER[newer](hung)
    before = len(line.board.heard)
    SENDERS[sender](hung)
    codes = [frame.code for frame in line.board.heard[before:]]
    assert codes[0] == STOP_CODE and len(codes) == 2
    assert (hung.command, hung.stop_reason) == (None, "no_telemetry")


def test_a_slower_command_while_a_callback_hangs_is_not_called_sent(hung, line):
    assert not hung.drive(0.02, 0.0)
    assert line.board.moves[-1] != (20, 0)


def block(driver, line):
    """Let the write of another thread block; return the thread."""
    line.stuck = "blocker"
    line.open.clear()
    blocker = threading.Thread(target=lambda: driver.request(COUNTERS), name="blocker")
    blocker.start()
    wait_until(lambda: line.blocked, what="a write that blocks")
    return blocker


def test_a_command_that_waits_for_a_short_write_of_another_thread_is_sent(driver, line, monkeypatch):
    monkeypatch.setattr(connection, "WRITE_TIMEOUT_S", PATIENCE_S)
    blocker, sent = block(driver, line), []
    driving = threading.Thread(target=lambda: sent.append(driver.drive(0.1, 0.0)))
    driving.start()
    wait_until(lambda: driver._connection.queuing, what="the command that waits")
    line.open.set()
    driving.join()
    assert sent == [True]
    wait_until(lambda: (100, 0) in line.board.moves, what="the move, as soon as the pace allows")
    blocker.join()


def test_a_command_that_the_port_does_not_accept_in_time_follows_later(driver, line, monkeypatch):
    write, user = line.write, threading.current_thread()

    def give_up(data):
        if threading.current_thread() is user:
            full(data)
        write(data)

    monkeypatch.setattr(line, "write", give_up)
    assert not driver.drive(0.1, 0.0)
    wait_until(lambda: (100, 0) in line.board.moves, what="the move")


def test_a_command_that_waits_too_long_for_the_write_of_another_thread_follows_later(driver, line):
    blocker = block(driver, line)
    assert not driver.drive(0.1, 0.0)
    line.open.set()
    wait_until(lambda: (100, 0) in line.board.moves, what="the move")
    blocker.join()


def test_requests_wait_for_the_line_so_that_a_stop_does_not_wait_for_them(driver):
    """A port accepts more bytes than its line carries, and a network far more."""
    sent, begun_s = driver.link.statistics.bytes_out, time.monotonic()
    for _ in range(300):
        driver.request(COUNTERS)
    ahead = driver.link.statistics.bytes_out - sent - (time.monotonic() - begun_s) * BAUD / connection.BITS
    assert ahead < connection.QUEUE_BYTES + MAX_FRAME


def test_a_request_that_waited_for_the_line_is_not_sent_after_a_stop(driver, line):
    refused = []

    def turn():
        try:
            driver.request(MOVE_MOTORS, 20, 20)
        except MrlError as error:
            refused.append(str(error))

    blocker = block(driver, line)
    while not driver._connection.queuing:
        waiting = threading.Thread(target=turn)
        waiting.start()
        waiting.join(0.01)
    driver.stop()
    line.open.set()
    waiting.join()
    blocker.join()
    assert "a stop came while request" in refused[-1]
    assert driver.command is None


def test_a_disk_that_hangs_delays_no_stop(line, monkeypatch, tmp_path):
    """A recording ends and the next one begins, so that the reading thread exchanges its link meanwhile."""
    monkeypatch.setattr("mrl_driver.driver.link_source.open_link", lambda *args, **kwargs: line)
    driver = Driver("/dev/robot", "traxbot", options=Options(record=str(tmp_path / "first.mrl")))
    driver.connect()
    opens, goes_on, usual = threading.Event(), threading.Event(), os.open

    def slow(path, *args, **kwargs):
        if str(path).endswith("second.mrl"):
            opens.set()
            goes_on.wait(PATIENCE_S)
        return usual(path, *args, **kwargs)

    def exchange_files():
        driver.recorder.stop()
        driver.recorder.start(str(tmp_path / "second.mrl"))

    monkeypatch.setattr(recording.os, "open", slow)
    exchanging, stopping = threading.Thread(target=exchange_files), threading.Thread(target=driver.stop)
    driver.drive(0.2, 0.0)
    exchanging.start()
    try:
        assert opens.wait(PATIENCE_S)
        frames = driver.link.statistics.frames
        wait_until(lambda: driver.link.statistics.frames > frames + 3, what="telemetry")
        stopping.start()
        wait_until(lambda: not stopping.is_alive(), what="the stop")
    finally:
        goes_on.set()
        exchanging.join()
        driver.close()
    assert (tmp_path / "second.mrl").read_bytes()
