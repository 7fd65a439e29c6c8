"""The order in which locks are taken, and that none is held while the port blocks a write."""

import ast
import contextlib
import re
import threading

import pytest

from mrl_driver import lock_order
from mrl_driver.clocks import later
from mrl_driver.driver import Driver, Options
from mrl_driver.driver.connection import QUEUE_BYTES
from mrl_driver.errors import LinkLost, MrlError
from mrl_driver.lock_order import ORDER, VARIABLE, new_lock
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.transport.link import LOCKS
from tests.call_lists import ROOT
from tests.waiting import PATIENCE_S, drive_until, wait_until

LASTING = Options(command_timeout_s=None)
STATUS = BY_NAME["read_status"].code
UNANSWERED = BY_NAME["read_wiring"].code  # by the fake board


@pytest.fixture(autouse=True)
def checked(monkeypatch):
    monkeypatch.setenv(VARIABLE, "1")


def aside(work):
    """Run `work` on a thread of its own, which must end although the port blocks."""
    done = []
    thread = threading.Thread(target=lambda: done.append(work()), daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    assert done, "it waits for the port"
    return done[0]


def test_no_lock_is_held_during_a_write(line):
    with Driver(line, options=LASTING) as robot:
        robot.drive(0.1, 0.0)
        robot.request(STATUS)
        robot.ask(BY_NAME["read_counters"].code)
        robot.stop()
    assert line.held == {()}


def ask_until_blocked(robot, line):
    """A request is written at once by the thread that makes it, unless another one is just writing."""
    while not line.blocked:
        robot.request(STATUS)


@pytest.mark.parametrize("writer", ["another thread", "mrl-driver"])
def test_while_a_write_blocks_the_state_is_read_and_a_stop_returns(line, writer):
    with Driver(line, options=LASTING) as robot:
        drive_until(robot, 0.1, 0.0, lambda: line.board.speeds == (100, 0))
        line.stuck = writer
        line.open.clear()
        if writer == "another thread":
            threading.Thread(target=ask_until_blocked, args=(robot, line), name=writer, daemon=True).start()
        wait_until(lambda: line.blocked)
        assert line.blocked == [writer]
        aside(lambda: (robot.pose, robot.command, robot.stopped, robot.sensors))
        aside(lambda: (robot.link.statistics, robot.link.age_s))
        aside(robot.stop)
        assert robot.command is None and line.blocked == [writer]
        line.open.set()
        wait_until(lambda: line.board.speeds == (0, 0))
        wait_until(lambda: robot.stopped)


def test_a_command_that_is_being_written_does_not_overtake_an_emergency_stop(line):
    with Driver(line, options=LASTING) as robot:
        wait_until(lambda: robot.drive(0.2, 0.0))
        line.open.clear()
        wait_until(lambda: line.blocked)
        aside(lambda: robot.inhibit("emergency stop"))
        assert not aside(lambda: robot.drive(0.2, 0.0))
        line.open.set()
        wait_until(lambda: robot.stopped and line.board.speeds == (0, 0))
        robot.allow("emergency stop")
        assert robot.drive(0.2, 0.0)


def test_a_close_sends_its_stop_although_another_thread_is_writing(line):
    """The board is silent, so the driver does not wait until telemetry confirms the stop."""
    with Driver(line, options=LASTING) as robot:
        line.board.mute, line.stuck = True, "mrl-driver"
        wait_until(lambda: not robot.ready)
        line.open.clear()
        wait_until(lambda: line.blocked)
        before = len(line.board.heard)
        threading.Timer(0.05, line.open.set).start()
    codes = [frame.code for frame in line.board.heard[before:]]
    assert codes[-4:] == [BY_NAME[name].code for name in ("stop", "stop", "stop_stream", "set_check")]


def test_a_close_sends_its_stop_although_its_own_thread_is_writing(line, monkeypatch):
    """As in a signal handler of the program; the board is silent, so nothing waits for telemetry."""
    write, handlers = line.write, []

    def interrupted(data):
        if handlers and threading.current_thread() is threading.main_thread():
            handlers.pop()()
        write(data)

    monkeypatch.setattr(line, "write", interrupted)
    robot = Driver(line, options=LASTING)
    robot.connect()
    line.board.mute = True
    wait_until(lambda: not robot.ready)
    before = len(line.board.heard)
    handlers.append(robot.close)
    with contextlib.suppress(MrlError):
        while handlers:
            robot.request(STATUS)
    codes = [frame.code for frame in line.board.heard[before:]]
    assert codes.count(BY_NAME["stop"].code) == 2


def test_a_stop_does_not_wait_for_a_flood_of_requests(line):
    """While the port blocks, the other thread's requests are queued up to a bound, then dropped and counted."""
    with Driver(line, options=LASTING) as robot:
        drive_until(robot, 0.1, 0.0, lambda: line.board.speeds == (100, 0))
        line.open.clear()
        wait_until(lambda: line.blocked)
        end = threading.Event()

        def flood():
            while not end.is_set():
                robot.request(STATUS)

        threading.Thread(target=flood, daemon=True).start()
        wait_until(lambda: robot.link.statistics.blocked_writes)
        aside(robot.stop)
        before = len(line.board.heard)
        end.set()
        line.open.set()
        wait_until(lambda: line.board.speeds == (0, 0))
        codes = [frame.code for frame in line.board.heard[before:]]
        assert codes.index(BY_NAME["stop"].code) < 2 * QUEUE_BYTES / len(b"@30,-18524e")


def test_a_write_that_is_interrupted_leaves_the_next_one_its_turn(line, monkeypatch):
    """As by Ctrl-C in a program that drives."""
    with Driver(line, options=LASTING) as robot:
        write, interrupts = line.write, [KeyboardInterrupt()]

        def interrupted(data):
            if interrupts and threading.current_thread() is threading.main_thread():
                raise interrupts.pop()
            write(data)

        monkeypatch.setattr(line, "write", interrupted)
        with pytest.raises(KeyboardInterrupt):
            while True:
                robot.request(STATUS)
        drive_until(robot, 0.1, 0.0, lambda: line.board.speeds == (100, 0))


def test_two_reasons_to_inhibit_end_one_by_one(line):
    with Driver(line, options=LASTING) as robot:
        robot.inhibit("emergency stop")
        robot.inhibit("motors disabled")
        robot.allow("emergency stop")
        assert not robot.drive(0.1, 0.0)
        robot.allow("motors disabled")
        assert robot.drive(0.1, 0.0)


def test_a_driver_takes_its_locks_in_order(serve):
    """All its calls at once, on a port; a wrong order would end its thread, or the call."""
    port, errors = serve(), []
    with Driver(port.path, options=LASTING) as robot:

        def call_all():
            try:
                for _ in range(20):
                    robot.drive(0.1, 0.0)
                    robot.ask(BY_NAME["read_counters"].code)
                    robot.limit_again()
                    robot.reset_pose()
                    assert robot.link.statistics and robot.sensors is not None
                    robot.stop()
            except (MrlError, RuntimeError) as error:
                errors.append(error)

        threads = [threading.Thread(target=call_all) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not errors and robot.error is None


@pytest.mark.parametrize("first", range(1, len(ORDER)))
def test_an_earlier_lock_is_not_taken_after_a_later_one(first):
    with new_lock(ORDER[first]), pytest.raises(RuntimeError, match="expected the order"):
        new_lock(ORDER[first - 1]).acquire()


def test_locks_are_taken_in_order_and_again():
    locks = [new_lock(name) for name in ORDER]
    for lock in [*locks, *locks]:
        lock.acquire()
    assert lock_order.held() == ORDER * 2
    for lock in [*locks, *locks]:
        lock.release()
    assert lock_order.held() == ()


def test_a_close_ends_although_its_own_thread_holds_the_lock(line):
    """As in a signal handler that interrupts `drive`: no other thread can take the lock before the handler returns."""
    robot = Driver(line, options=LASTING)
    robot.connect()
    drive_until(robot, 0.1, 0.0, lambda: line.board.speeds == (100, 0))
    main = threading.current_thread()

    def interrupted(speeds, now):
        if threading.current_thread() is main:
            robot.restrict(None)
            robot.close()
        return speeds

    robot.restrict(interrupted)
    robot.drive(0.1, 0.0)
    assert line.board.speeds == (0, 0) and line.board.period_s is None
    robot.close()
    with pytest.raises(MrlError, match="closed"):
        robot.stop()


def test_a_close_under_the_lock_sends_its_stop_although_another_thread_is_writing(line, monkeypatch):
    """The other thread has written, but needs the lock to say so."""
    robot = Driver(line, options=LASTING)
    robot.connect()
    drive_until(robot, 0.1, 0.0, lambda: line.board.speeds == (100, 0))
    main, write = threading.current_thread(), line.write
    begun, over = threading.Event(), threading.Event()

    def slow(data):
        write(data)
        if threading.current_thread() is not main:
            begun.set()
            assert over.wait(PATIENCE_S)

    def interrupted(speeds, now):
        if threading.current_thread() is main:
            robot.restrict(None)
            over.set()
            robot.close()
        return speeds

    monkeypatch.setattr(line, "write", slow)
    assert begun.wait(PATIENCE_S)
    robot.restrict(interrupted)
    robot.drive(0.1, 0.0)
    assert line.board.speeds == (0, 0) and line.board.period_s is None


def test_a_close_just_before_a_wait_begins_ends_the_wait(line, monkeypatch):
    """As in a signal handler: the wait has seen an open driver, and is not yet among those that are notified."""
    robot = Driver(line, options=LASTING)
    robot.connect()
    wait, handlers = threading.Condition.wait, [robot.close]

    def interrupted(condition, timeout=None):
        if handlers and timeout is None and threading.current_thread() is not threading.main_thread():
            handlers.pop()()
        return wait(condition, timeout)

    def ask():
        monkeypatch.setattr(threading.Condition, "wait", interrupted)
        with pytest.raises(LinkLost):
            robot.ask(UNANSWERED, timeout_s=None)
        return not handlers

    assert aside(ask)


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


SOURCES = [
    path
    for folder in (
        "mrl_driver",
        *(f"ros1_bridge/{layer}" for layer in ("control", "robot", "status", "topics")),
    )
    for path in sorted((ROOT / folder).rglob("*.py"))
    if path.name != "lock_order.py"
]


def made():
    """The names of the threads and of the locks that the driver and its node make."""
    threads, locks = set(), {*LOCKS}
    for path in SOURCES:
        for call in filter(lambda node: isinstance(node, ast.Call), ast.walk(ast.parse(path.read_text()))):
            kind, names = ast.unparse(call.func), {key.arg: key.value for key in call.keywords}
            assert kind not in ("threading.Lock", "threading.RLock"), f"{path} makes a lock without a name"
            if kind == "threading.Thread":
                threads.add(ast.literal_eval(names["name"]))
            elif kind.endswith("ThreadPoolExecutor"):
                threads.add(ast.literal_eval(call.args[1]))
            elif kind == "new_lock":
                locks.add(ast.literal_eval(call.args[0]))
    return threads, locks


def test_the_order_names_each_thread_and_lock_of_the_code():
    threads, locks = made()
    named = {
        name
        for entry in re.findall(r"^    ([a-z, -]+): ", lock_order.__doc__, re.M)
        for name in entry.split(", ")
    }
    assert locks == {*ORDER} and named == threads | locks


def test_no_event_is_waited_for_with_a_time_out():
    """Before Python 3.11 it follows the wall clock; `mrl_driver.clocks` does not."""
    for folder in ("mrl_driver", "ros1_bridge", "sim_arduino"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text()
            events = re.findall(r"(\w+) = threading\.Event\(|(\w+), self\.(\w+) = threading\.Event\(", text)
            names = "|".join(filter(None, (name for found in events for name in found)))
            assert "threading.Timer(" not in text, path
            assert not names or not re.search(rf"\b({names})\.wait\([^)]", text), path


def test_the_end_of_a_program_does_not_wait_for_what_comes_later():
    called = threading.Event()
    later(0.0, called.wait)
    assert [each.daemon for each in threading.enumerate() if each.name == "later"] == [True]
    called.set()
