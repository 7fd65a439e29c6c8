"""The driver with its thread, on a pty with a fake board at the other end."""

import contextlib
import math
import re
import threading
import time
from unittest import mock

import pytest

from mrl_driver.driver import Driver, Options, link_source
from mrl_driver.errors import (
    BoardTimeout,
    ConfigError,
    FrameError,
    LinkError,
    LinkLost,
    MrlError,
    NotARobot,
    PortBusy,
    PortDenied,
    PortMissing,
    WrongRobot,
)
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.session.events import Awaited
from mrl_driver.transport import open_link
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.relay import STOP_2013
from tests.fake_board import FakeBoard
from tests.waiting import PATIENCE_S, drive_until, require_median, wait_until

TURN, STOP = BY_NAME["move_motors_pid"].code, BY_NAME["stop"].code
CLOSE_S, RUNS = 1.0, 5  # Longest good-bye, the median of so many


@pytest.fixture
def robot(serve):
    port = serve()
    with Driver(port.path, options=Options(command_timeout_s=None)) as driver:
        driver.port = port
        driver.fake = port.board
        yield driver


@pytest.mark.parametrize("error", [False, True])
def test_leaving_the_block_stops_the_robot_first(serve, error):
    port, options = serve(), Options(command_timeout_s=None)
    with contextlib.suppress(ZeroDivisionError), Driver(port.path, options=options) as driver:
        drive_until(driver, 0.2, 0, lambda: port.board.speeds == (200, 0))
        1 / (not error)  # noqa: B018
    wait_until(lambda: port.board.speeds == (0, 0))
    assert port.board.moves[-1] == (200, 0)


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
    greeting = rb"@13e(@(65541|29|5)(,-?\d+)?e)+"  # the driver may greet once more in between
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


def test_a_driver_that_is_closed_is_not_ready_and_has_no_ranges(robot):
    """They would be those of the end for ever."""
    wait_until(lambda: robot.ready and robot.ranges)
    robot.close()
    assert not robot.ready and robot.ranges == {}


@pytest.mark.parametrize("where", ["the program", "a callback"])
def test_a_driver_that_nothing_refers_to_stops_its_robot_and_leaves_the_port(serve, where):
    port = serve()
    kept = [Driver(port.path, options=Options(command_timeout_s=None))]
    kept[0].connect()
    drive_until(kept[0], 0.2, 0.0, lambda: port.board.speeds == (200, 0))
    thread = next(each for each in threading.enumerate() if each.name == "mrl-driver")
    with pytest.warns(ResourceWarning, match="lost before it was closed"):
        if where == "the program":
            kept.clear()
        else:
            kept[0].on_telemetry(lambda _: kept.clear())
            thread.join(PATIENCE_S)
    assert not thread.is_alive()
    wait_until(lambda: port.board.speeds == (0, 0))
    with Driver(port.path, options=WAITS) as another:
        assert another.ready


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


def test_a_driver_that_opens_its_port_is_not_connected_a_second_time(serve, monkeypatch):
    """Two threads would read one board, if its port can be opened twice, such as a TCP address."""
    robot, refused = Driver(serve().path), []

    def open_when_refused(*args):
        with pytest.raises(MrlError, match="connected already") as error:
            robot.connect()
        refused.append(error)
        return open_link.open_link(*args)

    monkeypatch.setattr("mrl_driver.driver.link_source.open_link", open_when_refused)
    with robot:
        assert robot.ready and len(refused) == 1


def test_ctrl_c_while_the_reading_thread_begins_ends_it_and_frees_the_port(serve, monkeypatch):
    threads, raised, start, path = [], [], threading.Thread.start, serve().path
    monkeypatch.setattr(threading, "excepthook", raised.append)

    def interrupted(thread):
        threads.append(thread)
        start(thread)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(threading.Thread, "start", interrupted)
        Driver(path).connect()
    wait_until(lambda: not threads[0].is_alive())
    with Driver(path) as robot:
        assert robot.ready and not raised


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


@pytest.mark.parametrize(
    "call", [lambda robot: robot.ask(BY_NAME["get_stream"].code), lambda robot: robot.wait()]
)
def test_a_callback_that_would_wait_for_its_own_thread_ends_the_driver_with_the_reason(robot, call):
    robot.on_telemetry(lambda _: call(robot))
    with pytest.raises(MrlError, match="is called in a callback, whose thread reads the port"):
        robot.wait(PATIENCE_S)


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
    port, refused = serve(), []

    def turn(_):
        try:
            driver.request(TURN, 50, 50)
        except MrlError as error:
            refused.append(str(error))

    with Driver(port.path) as driver:
        driver.on_telemetry(turn)
        wait_until(lambda: TURN in [frame.code for frame in port.board.heard])
    wait_until(lambda: port.board.period_s is None)
    assert [code for code in (frame.code for frame in port.board.heard) if code in (TURN, STOP)][-1] == STOP
    assert any("(the driver is being closed)" in each for each in refused)


@pytest.mark.parametrize(
    "error",
    [ZeroDivisionError(), FrameError("no such frame"), LinkLost("another robot"), BoardTimeout("no answer")],
)
@pytest.mark.parametrize("version, reconnect", [(1, False), (2, False), (2, True)])
def test_a_callback_that_raises_ends_the_driver_and_stops_the_robot(
    serve, monkeypatch, version, reconnect, error
):
    monkeypatch.setattr(threading, "excepthook", lambda args: None)
    port = serve(version=version)
    with Driver(port.path, options=Options(command_timeout_s=None, reconnect=reconnect)) as robot:
        drive_until(robot, 0.1, 0, lambda: port.board.speeds == (100, 0))
        robot.on_telemetry(mock.Mock(side_effect=error))
        wait_until(lambda: robot.error is not None)
        with pytest.raises(
            MrlError, match="no such frame|callback raised (ZeroDivisionError|LinkLost|BoardTimeout)"
        ):
            robot.drive(0.1, 0)
        wait_until(lambda: port.board.speeds == (0, 0))


def test_closing_does_not_wait_for_a_callback_that_is_blocked(serve):
    entered, free = threading.Event(), threading.Event()
    driver = Driver(serve().path)
    driver.connect()
    driver.on_telemetry(lambda _: (entered.set(), free.wait()))
    assert entered.wait(PATIENCE_S)
    closer = threading.Thread(target=driver.close, daemon=True)
    closer.start()
    closer.join(PATIENCE_S)
    closed = not closer.is_alive()
    free.set()
    assert closed


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


def test_another_model_is_refused(serve):
    with pytest.raises(WrongRobot, match=r"the board is traxbot \(id 1\), expected stingbot \(id 4, 5\)"):
        Driver(serve().path, "stingbot").connect()


def test_a_board_whose_firmware_is_for_other_motors_is_refused(serve):
    """Gains of an H-bridge make the wheels of an OMNI-3MD swing; counts of a motor board are others."""
    with pytest.raises(WrongRobot, match="drives an OMNI-3MD, expected H-bridges for duo: flash it with"):
        Driver(serve(robot_id=23).path).connect()
    board = FakeBoard()
    board.capabilities.add("bridge")
    with pytest.raises(WrongRobot, match="drives H-bridges, expected an OMNI-3MD for traxbot: flash it with"):
        Driver(serve(board).path).connect()


@pytest.mark.parametrize(
    ("robot_id", "words"), [(0, "not set; set it with: mrl set-id"), (99, "99 is in no packaged model")]
)
def test_an_unknown_id_is_refused(serve, robot_id, words):
    with pytest.raises(WrongRobot, match=words):
        Driver(serve(robot_id=robot_id).path).connect()


@pytest.mark.parametrize(
    "wrong",
    [
        *({"period_ms": -1}, {"watchdog_ms": 10001}, {"command_timeout_s": 0}, {"port_timeout_s": -1}),
        *({"line_baud": 2400}, {"line_baud": 10**9}, {"build": "sonnar"}),
    ],
)
def test_an_option_out_of_range_is_refused_before_the_port_is_opened(wrong):
    with pytest.raises(ConfigError, match=f"{next(iter(wrong))} is .*, expected"):
        Driver("/nowhere", options=Options(**wrong))


def test_a_driver_that_is_not_connected_says_so():
    driver = Driver("/nowhere")
    with pytest.raises(BoardTimeout, match="not connected"):
        driver.board  # noqa: B018
    with pytest.raises(LinkLost, match="not connected"):
        driver.stop()
    with pytest.raises(BoardTimeout, match="not connected"):
        driver.limited(0.1, 0.0)
    assert driver.telemetry is None and driver.pose == (0, 0, 0)
    driver.close()


def test_a_wait_for_longer_than_the_system_can_wait_waits(serve):
    robot, waited = Driver(serve().path), []
    robot.connect()
    thread = threading.Thread(target=lambda: waited.append(robot.wait(math.inf)))
    thread.start()
    robot.close()
    thread.join(PATIENCE_S)
    assert waited == [True]


def test_a_board_whose_answers_another_program_takes_ends_with_that_programs_name(serve, monkeypatch):
    """It has opened the port after this one, or its user is another."""
    port = serve()
    port.held.set()
    monkeypatch.setattr(link_source, "opened_by", lambda name: f"cat (process 7) at {name}")
    with pytest.raises(
        PortBusy, match=rf"in use by cat \(process 7\) at {port.path}, which takes .*no answer"
    ):
        Driver(port.path, options=Options(greeting_s=0.3)).connect()


def test_a_board_that_is_silent_without_another_program_is_silent(serve):
    port = serve()
    port.held.set()
    with pytest.raises(NotARobot, match="no answer"):
        Driver(port.path, options=Options(greeting_s=0.3)).connect()


def test_own_bytes_that_come_back_are_named():
    """As from a loopback plug, or a login prompt."""
    with pytest.raises(NotARobot, match=r"the bytes that were sent come back \(b'@"):
        Driver("loop://").connect()


WAITS = Options(port_timeout_s=PATIENCE_S)


def refuse(*errors):
    """The port gives these errors, then opens."""
    left = list(errors)

    def opener(*args):
        if left:
            raise left.pop(0)
        return mock.DEFAULT

    return mock.patch.object(link_source, "open_link", side_effect=opener, wraps=link_source.open_link)


DENIED, MISSING, BUSY = PortDenied("no permission"), PortMissing("does not exist"), PortBusy("in use")
SILENT = LinkError("its device does not answer (Protocol error)")


def test_any_error_of_the_port_is_waited_for_and_told_once(serve):
    events = []
    robot = Driver(serve().path, options=WAITS)
    robot.on_event(events.append)
    with refuse(MISSING, DENIED, DENIED, SILENT, BUSY):
        assert robot.connect().robot_id == 1
    robot.close()
    told = [event.reason for event in events if isinstance(event, Awaited)]
    assert told == [
        "does not exist",
        "no permission",
        "its device does not answer (Protocol error)",
        "in use",
    ]


def test_after_the_time_the_last_error_ends_it(serve):
    robot = Driver(serve().path, options=Options(port_timeout_s=0.3))
    with refuse(MISSING, *[DENIED] * 1000), pytest.raises(PortDenied):
        robot.connect()


def test_a_driver_that_waits_for_its_port_can_be_closed(tmp_path):
    robot = Driver(str(tmp_path / "port"), options=WAITS)
    waits, ended = threading.Event(), []
    robot.on_event(lambda event: waits.set())

    def connect():
        try:
            robot.connect()
        except LinkLost as error:
            ended.append(error)

    thread = threading.Thread(target=connect)
    thread.start()
    assert waits.wait(PATIENCE_S)
    robot.close()
    thread.join(PATIENCE_S)
    assert len(ended) == 1
