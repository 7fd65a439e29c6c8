"""Writes a sequence of events as a recording, and plays it on the emulated boards and the simulated chip."""

from typing import NamedTuple, Optional

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.serve import factory

from .board import ExploredBoard
from .events import EVENTS, SPEED_M_S, happen
from .judge import STEP_S, Judge
from .world import World

AFTER_S = 0.5
"""A recording goes on for this long after the last event [s]."""
FAULTS = {"l": "to_board", "L": "to_board", "m": "to_host", "M": "to_host"}
"""The direction in which bytes are lost."""
PLAYABLE = "".join(("dzswWqP", *FAULTS))
"""The kinds of event that can be played on any board behind a line."""


def record(path: str, file: Optional[str], board: Optional[ExploredBoard] = None) -> str:
    """Let the events happen once more; return the property that is violated, or nothing.

    The recording has all bytes of both directions, as that of a driver on a port.
    """
    world, judge = World(board or ExploredBoard()), Judge()
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
    line = FaultyEngine(factory.make(factory.Options(robot="traxbot", engine=engine)).engine, (), 1)
    with SteppedDriver(line, options=Options(record=file)) as driver:
        driver.wait(0.4 - driver.now_s % STEP_S)
        for letter in path:
            seconds = EVENTS[letter].steps * STEP_S
            if letter in FAULTS:
                lasts = f"at=0,lasts={max(seconds, STEP_S):g},direction={FAULTS[letter]}"
                line.inject(f"loss:rate=1,burst=1024,{lasts}")
            if letter in "dq":
                driver.drive(SPEED_M_S, 0.0)
                driver.wait(run_up_s)
                driver.drive(SPEED_M_S, 0.0)
                run_up_s = 0.0
            if letter == "z":
                driver.drive(0.0, 0.0)
            if letter in "sq":
                driver.stop()
            if letter == "P":
                driver.pause(6 * STEP_S)
            driver.wait(seconds)
        line.clear()
        before_m = driver.pose.x_m
        driver.wait(AFTER_S)
        return Outcome(driver.pose.x_m - before_m, driver.stop_reason)
