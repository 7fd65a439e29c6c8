"""Writes a sequence of events as a recording, and plays it on the emulated boards and the simulated chip."""

from typing import NamedTuple, Optional

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory
from tests.long.verify.model.replay import Line

from .board import ExploredBoard
from .events import EVENTS, SPEED_M_S, happen
from .judge import STEP_S, Judge
from .world import DAMAGE, World

AFTER_S = 0.5
"""A recording goes on for this long after the last event [s]."""
PLAYABLE = "dzswWqlmyLMXP"
"""The kinds of event that can be played on any board behind a line."""


def record(path: str, file: Optional[str], strict: bool, board: Optional[ExploredBoard] = None) -> str:
    """Let the events happen once more; return the property that is violated, or nothing.

    The recording has all bytes of both directions, as that of a driver on a port.
    """
    world, judge = World(board or ExploredBoard()), Judge(strict)
    world.begin(file)
    judge.settle(world)
    broken = ""
    for letter in path:
        world.driver._remark(f"event {EVENTS[letter].name}".encode())
        broken = broken or happen(world, judge, letter)
    if broken:
        world.driver._remark(f"violated {broken}".encode())
    world.run(AFTER_S)
    world.ports.end_recording()
    world.end()
    return broken


class Outcome(NamedTuple):
    """What the robot did."""

    travel_m: float
    """Travel by the counters, after the last event."""
    stop_reason: str


class FaultyLine(Line):
    """A board behind a line that also damages and repeats bytes."""

    damaged = twice = False

    def receive(self, data: bytes) -> None:
        """As an engine."""
        super().receive(data.translate(DAMAGE) if self.damaged else data)
        if self.twice:
            super().receive(data)


def play_on(engine: str, path: str, run_up_s: float = 0.3, file: Optional[str] = None) -> Outcome:
    """Play the events on an emulated robot: `python`, or `avr` for the image on the simulated chip.

    Its motors need time to speed up, so after the first `drive` the user drives on for `run_up_s`.

    Raises:
        ValueError: an event cannot be played there.
    """
    foreign = set(path) - set(PLAYABLE)
    if foreign:
        raise ValueError(
            f"events {''.join(sorted(foreign))} cannot be played on {engine}, expected {PLAYABLE}"
        )
    line = FaultyLine(factory.make(factory.Options(robot="traxbot", engine=engine)))
    with SteppedDriver(line, options=Options(record=file)) as driver:
        driver.wait(0.4 - driver.now_s % STEP_S)
        faults: dict = {}
        for letter in path:
            steps = EVENTS[letter].steps
            if letter in "lmyLMX":
                kind = {
                    "l": "to_board",
                    "L": "to_board",
                    "m": "to_host",
                    "M": "to_host",
                    "y": "twice",
                    "X": "damaged",
                }
                faults[kind[letter]] = driver.now_s + max(1, steps) * STEP_S
            if letter in "dq":
                if run_up_s:
                    driver.drive(SPEED_M_S, 0.0)
                    driver.wait(run_up_s)
                    run_up_s = 0.0
                driver.drive(SPEED_M_S, 0.0)
            if letter == "z":
                driver.drive(0.0, 0.0)
            if letter in "sq":
                driver.stop()
            if letter == "P":
                driver.pause(6 * STEP_S)
            for _ in range(steps):
                line.to_board, line.to_host = (
                    driver.now_s >= faults.get(name, 0.0) - 1e-9 for name in ("to_board", "to_host")
                )
                line.twice, line.damaged = (
                    driver.now_s < faults.get(name, 0.0) - 1e-9 for name in ("twice", "damaged")
                )
                driver.wait(STEP_S)
        line.to_board = line.to_host = True
        line.twice = line.damaged = False
        before_m = driver.pose.x_m
        driver.wait(AFTER_S)
        return Outcome(driver.pose.x_m - before_m, driver.stop_reason)
