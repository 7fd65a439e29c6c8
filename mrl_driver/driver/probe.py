"""Identify the board on a port.  Opening the port resets an Arduino Uno; the robot gets a stop and stays still."""

from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Iterable, Iterator, NamedTuple, Optional, Tuple, Union

from mrl_driver.errors import MrlError
from mrl_driver.protocol.table import BAUD
from mrl_driver.recording.recorded_link import RecordedLink
from mrl_driver.robot import models
from mrl_driver.robot.robot_state import without_motor_board
from mrl_driver.session.handshake import TIMEOUT_S, Board
from mrl_driver.transport.link import Link
from mrl_driver.transport.port_info import user_of

from .driver import Driver
from .options import Options

_ANY_MODEL = "traxbot"
_MOST_AT_ONCE = 16
# Time for the first answer of a board that opening the port does not reset [s]: less than five seconds for all boards.
# An emulated board of 2013 that is reset answers after 3.4 s.
RUNNING_S = 4.0


class Answer(NamedTuple):
    """The board found on a port."""

    robot_id: Optional[int] = None  # none if no robot answers
    model: str = ""  # packaged model that lists the robot id; empty if there is none
    firmware_version: Optional[int] = None
    battery_v: Optional[float] = None  # NaN if the board does not measure it
    capabilities: Tuple[str, ...] = ()
    error: str = ""  # why there is no answer; empty if there is one


def patience_s(resets: bool) -> float:
    """Time for a board's first answer [s].

    Opening a USB port resets its board, which first runs its boot loader; one of 2013 then needs up to 5.4 s.
    """
    return TIMEOUT_S if resets else RUNNING_S


class _Kept(RecordedLink):
    """A link that stays open when its driver is closed."""

    def close(self) -> None:
        """End a wait of `read` alone."""
        self.link.wake()


def board_on(port: Union[str, Link], baud: int = BAUD, wait_s: float = TIMEOUT_S) -> Board:
    """Return the board on a port or open link, which stays open; raise MrlError if none answers within `wait_s` [s]."""
    options = Options(ignore_battery=True, any_id=True, identify=True, greeting_s=wait_s)
    end = port if isinstance(port, str) else _Kept(port, lambda direction, data: None)
    with Driver(end, _ANY_MODEL, baud, options) as driver:
        return driver.board


def probe(port: str, baud: int = BAUD, wait_s: float = TIMEOUT_S) -> Answer:
    """Ask one port; takes up to `wait_s` [s] if nothing answers."""
    try:
        board = board_on(port, baud, wait_s)
        name = models.by_id(board.robot_id)
    except MrlError as error:
        return Answer(error=str(error))
    if name and not models.load(name).drives:
        board = without_motor_board(board)
    return Answer(board.robot_id, name, board.version, board.battery_v, tuple(sorted(board.capabilities)))


def probe_all(ports: Iterable[Tuple[str, int, float]]) -> Iterator[Tuple[str, Answer]]:
    """Ask several ports at the same time: name, baud rate, and time for the first answer [s].

    A port that a program has opened meanwhile is not opened: it may have waited for its turn.

    Yields the answers in order of arrival.
    """
    with ThreadPoolExecutor(_MOST_AT_ONCE, "probe") as pool:
        waiting = {pool.submit(_probe_unused, *each): each[0] for each in ports}
        for done in as_completed(waiting):
            yield waiting[done], done.result()


def _probe_unused(port: str, baud: int, wait_s: float) -> Answer:
    holder = user_of(port)
    return Answer(error=f"in use by {holder}") if holder else probe(port, baud, wait_s)
