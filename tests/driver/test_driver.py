"""The driver with its thread, on a pty with a fake board at the other end."""

import contextlib
import math
import os
import re
import threading
import time
import tty

import numpy as np
import pytest

from mrl_driver.driver import Driver, Options
from mrl_driver.errors import (
    BatteryDead,
    BoardTimeout,
    ConfigError,
    FrameError,
    LinkLost,
    MrlError,
    NotARobot,
    PortBusy,
    WrongRobot,
)
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.models import load
from mrl_driver.transport import open_link
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.relay import STOP_2013
from tests.waiting import PATIENCE_S, drive_until, require_median, wait_until

TURN, STOP = BY_NAME["move_motors_pid"].code, BY_NAME["stop"].code
CLOSE_S, RUNS = 1.0, 5
"""Longest good-bye, the median of so many."""


@pytest.fixture
def robot(serve):
    port = serve()
    with Driver(port.path, options=Options(command_timeout_s=None)) as driver:
        driver.port = port
        driver.fake = port.board
        yield driver


def test_connecting_says_who_answers(serve):
    with Driver(serve(robot_id=4).path) as driver:
        assert (driver.board.robot_id, driver.model.name) == (4, "stingbot")


def test_the_first_telemetry_is_there_when_connected(robot):
    assert robot.ready and robot.telemetry.pose == (0, 0, 0)
    assert robot.ranges == {"front": 1.2, "left": 0.45, "right": math.inf}
    assert robot.battery_v == 12.0 and robot.battery_state == "ok"


def test_driving_reaches_the_board_in_its_units(robot):
    drive_until(robot, 0.2, -0.8, lambda: robot.fake.speeds == (200, -800))
    assert robot.command == (0.2, -0.8)


def test_the_pose_follows(robot):
    drive_until(robot, 0.3, 0, lambda: robot.pose.x_m > 0.02)
    assert robot.twist.linear_m_s == pytest.approx(0.3, abs=0.05)


def test_too_fast_is_scaled_on_the_same_arc(robot):
    robot.drive(0.6, 0.5)
    assert robot.command == (0.3, 0.25)


@pytest.mark.parametrize("huge", [1e308, -1e308])
def test_a_huge_speed_is_clamped(robot, huge):
    robot.drive(huge, 0.0)
    assert robot.command == (math.copysign(0.3, huge), 0)


@pytest.mark.parametrize("speeds", [(math.nan, 0), (0, math.inf), (-math.inf, math.nan), (10**400, 0)])
def test_no_number_is_refused_and_stops_the_robot(robot, speeds):
    robot.drive(0.2, 0)
    with pytest.raises(FrameError, match="expected a finite number"):
        robot.drive(*speeds)
    wait_until(lambda: robot.fake.speeds == (0, 0))
    assert robot.command is None


def test_a_stop_is_confirmed(robot):
    drive_until(robot, 0.2, 0, lambda: robot.fake.speeds == (200, 0))
    robot.stop()
    assert not robot.stopped
    wait_until(lambda: robot.stopped)
    assert robot.fake.speeds == (0, 0)


def test_leaving_the_block_stops_the_robot_first(serve):
    port = serve()
    with Driver(port.path, options=Options(command_timeout_s=None)) as driver:
        drive_until(driver, 0.2, 0, lambda: port.board.speeds == (200, 0))
    wait_until(lambda: port.board.speeds == (0, 0))
    assert port.board.moves[-1] == (200, 0)


def test_an_error_in_the_block_stops_the_robot_too(serve):
    port = serve()
    with pytest.raises(ZeroDivisionError), Driver(
        port.path, options=Options(command_timeout_s=None)
    ) as driver:
        drive_until(driver, 0.2, 0, lambda: port.board.speeds == (200, 0))
        1 / 0  # noqa: B018
    wait_until(lambda: port.board.speeds == (0, 0))


@pytest.mark.realtime
def test_closing_takes_at_most_a_second_with_a_silent_board(serve):
    """All at the same time: each waits for its board's answer."""
    ports, times = [serve() for _ in range(RUNS)], []
    robots = [Driver(port.path) for port in ports]

    def close(robot):
        start_s = time.monotonic()
        robot.close()
        times.append(time.monotonic() - start_s)

    for robot in robots:
        robot.connect()
    for port in ports:
        port.held.set()
    threads = [threading.Thread(target=close, args=(robot,)) for robot in robots]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(times) == RUNS
    require_median(times, CLOSE_S, "closing")


def test_closing_twice_and_from_a_callback_is_harmless(serve):
    driver = Driver(serve().path)
    driver.connect()
    driver.on_telemetry(lambda _: driver.close())
    wait_until(lambda: not driver.ready or driver.wait(0))
    driver.close()
    with pytest.raises(LinkLost):
        driver.drive(0, 0)


def test_a_close_repeats_a_stop_that_a_silent_board_cannot_confirm(prompt, robot):
    """The first may break off a frame, and then a board of 2013 drops both."""
    robot.port.board.mute = True
    wait_until(lambda: not robot.ready)
    robot.close()
    greeting = rb"@13e@5e(@5,-?\d+e)?"  # the driver may greet once more in between
    repeated = rb"@13e(%s)*@13e@19" % greeting
    wait_until(lambda: re.search(repeated, bytes(robot.port.received)))


def test_a_close_from_a_callback_repeats_a_stop_that_was_lost(serve, monkeypatch):
    """A board of 2013 would drive on."""
    port = serve(version=1)
    driver = Driver(port.path, options=Options(command_timeout_s=None))
    driver.connect()
    drive_until(driver, 0.2, 0.0, lambda: port.board.speeds == (200, 0) and driver.twist.linear_m_s > 0.1)
    write, lost = SerialLink.write, []

    def lose_first_stop(link, data):
        if STOP_2013 in data and not lost:
            lost.append(data)
        else:
            write(link, data)

    monkeypatch.setattr(SerialLink, "write", lose_first_stop)
    driver.on_telemetry(lambda _: driver.close())
    wait_until(lambda: port.board.speeds == (0, 0))
    assert lost
    driver.close()


def test_a_close_while_the_port_opens_ends_the_connecting(serve, monkeypatch):
    """As by Ctrl-C in another thread, with a host that does not answer."""
    closing, opening = threading.Event(), threading.Event()

    def slow(*args):
        opening.set()
        closing.wait(PATIENCE_S)
        return open_link.open_link(*args)

    monkeypatch.setattr("mrl_driver.driver.link_source.open_link", slow)
    driver = Driver(serve().path)
    closer = threading.Thread(target=lambda: (opening.wait(PATIENCE_S), driver.close(), closing.set()))
    closer.start()
    with pytest.raises(LinkLost, match="closed while it connected"):
        driver.connect()
    closer.join()
    assert driver.wait(0)


@pytest.mark.parametrize("where", ["a timer", "a callback"])
def test_a_close_while_the_board_is_greeted_says_so(serve, where):
    robot = Driver(serve(boot_s=PATIENCE_S if where == "a timer" else 0.0).path)
    robot.on_event(lambda _: robot.close())
    timer = threading.Timer(0.1 if where == "a timer" else PATIENCE_S, robot.close)
    timer.start()
    with pytest.raises(LinkLost, match="closed while it connected"):
        robot.connect()
    timer.cancel()


def test_a_close_ends_the_wait_for_an_answer(robot):
    robot.fake.unknown.add(BY_NAME["read_counters"].code)
    threading.Timer(0.1, robot.close).start()
    with pytest.raises(LinkLost, match="closed"):
        robot.ask(BY_NAME["read_counters"].code, timeout_s=PATIENCE_S)


def test_telemetry_is_called_back_for_each_frame(robot):
    seen = []
    robot.on_telemetry(seen.append)
    wait_until(lambda: len(seen) >= 10)
    assert [b.sequence - a.sequence for a, b in zip(seen, seen[1:])] == [1] * (len(seen) - 1)


def test_a_callback_may_drive(robot):
    robot.on_telemetry(lambda _: robot.drive(0.1, 0))
    wait_until(lambda: robot.fake.speeds == (100, 0))


def test_a_callback_cannot_start_a_robot_that_is_being_stopped(serve):
    """A command that comes during the good-bye would undo the stop."""
    port = serve()
    with Driver(port.path) as driver:
        driver.on_telemetry(lambda _: driver.drive(0.1, 0))
        wait_until(lambda: port.board.speeds == (100, 0))
    wait_until(lambda: port.board.period_s is None)
    assert port.board.speeds == (0, 0)


def test_a_callback_cannot_turn_the_motors_of_a_robot_that_is_being_stopped(serve):
    """A request is a command, too."""
    port = serve()

    def turn(_):
        with contextlib.suppress(MrlError):
            driver.request(TURN, 50, 50)

    with Driver(port.path) as driver:
        driver.on_telemetry(turn)
        wait_until(lambda: TURN in [frame.code for frame in port.board.heard])
        before = len(port.board.heard)  # a pause of the host may have stopped it, too
    wait_until(lambda: port.board.period_s is None)
    codes = [frame.code for frame in port.board.heard]
    assert TURN not in codes[codes.index(STOP, before) :]


def test_an_error_of_its_own_ends_the_driver_and_stops_the_robot(serve):
    """A 2013 board has no watchdog that would."""
    port = serve(version=1)

    def refuse(_):
        raise FrameError("no such frame")

    with Driver(port.path, options=Options(command_timeout_s=None)) as robot:
        drive_until(robot, 0.1, 0, lambda: port.board.speeds == (100, 0))
        robot.on_telemetry(refuse)
        wait_until(lambda: port.board.speeds == (0, 0))


@pytest.mark.parametrize("version", [1, 2])
def test_a_callback_that_raises_ends_the_driver_and_stops_the_robot(serve, monkeypatch, version):
    monkeypatch.setattr(threading, "excepthook", lambda args: None)
    port = serve(version=version)
    with Driver(port.path, options=Options(command_timeout_s=None)) as robot:
        drive_until(robot, 0.1, 0, lambda: port.board.speeds == (100, 0))
        robot.on_telemetry(lambda _: 1 / 0)
        wait_until(lambda: robot.error is not None)
        with pytest.raises(MrlError, match="callback raised ZeroDivisionError"):
            robot.drive(0.1, 0)
        wait_until(lambda: port.board.speeds == (0, 0))


def test_frames_leave_in_one_piece_whatever_the_link_does(robot, monkeypatch):
    """With a link that has no lock: one thread writes at a time, and it takes the bytes of the others along."""
    sent = bytearray()

    def crawl(_, data):
        for byte in data:
            sent.append(byte)
            time.sleep(0.0001)

    monkeypatch.setattr(SerialLink, "write", crawl)
    threads = [threading.Thread(target=lambda: [robot.request(30) for _ in range(20)]) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    wait_until(lambda: sent.count(b"@30") >= 40)
    frames = bytes(sent).split(b"e")[:-1]
    assert all(frame.count(b"@") == 1 and frame[0] == ord("@") for frame in frames)


def test_unplugging_is_a_lost_link(robot):
    heard = []
    robot.on_event(heard.append)
    robot.port.unplug()
    with pytest.raises(LinkLost, match="went away"):
        robot.wait(PATIENCE_S)
    wait_until(lambda: heard)
    assert isinstance(heard[-1], LinkLost) and not robot.ready
    with pytest.raises(LinkLost):
        robot.drive(0.1, 0)


def test_a_stalled_board_is_stale_and_no_command_is_taken(prompt, robot):
    robot.drive(0.2, 0)
    robot.port.held.set()
    wait_until(lambda: not robot.ready)
    assert not robot.drive(0.2, 0)
    assert robot.ranges == {} and robot.twist == (0, 0)
    robot.port.held.clear()
    wait_until(lambda: robot.ready)
    assert robot.command is None


def test_the_pose_is_continuous_over_a_board_reset(prompt, robot):
    drive_until(robot, 0.3, 0, lambda: robot.pose.x_m > 0.05)
    robot.fake.reset(time.monotonic())
    before = robot.pose.x_m
    wait_until(lambda: robot.statistics.restarts == 1 and robot.ready)
    assert abs(robot.pose.x_m - before) < 0.02
    drive_until(robot, 0.3, 0, lambda: robot.pose.x_m > before + 0.02)


def test_a_command_expires_with_the_option(serve):
    with Driver(serve().path, options=Options(command_timeout_s=0.2)) as driver:
        driver.drive(0.2, 0)
        wait_until(lambda: driver.command is None)


# -- what cannot be connected to


def test_another_model_is_refused(serve):
    with pytest.raises(WrongRobot, match=r"the board is traxbot \(id 1\), expected stingbot \(id 4, 5\)"):
        Driver(serve().path, "stingbot").connect()


@pytest.mark.parametrize(
    ("robot_id", "words"), [(0, "not set; set it with: mrl set-id"), (99, "99 is in no packaged model")]
)
def test_an_unknown_id_is_refused(serve, robot_id, words):
    with pytest.raises(WrongRobot, match=words):
        Driver(serve(robot_id=robot_id).path).connect()


def test_a_board_without_id_is_refused_for_a_named_robot_too(serve):
    with pytest.raises(WrongRobot, match="not set; set it with: mrl set-id"):
        Driver(serve(robot_id=0).path, "traxbot").connect()


def test_asking_brings_the_answer(robot):
    assert robot.ask(33, 400) == (400,)


def test_asking_in_vain_is_a_timeout(robot):
    with pytest.raises(BoardTimeout, match="no answer to request 36 in 3 attempts"):
        robot.ask(36, timeout_s=0.05)


def test_a_model_object_may_be_given(serve):
    model = load("traxbot")._replace(name="mine", ids=(42,))
    with Driver(serve(robot_id=42).path, model) as driver:
        assert driver.model.name == "mine"


@pytest.mark.parametrize(("centivolts", "words"), [(40, "motor power is off"), (840, "at least 8.5 V")])
def test_a_dead_battery_is_refused(serve, centivolts, words):
    port = serve()
    port.board.battery = centivolts
    with pytest.raises(BatteryDead, match=words):
        Driver(port.path).connect()


def test_a_dead_battery_may_be_ignored(serve):
    port = serve()
    port.board.battery = 840
    with Driver(port.path, options=Options(ignore_battery=True)) as driver:
        assert driver.drive(0.1, 0)


def test_motor_power_that_goes_off_stops_the_robot(robot):
    robot.drive(0.1, 0)
    robot.fake.battery = 20
    wait_until(lambda: robot.battery_state == "off")
    wait_until(lambda: robot.command is None)
    assert not robot.drive(0.1, 0)


def test_a_busy_port_is_refused(robot):
    with pytest.raises(PortBusy):
        Driver(robot.port.path).connect()


def test_an_unknown_model_is_refused_before_the_port_is_opened():
    with pytest.raises(ConfigError, match="'nix' is unknown"):
        Driver("/nowhere", "nix")


@pytest.mark.parametrize(
    "wrong",
    [
        {"period_ms": -1},
        {"period_ms": 20.5},
        {"watchdog_ms": 10001},
        {"watchdog_ms": True},
        {"command_timeout_s": math.nan},
        {"command_timeout_s": 0},
        {"greeting_s": "8"},
        {"line_baud": 2400},
        {"check": 1},
        {"ignore_battery": "false"},
        {"tap": "file"},
        {"record": 3},
    ],
)
def test_an_option_out_of_range_is_refused_before_the_port_is_opened(wrong):
    with pytest.raises(ConfigError, match=f"{next(iter(wrong))} is .*, expected"):
        Driver("/nowhere", options=Options(**wrong))


@pytest.mark.parametrize("baud", [0, 2400, 9600.5, "115200", True, 10**9])
def test_a_baud_rate_that_is_none_is_refused_before_the_port_is_opened(baud):
    with pytest.raises(ConfigError, match="baud is .*, expected 4800 to 4000000 Bd, a whole number"):
        Driver("/nowhere", baud=baud)


def test_numbers_of_numpy_are_numbers():
    options = Options(period_ms=np.int64(20), command_timeout_s=np.float32(0.5))
    assert Driver("/nowhere", baud=np.int32(9600), options=options).line_baud == 9600


def test_a_silent_port_is_no_robot():
    master, slave = os.openpty()
    tty.setraw(slave)
    with pytest.raises(NotARobot, match="no answer"):
        Driver(os.ttyname(slave), options=Options(greeting_s=0.6)).connect()
    os.close(master)
    os.close(slave)


def test_a_port_can_be_opened_again_after_a_failure(serve):
    port = serve()
    with pytest.raises(WrongRobot):
        Driver(port.path, "stingbot").connect()
    with Driver(port.path) as driver:
        assert driver.ready


def test_a_driver_that_is_not_connected_says_so():
    driver = Driver("/nowhere")
    with pytest.raises(BoardTimeout, match="not connected"):
        driver.board  # noqa: B018
    with pytest.raises(LinkLost, match="not connected"):
        driver.stop()
    with pytest.raises(BoardTimeout, match="not connected"):
        driver.limited(0.1, 0.0)
    assert driver.telemetry is None and driver.pose == (0, 0, 0) and math.isnan(driver.battery_v)
    driver.close()


@pytest.mark.parametrize("code", [8, 6])
def test_2013_boards_work(serve, code):
    with Driver(serve(version=1, stream_code=code).path, options=Options(command_timeout_s=None)) as driver:
        wait_until(lambda: driver.drive(0.2, 0) and driver.pose.x_m > 0.05, step_s=0.05)
        wait_until(lambda: "front" in driver.ranges)
        assert driver.ranges["front"] == pytest.approx(0.798, abs=0.001)
        assert driver.board.protocol == 1 and driver.status is None


def test_a_host_that_was_paused_catches_up(serve):
    """A reader that could not run for a while ends with fresh telemetry, not with a backlog."""
    with Driver(serve().path) as driver:
        paused, over = threading.Lock(), threading.Event()

        def pause(_):
            if paused.acquire(blocking=False):
                time.sleep(0.5)
                over.set()

        driver.on_telemetry(pause)
        assert over.wait(PATIENCE_S)
        wait_until(lambda: driver.ready and driver.age_s < 0.05)
        assert driver.statistics.lost == 0


@pytest.mark.parametrize("timeout_s", [math.nan, "1", True])
@pytest.mark.parametrize("call", [Driver.wait, lambda robot, timeout_s: robot.ask(5, timeout_s=timeout_s)])
def test_a_wait_for_no_number_of_seconds_is_refused(robot, call, timeout_s):
    """NaN would never end."""
    with pytest.raises(ConfigError, match="timeout_s is .*, expected a number of seconds, or None"):
        call(robot, timeout_s)


def test_a_wait_for_longer_than_the_system_can_wait_waits(serve):
    robot, waited = Driver(serve().path), []
    robot.connect()
    thread = threading.Thread(target=lambda: waited.append(robot.wait(math.inf)))
    thread.start()
    robot.close()
    thread.join(PATIENCE_S)
    assert waited == [True]
