"""Controls the faults of a running emulator by lines of text, and unplugs its port."""

import os
import select
from typing import Callable, List, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import INPUTS
from mrl_driver.yaml_file import short
from sim_arduino.faults.fault_kind import FOREVER_S
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant

from .socket_port import BoardPort

_LONGEST_LINE = 4096

ORDERS: Tuple[Tuple[str, str], ...] = (
    ("unplug [SECONDS]", "unplug the cable, for this time or until: plug"),
    ("plug", "plug the cable in again; the port gets another name"),
    ("reset", "press the reset button"),
    ("stall SECONDS", "hold back all bytes of both directions"),
    ("freeze SECONDS", "stop the board, but not the motor board"),
    ("press INPUT", "a bumper is hit, a cliff sensor sees no floor, or the emergency stop is pressed"),
    ("release INPUT", "the opposite"),
    ("fault FAULT", "add a fault, written as for --fault; its times count from now"),
    ("clear", "end all faults"),
)
"""The orders that `Control` understands, with a sentence for each."""


def obey(faults: FaultyEngine, order: str) -> None:
    """Carries out an order; raises ConfigError if the order is unknown, or its value is wrong."""
    word, _, rest = (part.strip() for part in order.strip().partition(" "))
    if word in ("plug", "reset", "clear") and not rest:
        {"plug": faults.plug, "reset": faults.reset, "clear": faults.clear}[word]()
    elif word in ("press", "release") and rest in INPUTS:
        _press(faults.plant, rest, word == "press")
    elif word == "fault":
        faults.inject(rest)
    elif word in ("stall", "freeze", "unplug") and (rest or word == "unplug"):
        faults.inject(f"{word}:at=0,lasts={rest or FOREVER_S}")
    else:
        expected = ", ".join(usage for usage, _ in ORDERS)
        raise ConfigError(f"order {short(order)} is unknown, expected one of: {expected}")


def _press(plant: Plant, name: str, on: bool) -> None:
    if not plant.bridge or name not in plant.bridge.inputs.pins:
        raise ConfigError(f"robot {plant.model.name} has no {name}; expected a robot's file with its pin")
    pressed = plant.bridge.inputs.pressed
    (pressed.add if on else pressed.discard)(name)


class Control:
    """Reads orders from the descriptor `fd`, if there is one, and plugs or unplugs a port as the faults require.

    `plugged` gets the port's new path after it is plugged in, and "" before it is unplugged; `report` gets a message if
    an order is wrong.
    """

    def __init__(
        self,
        faults: FaultyEngine,
        fd: Optional[int],
        plugged: Callable[[str], None],
        report: Callable[[str], None],
    ) -> None:
        self.fd = fd
        self._faults, self._plugged, self._report = faults, plugged, report
        self._rest = b""
        self._unplugs = 0  # those that the port has seen

    def attend(self, port: BoardPort) -> None:
        """Carries out the orders that have arrived, then plugs or unplugs `port`."""
        for line in self._lines():
            try:
                obey(self._faults, line)
            except ConfigError as error:
                self._report(str(error))
        if self._faults.unplugs != self._unplugs and port.plugged:  # perhaps it is plugged in again already
            self._plugged("")
            port.unplug()
        self._unplugs = self._faults.unplugs
        if self._faults.plugged and not port.plugged:
            port.plug()
            self._plugged(port.path)

    def _lines(self) -> List[str]:
        """The complete lines that have arrived; none after the other end is closed."""
        if self.fd is None or not select.select([self.fd], [], [], 0)[0]:
            return []
        data = os.read(self.fd, _LONGEST_LINE)
        if not data:
            self.fd = None
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-_LONGEST_LINE:]
        return [text for text in (line.decode("utf-8", "replace").strip() for line in lines) if text]
