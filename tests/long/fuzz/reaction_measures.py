"""What `reactions` measures, each so many times over; all on emulated robots in real time."""

import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from typing import Any, Callable, Dict, Iterator, List, Tuple
from unittest import mock

from mrl_driver.driver import Driver, Options
from mrl_driver.driver.robot_core import Core
from mrl_driver.session.events import Lost, Reconnected, Stale
from mrl_driver.session.session import Session
from tests.driver import test_own_stop
from tests.driver.conftest import PtyBoard
from tests.driver.emulator import DRIVE, MOVE, STOP, Emulator
from tests.driver.test_clock import run as jittered
from tests.fake_board import FakeBoard
from tests.long.bench import processes, report
from tests.long.fuzz import faulty_robot
from tests.waiting import PATIENCE_S, wait_until

_WHOLE = re.compile(rb"\d+(,-?\d+)*e")
_BEGINNING = re.compile(rb"[\d,-]*")
TIMEOUT_S = 0.25


def time_of(condition: Callable[[], bool]) -> float:
    """When it came true, on `time.monotonic()` [s]."""
    wait_until(condition, step_s=0.001)
    return time.monotonic()


@contextmanager
def emulator() -> Iterator[Emulator]:
    robot = Emulator()
    try:
        yield robot
    finally:
        robot.close()


@contextmanager
def mrl_sim(*args: str) -> Iterator[Tuple[subprocess.Popen, str]]:
    """A robot in a process of its own, and its port."""
    command = [sys.executable, "-m", "sim_arduino.serve.main", *args]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout.readline().split()[0]
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()


def _reaction(robot: Emulator, since_s: float) -> float:
    return 1000 * (robot.wait_for(STOP, since_s) - since_s)


def host_dead(count: int) -> Dict[str, float]:
    """kill -9 of a program that drives, to the stop at the motor board."""
    times: List[float] = []
    with emulator() as robot:
        for _ in range(count):
            begun_s = time.monotonic()
            with subprocess.Popen(
                [sys.executable, "-c", DRIVE, robot.path], stdout=subprocess.PIPE
            ) as process:
                robot.wait_for(MOVE, begun_s)
                time.sleep(random.uniform(0.2, 0.4))
                process.kill()
                times.append(_reaction(robot, time.monotonic()))
    return {"stop_host_dead_ms_max": max(times)}


def source_dead(count: int) -> Dict[str, float]:
    """The last command to the stop at the motor board, with a timeout of 250 ms."""
    times: List[float] = []
    with emulator() as robot, Driver(robot.path, options=Options(command_timeout_s=TIMEOUT_S)) as driver:
        for _ in range(count):
            for _ in range(random.randint(2, 20)):
                driver.drive(0.2, 0.0)
                last_s = time.monotonic()
                time.sleep(0.02)
            times.append(_reaction(robot, last_s))
    return {"stop_cmd_source_dead_ms_max": max(times)}


def unplugged(count: int) -> Dict[str, float]:
    """An unplugged cable to the event `Lost`; the cable plugged in to telemetry under another name."""
    noticed: List[float] = []
    back: List[float] = []
    with tempfile.TemporaryDirectory() as folder, mrl_sim("--link", f"{folder}/robot", "--control") as (
        sim,
        _,
    ), Driver(f"{folder}/robot", options=Options(reconnect=True)) as driver:
        heard: List[type] = []
        driver.on_event(lambda event: heard.append(type(event)))
        for _ in range(count):
            heard.clear()
            begun_s = _order(sim, "unplug")
            noticed.append(1000 * (time_of(lambda: Lost in heard) - begun_s))
            time.sleep(random.uniform(0.05, 1.0))
            begun_s = _order(sim, "plug")
            back.append(time_of(lambda: Reconnected in heard) - begun_s)
            assert driver.command is None
    return {"link_loss_noticed_ms_max": max(noticed), "reconnect_s_max": max(back)}


def _order(sim: subprocess.Popen, order: str) -> float:
    assert sim.stdin is not None
    begun_s = time.monotonic()
    sim.stdin.write(order + "\n")
    sim.stdin.flush()
    return begun_s


def silent(count: int) -> Dict[str, float]:
    """SIGSTOP of the board to the event `Stale`."""
    times: List[float] = []
    with mrl_sim() as (sim, port), Driver(port) as driver:
        heard: List[type] = []
        driver.on_event(lambda event: heard.append(type(event)))
        for _ in range(count):
            heard.clear()
            sim.send_signal(signal.SIGSTOP)
            begun_s = time.monotonic()
            times.append(1000 * (time_of(lambda: Stale in heard) - begun_s))
            sim.send_signal(signal.SIGCONT)
            wait_until(lambda: driver.ready)
            time.sleep(random.uniform(0.1, 0.2))
    return {"silent_noticed_ms_max": max(times)}


def late_moves(count: int) -> Dict[str, float]:
    """What a move that arrives after its confirmed stop does, in phases of the telemetry and in simulated time.

    How long the motors of an OMNI-3MD are driven [ms], how far a robot with an H-bridge goes [mm]; and the same with a
    driver that does not stop the robot again, the control.
    """

    def most(motors: str, measure: Callable[[Any], float]) -> float:
        values = []
        for period_ms in test_own_stop.PERIODS_MS[: report.either(None, 1)]:
            for phase in range(-(-count // len(test_own_stop.PERIODS_MS))):
                robot = test_own_stop.stopped(period_ms, motors, after_s=1.0 + 0.0013 * phase)
                values.append(1000 * measure(robot))
                test_own_stop.close(robot)
        return max(values)

    def both(kind: str) -> Dict[str, float]:
        return {
            f"late_move_{kind}ms_max": most("omni3md", test_own_stop.driven_s),
            f"late_move_{kind}mm_max": most("bridge", test_own_stop.way_m),
        }

    with mock.patch.object(Session, "_on_uncommanded_motion", lambda self, now: None):
        control = both("control_")
    return {**both(""), **control}


def stalls(_: int) -> Dict[str, float]:
    """Share of the time in which blocked motors of a robot with an H-bridge are driven [%]; the same, the control, with
    a driver that does not refuse commands after the board's own stop.  Simulated time.
    """

    def percent() -> float:
        robot = test_own_stop.commanded_robot(motors="bridge")
        share = test_own_stop.stalled_share(robot)
        test_own_stop.close(robot)
        return 100 * share

    with mock.patch.object(Core, "_on_own_stop", lambda self, reason: []):
        control = percent()
    return {"stalled_percent": percent(), "stalled_percent_control": control}


def jumps(count: int) -> Dict[str, float]:
    """Steps of the pose beyond what the wheels can do, over links with random faults; stepped time."""
    farthest_m = max(faulty_robot.drive(seed, 5.0)[0].jump_m for seed in range(count))
    return {"odometry_jump_mm_max": 1000 * max(0.0, farthest_m)}


def stamps(count: int) -> Dict[str, float]:
    """Error of stamps under 0 to 16 ms of USB jitter, after 10 s; simulated time."""
    errors: List[float] = []
    for seed in range(count):
        drift = random.Random(seed).uniform(-0.005, 0.005)
        errors += [abs(stamp_s - true_s) for true_s, stamp_s, _ in list(jittered(seed, drift, 40))[500:]]
    return {"stamp_error_ms_p99": 1000 * sorted(errors)[int(0.99 * len(errors))]}


def signals(count: int) -> Dict[str, float]:
    """Ctrl-C and SIGTERM in turn at `mrl drive`: to the stop at the motor board, and to its exit."""
    stops: List[float] = []
    exits: List[float] = []
    with emulator() as robot:
        for i in range(count):
            command = ["drive", "--port", robot.path, "--linear", "0.2", "--for", "60"]
            begun_s = time.monotonic()
            with subprocess.Popen(
                [sys.executable, "-m", "mrl_driver", *command], stderr=subprocess.DEVNULL
            ) as process:
                robot.wait_for(MOVE, begun_s)
                time.sleep(random.uniform(0.0, 0.2))
                sent_s = time.monotonic()
                process.send_signal((signal.SIGINT, signal.SIGTERM)[i % 2])
                stops.append(_reaction(robot, sent_s))
                process.wait(PATIENCE_S)
                exits.append(1000 * (time.monotonic() - sent_s))
    return {"signal_stop_ms_max": max(stops), "signal_exit_ms_max": max(exits)}


def threads(count: int) -> Dict[str, float]:
    """Two threads that command at once: pieces of `count` or more frames that arrive at the board mixed."""
    board = PtyBoard(FakeBoard())
    try:
        with Driver(board.path) as driver:
            end = threading.Event()

            def hammer(speed: float) -> None:
                while not end.is_set():
                    driver.drive(speed, 0.0)
                    driver.request(30)

            workers = [threading.Thread(target=hammer, args=(speed,)) for speed in (0.1, -0.1)]
            for worker in workers:
                worker.start()
            while board.received.count(b"e") < count:
                time.sleep(0.2)
            end.set()
            for worker in workers:
                worker.join()
            blocked = driver.link.statistics.blocked_writes
    finally:
        board.close()
    whole, mixed = sorted_out(bytes(board.received), blocked)
    return {"interleaved_frames": mixed, "frames_of_two_threads": whole}


def sorted_out(received: bytes, blocked: int) -> Tuple[int, int]:
    """How many frames are whole, and how many pieces are mixed.

    A write that the port did not take within 100 ms (`blocked` so often) leaves the beginning of a frame, and the next
    frame begins with its '@'; bytes behind an 'e' are of a frame that another one has cut in two.
    """
    pieces = received.split(b"@")
    whole = sum(_WHOLE.fullmatch(piece) is not None for piece in pieces[1:])
    cut_short = sum(_BEGINNING.fullmatch(piece) is not None for piece in pieces[1:-1])
    odd = len(pieces[1:-1]) - sum(map(bool, map(_WHOLE.fullmatch, pieces[1:-1]))) - cut_short
    return whole, odd + bool(pieces[0]) + max(0, cut_short - blocked)


def closes(count: int) -> Dict[str, float]:
    """Closing a driver while it reads, and opening the port again."""
    times: List[float] = []
    with emulator() as robot:
        for _ in range(count):
            driver = Driver(robot.path)
            driver.connect()
            begun_s = time.monotonic()
            driver.close()
            times.append(1000 * (time.monotonic() - begun_s))
    return {"close_ms_max": max(times), "closes": count}


def long_drive(minutes: float) -> Dict[str, float]:
    """Driving about at 100 frames a second: growth of this process's memory, and frames that were lost."""
    with mrl_sim() as (_, port), Driver(port, options=Options(period_ms=10)) as driver:
        rng = random.Random(0)
        _drive(driver, rng, report.either(5.0, 0.5))
        before_mb, end_s = 1.048576 * processes.rss_mib(), time.monotonic() + minutes * 60
        while time.monotonic() < end_s:
            _drive(driver, rng, 1.0)
        counters = driver.link.statistics
        growth_mb = 1.048576 * processes.rss_mib() - before_mb
        lost = counters.lost + counters.duplicates + counters.refused_counts + sum(counters.garbage.values())
    return {
        "soak_minutes": minutes,
        "soak_memory_growth_mb": growth_mb,
        "soak_lost_frames": lost,
        "soak_frames": counters.frames,
    }


def _drive(driver: Driver, rng: random.Random, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        driver.drive(rng.uniform(-0.2, 0.2), rng.uniform(-1.0, 1.0))
        time.sleep(0.05)
