"""Bumpers, cliff sensors and the emergency stop of a robot, on pins of an H-bridge board."""

from typing import Callable, Dict, Set

from mrl_driver.protocol.table import INPUTS, NOT_CONNECTED
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.wiring import of_board, reads_high


class StopInputs:
    """The switches that are connected: their names and pins.

    Attributes:
        touched: Returns the names of the bumpers that touch something.
        pressed: Those that are active by hand: bumpers, cliff sensors over an edge, the emergency stop.
        stuck: Those that stay active.
        open: Those with a broken wire, which its pull-up holds high.
    """

    def __init__(self, model: RobotModel) -> None:
        table = of_board(model.board)
        pins = {name: table[f"pin_{name}"] for name in INPUTS}
        self.pins: Dict[str, int] = {name: pin for name, pin in pins.items() if pin != NOT_CONNECTED}
        self._high = reads_high(table)
        self.touched: Callable[[], Set[str]] = set
        self.pressed: Set[str] = set()
        self.stuck: Set[str] = set()
        self.open: Set[str] = set()

    def levels(self) -> Dict[int, int]:
        """The levels of the pins now."""
        if not self.pins:
            return {}
        active = self.pressed | self.stuck | self.touched()
        return {
            pin: int(name in self.open or (name in active) == (name in self._high))
            for name, pin in self.pins.items()
        }
