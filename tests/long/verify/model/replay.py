"""Plays a sequence of events of the model on the real driver and an emulated board, in simulated time."""

import itertools
from typing import Iterable, List, NamedTuple, Tuple

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory

from .constants import TICK_MS

TICK_S = TICK_MS / 1000
SPEED_M_S = 0.2
TO_BOARD_LOST = ("the bytes to the board are lost", "the bytes of both directions are lost")
TO_HOST_LOST = ("telemetry is lost", "the bytes of both directions are lost")
PAUSED, DRIVE, STOP = "the host's process is paused", "drive", "stop"
KNOWN = {*TO_BOARD_LOST, *TO_HOST_LOST, PAUSED, DRIVE, STOP}


class Outcome(NamedTuple):
    """What the robot did after the events."""

    travel_m: float
    """Travel after the last event, while no new command was given."""
    stop_reason: str


class Line:
    """A board behind a line that loses bytes."""

    def __init__(self, board: factory.Emulated) -> None:
        self._engine = board.engine
        self.to_board = self.to_host = True

    @property
    def next_event_s(self) -> float:
        return self._engine.next_event_s

    def receive(self, data: bytes) -> None:
        if self.to_board:
            self._engine.receive(data)

    def advance(self, to_s: float) -> bytes:
        data = self._engine.advance(to_s)
        return data if self.to_host else b""


def events_of(trace: Iterable[str]) -> List[Tuple[int, str]]:
    """Return the events of `Result.trace` with their ticks, without the violated property at the end.

    Raises:
        ValueError: an event is not one that can be played.
    """
    events = []
    for line in trace:
        time, event = line.strip().split(" ms  ")
        if event.endswith("violated"):
            break
        if event not in KNOWN:
            raise ValueError(f"event {event!r} cannot be played, expected one of {sorted(KNOWN)}")
        events.append((int(time) // TICK_MS, event))
    return events


def play(
    events: List[Tuple[int, str]], start_s: float = 0.1, run_up_s: float = 0.3, quiet_s: float = 0.5
) -> Outcome:
    """Play the events; a pause of the host must be the last of them.

    What the phases of polls change depends on `start_s`.  The motors of the model turn at once, those of the robot do
    not: after `drive` it gets `run_up_s` to move.
    """
    line = Line(factory.make(factory.Options(robot="traxbot")))
    with SteppedDriver(line, options=Options(command_timeout_s=2.0)) as driver:
        driver.wait(start_s)
        tick, paused_s = 0, 0.0
        for when, group in itertools.groupby(events, key=lambda event: event[0]):
            if when > tick:
                driver.wait((when - tick) * TICK_S)
            now = [event for _, event in group]
            line.to_board, line.to_host = (
                not any(event in lost for event in now) for lost in (TO_BOARD_LOST, TO_HOST_LOST)
            )
            if DRIVE in now:
                driver.drive(SPEED_M_S, 0.0)
                driver.wait(run_up_s)
            if STOP in now:
                driver.stop()
            if PAUSED in now:
                paused_s += TICK_S
            else:
                driver.wait(TICK_S)
            line.to_board = line.to_host = True
            tick = when + 1
        if paused_s:  # it runs again in the tick after
            driver.pause(paused_s + TICK_S)
        before_m = driver.pose.x_m
        driver.wait(quiet_s)
        return Outcome(driver.pose.x_m - before_m, driver.stop_reason)
