"""Greetings of boards behind a line that damages bytes, both ways: part of `make fuzz`.

A greeting is wrong if the driver takes the board for another one, or leaves undone what the board can do.
"""

import multiprocessing
import os
from functools import partial
from typing import Any, List, NamedTuple, Tuple

import click

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import MrlError
from mrl_driver.robot import models
from sim_arduino.board import parameter_store
from sim_arduino.board.board2013 import Board2013
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.firmware.pc_board import PcBoard

BOOTED_S = 4.0
"""Any of the boards has ended its bootloader and its own start by then."""
FAULTS = ("loss:rate=0.001", "loss:rate=0.01", "change:rate=0.01")


def pc_board(plant: Plant) -> PcBoard:
    """The firmware, with TraxBot's id in its EEPROM."""
    return PcBoard(plant, bytes(parameter_store.image(parameter_store.defaults(TRAXBOT.ids[0]))))


TRAXBOT = models.load("traxbot")
BOARDS = {"pc": pc_board, "august": Board2013, "january": partial(Board2013, january=True)}


class Booted:
    """An engine whose time begins when its board has booted."""

    def __init__(self, engine: Any) -> None:
        self._engine = engine
        engine.advance(BOOTED_S)

    @property
    def next_event_s(self) -> float:
        """As the engine's, of this time."""
        return self._engine.next_event_s - BOOTED_S

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""
        self._engine.receive(data)

    def advance(self, to_s: float) -> bytes:
        """Run to this time; what the board has sent until then."""
        return self._engine.advance(to_s + BOOTED_S)


class Tally(NamedTuple):
    """What came of some greetings."""

    greetings: int
    wrong: int
    errors: Tuple[str, ...]
    """Words of those that ended with an error."""


def greet(name: str, faults: Tuple[str, ...], seed: int) -> Tuple[Any, ...]:
    """Greet a board of that name; who the driver says it is, and how it talks with it.

    Raises:
        MrlError: the driver gave up, or refused the board.
    """
    board: Any = BOARDS[name](Plant(TRAXBOT, World(), (0.0, 0.0, 0.0)))
    try:
        driver = SteppedDriver(Booted(FaultyEngine(board, faults, seed)))
        told = driver.connect()
        return driver.model.name, told.robot_id, told.version, told.protocol, told.capabilities
    finally:
        if isinstance(board, PcBoard):
            board.close()


def try_many(job: Tuple[str, str, range]) -> Tally:
    """Greet a board once for each seed, with a fault on the line."""
    name, fault, seeds = job
    right, wrong, errors = greet(name, (), 0), 0, []
    for seed in seeds:
        try:
            wrong += greet(name, (fault,), seed) != right
        except MrlError as error:
            errors.append(f"{type(error).__name__}: {error}")
    return Tally(len(seeds), wrong, tuple(errors))


def total(tallies: List[Tally]) -> Tally:
    """Their sum."""
    errors = tuple(words for tally in tallies for words in tally.errors)
    return Tally(sum(t.greetings for t in tallies), sum(t.wrong for t in tallies), errors)


@click.command()
@click.option("--board", type=click.Choice(list(BOARDS)), default="pc", show_default=True)
@click.option("--fault", "faults", multiple=True, default=FAULTS, show_default=True)
@click.option("--greetings", type=click.IntRange(1), default=3000, show_default=True)
@click.option("--seed", type=int, default=1, show_default=True)
def main(board: str, faults: Tuple[str, ...], greetings: int, seed: int) -> None:
    """Greet a board again and again on a bad line; exit code 1 if a session is wrong or ends with an error."""
    processes = os.cpu_count() or 1
    failed = False
    with multiprocessing.Pool(processes) as pool:
        for fault in faults:
            seeds = range(seed, seed + greetings)
            jobs = [(board, fault, seeds[i::processes]) for i in range(processes)]
            tally = total(pool.map(try_many, jobs))
            click.echo(
                f"{board} {fault}: {tally.greetings} greetings, {tally.wrong} wrong sessions, "
                f"{len(tally.errors)} errors"
            )
            for words in sorted(set(tally.errors)):
                click.echo(f"  {words}")
            failed = failed or bool(tally.wrong or tally.errors)
    if failed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
