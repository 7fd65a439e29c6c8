"""Greetings of boards behind a line that damages bytes, both ways: part of `make fuzz`.

A greeting is wrong if the driver takes the board for another one, or leaves undone what the board can do.  It must not
move the robot.  The figures go to build/bench/reliability.json.
"""

import multiprocessing
import sys
from typing import Any, Dict, NamedTuple, Tuple

from mrl_driver.driver.options import Options
from mrl_driver.errors import MrlError
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel
from sim_arduino.board import PythonBoard, parameter_store
from sim_arduino.board.board2013 import Board2013
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.firmware.pc_board import BRIDGE, SONARS, PcBoard
from tests.long.bench import report
from tests.long.soak.simulated import SoakDriver

BOOTED_S, BOOTED_2013_S = 0.2, 4.0
"""The board has ended its start by then, one of 2013 also its bootloader [s]."""
MOTION_S = 0.5  # A motor that a greeting has turned is seen turning within this time after it [s]
KINDS = ("loss", "flip", "change", "swap")
"""Bytes are lost, get a wrong bit, are replaced, and change places with the next one."""
RATES = (0.001, 0.01)
GREETINGS = report.either(3000, 2)  # Of each board on each line


class Kind(NamedTuple):
    """A kind of board: the robot that has it, and how long it starts."""

    engine: Any  # Makes the board of a plant with these parameters in its EEPROM
    model: str = "traxbot"
    booted_s: float = BOOTED_S


def pc_board(plant: Plant, eeprom: bytes) -> Any:
    return PcBoard(plant, eeprom, BRIDGE if plant.bridge else SONARS)


BOARDS = {
    "pc": Kind(pc_board),
    "bridge": Kind(pc_board, "duo"),
    "python": Kind(lambda plant, eeprom: PythonBoard(plant, eeprom=bytearray(eeprom))),
    "august": Kind(lambda plant, _: Board2013(plant), booted_s=BOOTED_2013_S),
    "january": Kind(lambda plant, _: Board2013(plant, january=True), booted_s=BOOTED_2013_S),
}
TRIED = ("pc", "bridge", "august", "january")  # In the long run; the others are emulated like these


def eeprom_of(robot: RobotModel, plain_calibrate: bool) -> bytes:
    values = parameter_store.first(robot.ids[0], robot)
    values[PARAMETER_BY_NAME["plain_calibrate"].number] = int(plain_calibrate)
    return parameter_store.image(values)


class Outcome(NamedTuple):
    """What came of a greeting."""

    session: Tuple[Any, ...] = ()  # Who the driver says the board is, and how it talks with it
    error: str = ""  # Why it gave up
    moved: bool = False  # The robot has moved


class Tally(NamedTuple):
    """What came of some greetings."""

    greetings: int
    wrong: int
    moved: Tuple[int, ...]  # Seeds of those that moved the robot
    errors: Tuple[str, ...]  # Words of those that ended with an error


def greet(name: str, faults: Tuple[str, ...], seed: int, plain_calibrate: bool = False) -> Outcome:
    """Greet a board of that name on a line with these faults; `plain_calibrate` sets the parameter."""
    kind = BOARDS[name]
    robot = models.load(kind.model)
    plant = Plant(robot, World(), (0.0, 0.0, 0.0))
    board = kind.engine(plant, eeprom_of(robot, plain_calibrate))
    try:
        line = FaultyEngine(board, faults, seed)
        line.advance(kind.booted_s)
        driver = SoakDriver(line, Options())
        session, error = (), ""
        try:
            told = driver.connect()
            session = driver.model.name, told.robot_id, told.version, told.protocol, told.capabilities
        except MrlError as failure:
            error = f"{type(failure).__name__}: {failure}"
        start = plant.true_pose
        line.advance(driver.now_s + MOTION_S)
        moved = plant.true_pose != start or start != (0.0, 0.0, 0.0)
        return Outcome(session, error, moved)
    finally:
        if isinstance(board, PcBoard):
            board.close()


def faults_of(rate: float) -> Tuple[str, ...]:
    return tuple(f"{kind}:rate={rate / len(KINDS)}" for kind in KINDS)


def tally_of(name: str, found: Dict[int, Outcome]) -> Tally:
    """What came of greetings of a board, by seed."""
    right = greet(name, (), 0).session
    return Tally(
        len(found),
        sum(not each.error and each.session != right for each in found.values()),
        tuple(seed for seed, each in found.items() if each.moved),
        tuple(each.error for each in found.values() if each.error),
    )


def main() -> int:
    """Greet boards on bad lines; 1 if a session is wrong, ends with an error, or moves a robot."""
    figures: Dict[str, int] = {}
    failed, seeds = False, range(1, GREETINGS + 1)
    with multiprocessing.Pool() as pool:
        for board in TRIED:
            kind = "_2013" if BOARDS[board].booted_s == BOOTED_2013_S else ""
            for rate in RATES:
                jobs = [(board, faults_of(rate), seed) for seed in seeds]
                tally = tally_of(board, dict(zip(seeds, pool.starmap(greet, jobs))))
                failed = failed or bool(tally.wrong or tally.moved or tally.errors)
                for key, count in (("tried", tally.greetings), ("moved", len(tally.moved))):
                    figures[f"greetings{kind}_{key}"] = figures.get(f"greetings{kind}_{key}", 0) + count
                print(
                    f"{board}, {rate:.1%} of the bytes damaged: {tally.greetings} greetings, {tally.wrong} wrong "
                    f"sessions, {len(tally.errors)} errors; seeds that moved the robot: {tally.moved or 'none'}"
                )
                print("".join(f"  {words}\n" for words in sorted(set(tally.errors))), end="")
    return report.conclude("reliability", figures) or failed


if __name__ == "__main__":
    sys.exit(main())
