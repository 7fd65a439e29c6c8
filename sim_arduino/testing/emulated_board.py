"""Emulated boards for tests: a board on a pty, served by a thread of the test's own process.

    with EmulatedBoard(robot="traxbot", world="l-course") as board:
        ...                                     # open board.port with the program under test
        board.motors.assert_commanded("move_differential")
        board.wait_until(lambda: board.true_pose.x_m > 0.5)

`pytest_plugin` makes fixtures of it; with unittest, use the class directly.
"""

import threading
import time
from collections import deque
from functools import wraps
from typing import Any, Callable, ContextManager, List, Optional, TypeVar, Union, cast

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.omni3md import MotorCommand
from sim_arduino.serve import factory
from sim_arduino.serve.control import Control
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import PtyServer
from sim_arduino.serve.socket_port import BoardPort, SocketPort
from sim_arduino.world.world import World

PATIENCE_S = 5.0
POLL_S = 0.005
COMMANDS = {
    "stop": 0xFC,
    "calibrate": 0xFB,
    "move_omni": 0xFA,
    "move_motors_pid": 0xF8,
    "move_motors": 0xF7,
    "set_gains": 0xF4,
    "set_timeout": 0xF1,
    "set_prescaler": 0xF0,
    "preset_encoder": 0xEF,
    "move_to_position": 0xEE,
    "set_ramp": 0xEC,
    "move_differential": 0xEB,
    "set_geometry": 0xEA,
}
"""The motor board's commands by name, and the register of each."""
_STILL_M_S = 0.005
_Method = TypeVar("_Method", bound=Callable[..., None])


def wait_until(condition: Callable[[], bool], timeout_s: float, what: Callable[[], str]) -> None:
    """Wait until a condition is true; AssertionError, which says what was not, after `timeout_s` [s, real time]."""
    end_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end_s:
            raise AssertionError(f"not within {timeout_s:g} s: {what()}")
        time.sleep(POLL_S)


class EmulatedBoard(ContextManager["EmulatedBoard"]):
    """A board on a virtual serial port; a context manager.

    An error that ends the board is raised by the next look at it, or else by `close`.

    Args:
        world: A world, or the name of a packaged one, or the path of a world file or map.
        speed: Factor over real time.
        listen: URL to serve instead of a pty, such as `udp://127.0.0.1:0`.
        options: Other options of `mrl-sim`, with the names in `factory.Options`.

    Attributes:
        plant: Robot, sensors and motor board, see `wiring.Plant`.  Hold `lock` if values must be of the same moment.
        faults: Injects faults, see `Faults`.
        motors: Commands that reached the motor board, see `Motors`.

    Raises:
        ConfigError: an option is unknown or out of range.
    """

    def __init__(
        self,
        world: Union[World, str] = "room",
        speed: float = 1.0,
        listen: Optional[str] = None,
        **options: Any,
    ) -> None:
        unknown = set(options) - set(factory.Options._fields)
        if unknown:
            raise ConfigError(
                f"option {sorted(unknown)[0]!r} is unknown, expected {', '.join(factory.Options._fields)}"
            )
        self._robot = factory.make(factory.Options(world=world, **options))
        self.plant = self._robot.plant
        if not self.plant.bridge:
            self.plant.motor_board.commands = deque()  # all of them: what must not have come may be long ago
        self._port: BoardPort = SocketPort(listen) if listen else PtyPort()
        control = Control(self._robot.board, None, lambda path: None, lambda text: None)
        self._server = PtyServer(self._robot.board, self._port, self.plant, control=control, speed=speed)
        self.faults = Faults(self, self._robot.board, self._server)
        self.motors = Motors(self)
        self._failure: Optional[BaseException] = None
        self._told = False  # whether the failure has been raised
        self._thread = threading.Thread(target=self._serve, name="emulated-board", daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        try:
            self._server.run()
        except BaseException as error:  # noqa: BLE001 - it is raised in the test's own thread
            self._failure = error

    def _require_running(self) -> None:
        if self._failure is not None:
            self._told = True
            raise self._failure

    @property
    def lock(self) -> ContextManager[Any]:
        """Held while the board runs; raises the error that has ended the board."""
        self._require_running()
        return self._server.lock

    @property
    def port(self) -> str:
        """Device name of the port; it changes when the port is unplugged and plugged in again."""
        return self._port.path

    @property
    def world(self) -> World:
        """The world the robot is in."""
        return self.plant.world

    @property
    def true_pose(self) -> Pose:
        """True pose of the robot: metres, and radians in -pi..pi."""
        with self.lock:
            return self.plant.true_pose

    @property
    def true_speed_m_s(self) -> float:
        """True speed of the fastest wheel [m/s]."""
        with self.lock:
            robot = self.plant.robot
            return max(abs(motor.speed) * metres for motor, metres in zip(robot.motors, robot.m_per_count))

    def wait_until(
        self, condition: Callable[[], bool], timeout_s: float = PATIENCE_S, what: str = ""
    ) -> None:
        """Waits until a condition is true; AssertionError if it is not within `timeout_s` [s, real time]."""

        def holds() -> bool:
            self._require_running()
            return condition()

        def where() -> str:
            pose = self.true_pose
            return (
                f"{what or 'the condition'}; the robot is at x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, "
                f"yaw {pose.yaw_rad:.3f} rad, its last commands: {self.motors.last(3)}"
            )

        wait_until(holds, timeout_s, where)

    def close(self) -> None:
        """Unplugs the port and ends the thread; raises the error that has ended the board if nothing has yet."""
        self._server.stop()
        self._thread.join()
        self._port.close()
        self._robot.close()
        if not self._told:
            self._require_running()

    def __exit__(self, kind: object, *_: object) -> None:
        """Closes the board; an error of the block comes before one of the board."""
        self._told = self._told or kind is not None
        self.close()


def _held(method: _Method) -> _Method:
    """A method of the engine, called while the board is held; then the board runs to now."""

    @wraps(method)
    def call(faults: "Faults", *args: Any, **options: Any) -> None:
        with faults.emulated.lock:
            method(faults.board, *args, **options)
        faults.server.wake()

    return cast(_Method, call)


class Faults:
    """Injects faults into a running board, as `FaultyEngine` does; their times count from now."""

    def __init__(self, emulated: EmulatedBoard, board: FaultyEngine, server: PtyServer) -> None:
        self.emulated, self.board, self.server = emulated, board, server

    inject, clear = _held(FaultyEngine.inject), _held(FaultyEngine.clear)
    unplug, plug = _held(FaultyEngine.unplug), _held(FaultyEngine.plug)
    freeze, stall, reset = _held(FaultyEngine.freeze), _held(FaultyEngine.stall), _held(FaultyEngine.reset)


class Motors:
    """The commands that reached the motor board, and assertions on them."""

    def __init__(self, board: EmulatedBoard) -> None:
        self._board = board

    def commands(self, name: str = "") -> List[MotorCommand]:
        """Commands since the start or the last `forget`, oldest first: all, or those with a name of `COMMANDS`.

        ConfigError if the name is unknown, as in the assertions.
        """
        if name and name not in COMMANDS:
            raise ConfigError(f"command {name!r} is unknown, expected {', '.join(COMMANDS)}")
        with self._board.lock:
            found = list(self._board.plant.motor_board.commands)
        return [command for command in found if not name or command.code == COMMANDS[name]]

    def forget(self) -> None:
        """Forgets the commands so far: `commands` and assertions begin again."""
        with self._board.lock:
            self._board.plant.motor_board.commands.clear()

    def last(self, count: int = 1) -> str:
        """The last commands as text."""
        names = {code: name for name, code in COMMANDS.items()}
        said = [f"{names[c.code]}{c.values} at {c.time_s:.3f} s" for c in self.commands()[-count:]]
        return ", ".join(said) or "none"

    def assert_commanded(self, name: str, *values: int, within_s: float = PATIENCE_S) -> None:
        """Asserts that a command with this name, and these values if given, has come or comes within a time."""

        def came() -> bool:
            return any(not values or each.values == values for each in self.commands(name))

        self._board.wait_until(came, within_s, f"command {name}{values or ''}")

    def assert_not_commanded(self, name: str, *values: int) -> None:
        """Asserts that no command with this name, and these values if given, has come."""
        found = [each for each in self.commands(name) if not values or each.values == values]
        assert not found, f"expected no {name}{values or ''}, got {len(found)}, the first {found[0]}"

    def assert_moving(self, within_s: float = PATIENCE_S) -> None:
        """Asserts that the wheels turn, or start within a time; AssertionError if they do not."""
        self._board.wait_until(lambda: self._board.true_speed_m_s > _STILL_M_S, within_s, "wheels that turn")

    def assert_stopped(self, within_s: float = PATIENCE_S) -> None:
        """Asserts that the wheels stand still, or stop within a time; AssertionError if they do not."""
        self._board.wait_until(lambda: self._board.true_speed_m_s == 0.0, within_s, "wheels that stand")
