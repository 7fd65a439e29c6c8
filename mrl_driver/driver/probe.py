"""Identify the board on a port.  Opening the port resets an Arduino Uno; the robot gets a stop and stays still."""

from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Iterable, Iterator, NamedTuple, Optional, Tuple

from mrl_driver.errors import MrlError
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot import models
from mrl_driver.robot.robot_state import without_motor_board

from .driver import Driver
from .options import Options

_ANY_MODEL = "traxbot"
_MOST_AT_ONCE = 16


class Answer(NamedTuple):
    """The board found on a port."""

    robot_id: Optional[int] = None
    """None if no robot answers."""
    model: str = ""
    """Packaged model that lists the robot id; empty if there is none."""
    firmware_version: Optional[int] = None
    battery_v: Optional[float] = None
    """NaN if the board does not measure it."""
    capabilities: Tuple[str, ...] = ()
    error: str = ""
    """Why there is no answer; empty if there is one."""


def probe(port: str, baud: int = BAUD) -> Answer:
    """Ask one port; takes up to 8 s if nothing answers."""
    try:
        with Driver(
            port, _ANY_MODEL, baud, Options(ignore_battery=True, any_id=True, identify=True)
        ) as driver:
            board = driver.board
    except MrlError as error:
        return Answer(error=str(error))
    name = models.by_id(board.robot_id)
    if name and not models.load(name).drives:
        board = without_motor_board(board)
    return Answer(
        board.robot_id,
        name,
        board.version,
        board.battery_v,
        tuple(sorted(board.capabilities)),
    )


def probe_all(ports: Iterable[Tuple[str, int]]) -> Iterator[Tuple[str, Answer]]:
    """Ask several ports at the same time, each at its baud rate; yield the answers in order of arrival."""
    with ThreadPoolExecutor(_MOST_AT_ONCE) as pool:
        waiting = {pool.submit(probe, port, baud): port for port, baud in ports}
        for done in as_completed(waiting):
            yield waiting[done], done.result()
