"""An emulated robot on a pty in this process: what reached its motor board, and when, on the host's clock."""

import threading
import time
from typing import List, Optional

from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.robot.models import load
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import PtyServer
from sim_arduino.world.world import World
from tests.waiting import PATIENCE_S, wait_until

STOP, MOVE = 0xFC, 0xEB  # Registers of the motor board
DRIVE = (
    "import sys; from mrl_driver.driver import Driver, Options; "
    "d = Driver(sys.argv[1], options=Options(command_timeout_s=None)); d.connect(); d.drive(.2, 0); "
    "print(flush=True); d.wait(60)"
)
"""A program that drives the robot on a port, says so, and waits."""


class Emulator:
    """Serves until `close`."""

    def __init__(self, name: str = "traxbot", world: Optional[World] = None, imu: bool = False) -> None:
        self.plant = Plant(load(name), world, imu=imu)
        self._engine = PythonBoard(self.plant)
        self._port = PtyPort()
        self.path = self._port.path
        self._start_s = time.monotonic()
        self._server = PtyServer(self._engine, self._port, self.plant)
        self._thread = threading.Thread(target=self._server.run, daemon=True)
        self._thread.start()

    def times(self, code: int, since_s: float = 0.0) -> List[float]:
        """When the motor board was told so, on `time.monotonic()` [s]."""
        commands = list(self.plant.motor_board.commands)
        times = [self._start_s + command.time_s for command in commands if command.code == code]
        return [time_s for time_s in times if time_s >= since_s]

    def wait_for(self, code: int, since_s: float) -> float:
        """When the motor board was first told so since then [s]; waits for it."""
        return wait_until(lambda: self.times(code, since_s))[0]

    @property
    def moves(self) -> bool:
        """Some wheel turns."""
        return any(motor.speed != 0.0 for motor in self.plant.robot.motors)

    @property
    def stop_reason(self) -> str:
        """Why the board last stopped the motors."""
        return STOP_REASONS[self._engine.health.stop_reason]

    def close(self) -> None:
        """Unplugs it."""
        self._server.stop()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive(), "the emulator hangs"
        self._engine.close()
        self._port.close()
