"""An emulated robot in this process, and the truth about its wheels."""

import threading
import time

from mrl_driver.robot.models import load
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve.pty import PtyPort, SymbolicLink
from sim_arduino.serve.server import PtyServer
from sim_arduino.world.world import World
from tests.waiting import PATIENCE_S

from .truth import ON_THE_WAY_S, Truth, Window, judge

LATE_S = 0.02  # A look at the clock that is later than asked by so much means that the computer was busy [s]


class Server(PtyServer):
    """Can be deaf: bytes of the host then wait in the port, until it blocks.  Notes when it was held up itself."""

    deaf = False
    latest_s = 0.0  # The longest time by which the computer ran a round of it late, since it was set to 0

    def _link_ready(self) -> bool:
        return not self.deaf and super()._link_ready()

    def step(self) -> None:
        if self.due_s:
            self.latest_s = max(self.latest_s, time.monotonic() - self.due_s)
        super().step()

    def _plan(self) -> None:
        super()._plan()
        if self.deaf:
            self.due_s = max(self.due_s, time.monotonic() + 0.005)


class SoakRobot:
    """A TraxBot behind `link`, a symbolic link to its port.  Times are on `time.monotonic` [s]."""

    def __init__(self, link: str) -> None:
        self.plant = Plant(load("traxbot"), World(), (0.0, 0.0, 0.0))
        self.truth = Truth(self.plant)
        self.engine = PythonBoard(self.plant)
        self.link = link
        self._port = PtyPort()
        self._link = SymbolicLink(link, self._port.path)
        self.start_s = time.monotonic()
        self.server = Server(self.engine, self._port, self.plant)
        self._thread = threading.Thread(target=self.server.run, daemon=True, name="soak robot")
        self._thread.start()

    def mend(self) -> None:
        with self.server.lock:
            self.server.deaf = False
        self.server.wake()

    @property
    def driven(self) -> bool:
        return self.truth.driven

    def judge(self, from_s: float, to_s: float, late_s: float = 0.0) -> Window:
        """Judge a time in which no new command may move the robot; the last one may reach it later by so much."""
        with self.server.lock:
            return judge(self.truth, from_s - self.start_s, to_s - self.start_s, ON_THE_WAY_S + late_s)

    def close(self) -> None:
        self.server.stop()
        self._thread.join(PATIENCE_S)
        self._link.remove()
        self._port.close()
