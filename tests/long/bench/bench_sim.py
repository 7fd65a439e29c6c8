"""`make bench-sim`: what emulated boards cost, and how many a machine carries; build/bench/sim.json."""

import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any, Dict, List, Sequence, Tuple

import yaml

from mrl_driver.robot import models
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world_file import load
from tests.long.bench import processes, report

RUNS = report.either(5, 1)
WATCH_S = report.either(10.0, 1.0)
SETTLE_S = report.either(1.0, 0.3)
STEPPED_S, AVR_STEPPED_S = report.either((60.0, 10.0), (1.0, 0.3))
AVR_COUNTS, PYTHON_COUNTS = report.either((range(4, 41, 4), range(20, 241, 20)), ((2,), (2,)))
READ_S = 0.01
MIDDLE_M = 4.0  # Width of the square in the middle of the world in which the boards start
PROCESSES = 2
TRIES = 3
STEP_S = 0.02
ON_TIME = report.either(0.99, 0.5)
"""A board holds real time if it sends this share of the frames that are due, and its own clock is as far."""


def world_of_100_walls(folder: str, name: str = "walls.yaml") -> str:
    """A room of 8 x 8 m with 24 boxes around a free middle: 100 walls."""
    rng = random.Random(1)
    edge = [[-4, -4, 4, -4], [4, -4, 4, 4], [4, 4, -4, 4], [-4, 4, -4, -4]]
    boxes: List[List[float]] = []
    while len(boxes) < 24:
        x, y = rng.uniform(-3.5, 3.5), rng.uniform(-3.5, 3.5)
        if max(abs(x), abs(y)) > 2.6:
            boxes.append([x, y, 0.3, 0.2, rng.uniform(-90, 90)])
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as file:
        yaml.safe_dump({"walls": edge, "boxes": boxes}, file)
    return path


class Served:
    """Boards in a process of their own with a program that reads their streams."""

    def __init__(self, *options: str, count: int = 1) -> None:
        command = [sys.executable, "-m", "sim_arduino.serve.main", *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout
        paths = [self.process.stdout.readline().split()[-1] for _ in range(count)]
        self.frames = {os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK): 0 for path in paths}

    def cpu_s(self) -> float:
        """CPU time of its process so far [s]."""
        return processes.cpu_s(self.process.pid)

    def take(self) -> None:
        for fd in self.frames:
            try:
                self.frames[fd] += os.read(fd, 65536).count(b"e")
            except BlockingIOError:
                pass

    def close(self) -> None:
        for fd in self.frames:
            os.close(fd)
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate()


def watch(served: List[Served], seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        time.sleep(READ_S)
        for each in served:
            each.take()


def begin(served: List[Served], period_ms: int) -> None:
    """Has all boards drive a circle in the middle of the world and stream; none is fed, so the watchdog is off.

    A board whose process has just been held up drops old requests, so those that do not stream are asked again.
    """
    watch(served, SETTLE_S)
    for _ in range(TRIES):
        for each in served:
            for fd, frames in each.frames.items():
                if not frames:
                    os.write(fd, b"@11,150,600e@18,%de" % period_ms)
        watch(served, SETTLE_S)
    for each in served:
        each.frames = dict.fromkeys(each.frames, 0)


def cpu_percent(world: str) -> float:
    """CPU of one board's process at a stream of 50 frames a second [%]."""
    board = Served("--world", world)
    try:
        begin([board], 20)
        before_s, start_s = board.cpu_s(), time.monotonic()
        watch([board], WATCH_S)
        return 100.0 * (board.cpu_s() - before_s) / (time.monotonic() - start_s)
    finally:
        board.close()


def holds(count: int, processes: int, period_ms: int, *options: str) -> bool:
    """Whether so many boards, spread over so many processes, send their frames in time."""
    side = math.ceil(math.sqrt(count))
    spots = [MIDDLE_M * (each / (side - 1) - 0.5) if side > 1 else 0.0 for each in range(side)]
    robots = [("--name", f"r{i}", "--pose", f"{spots[i % side]},{spots[i // side]},0") for i in range(count)]
    served: List[Served] = []
    try:
        for part in (robots[i::processes] for i in range(processes)):
            served.append(Served(*(word for robot in part for word in robot), *options, count=len(part)))
        begin(served, period_ms)
        before_s, start_s = sum(each.cpu_s() for each in served), time.monotonic()
        watch(served, WATCH_S / 2)
        seconds = time.monotonic() - start_s
        due, least = seconds * 1000.0 / period_ms, min(n for each in served for n in each.frames.values())
        share = (sum(each.cpu_s() for each in served) - before_s) / seconds / count
        print(f"{count} boards: {share:.2%} CPU each, at least {least / due:.1%} of the frames", flush=True)
        return least >= ON_TIME * due - 1
    finally:
        for each in served:
            each.process.terminate()
        for each in served:
            each.close()


def most(counts: Sequence[int], processes: int, period_ms: int, *options: str) -> int:
    """The largest of rising counts of boards that hold real time; 0 if none does."""
    held = 0
    for count in counts:
        if not holds(count, processes, period_ms, *options):
            break
        held = count
    return held


def speedup(board: Any, seconds: float) -> float:
    """Times as fast as real time by the CPU's time, stepped by 20 ms with a 50 Hz stream, driving in circles."""
    board.advance(0.5)
    board.receive(b"@11,150,600e@18,20e")
    start_s, steps = time.process_time(), round(seconds / STEP_S)
    for i in range(steps):
        board.advance(0.5 + (i + 1) * STEP_S)
    return seconds / (time.process_time() - start_s)


def avr_figures(world: str) -> Tuple[float, float]:
    """`speedup` of the real image, and the share of the cycles in which its CPU is awake."""
    board = AvrEngine(Plant(models.load("traxbot"), load(world)), robot_id=1)
    chip = board.machine
    try:
        begun, awake = chip.cycle, chip.awake_cycles
        faster = speedup(board, AVR_STEPPED_S)
        return faster, (chip.awake_cycles - awake) / (chip.cycle - begun)
    finally:
        board.close()


def figures() -> Dict[str, report.Measured]:
    with tempfile.TemporaryDirectory() as folder:
        world = world_of_100_walls(folder)
        os.environ["XDG_RUNTIME_DIR"] = folder

        def stepped() -> float:
            return speedup(PythonBoard(Plant(models.load("traxbot"), load(world))), STEPPED_S)

        image = report.repeat("image", RUNS, lambda: avr_figures(world))
        team = ("--world", world, "--world-name", "bench")
        found: Dict[str, report.Measured] = {
            "python_stepped_speedup": report.repeat("Python board", RUNS, stepped),
            "avr_stepped_speedup": [faster for faster, _ in image],
            "awake_share_50hz": image[0][1],
            "python_board_cpu_percent_50hz": report.repeat("CPU", RUNS, lambda: cpu_percent(world)),
            "avr_boards_realtime": most(AVR_COUNTS, PROCESSES, 20, *team, "--engine", "avr"),
            "python_boards_realtime": most(PYTHON_COUNTS, PROCESSES, 50, *team),
        }
    return found
