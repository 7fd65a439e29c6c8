"""Fixtures with emulated boards for your own tests; pytest finds them by itself if mrl-driver is installed.

    def test_stops(emulated_board): ...
    @pytest.mark.emulated_board(robot="stingbot", world="l-course", sonar="noise=0.01")
    def test_in_the_course(emulated_board): ...

The marker takes what `testing.EmulatedBoard` takes.
"""

import contextlib
from typing import TYPE_CHECKING, Any, Callable, Iterator, List, cast

import pytest

from mrl_driver.errors import MrlError

if TYPE_CHECKING:
    from mrl_driver.geometry import Pose
    from sim_arduino.world.world import World

    from .emulated_board import EmulatedBoard, Faults, Motors


def pytest_configure(config: Any) -> None:
    """Registers the marker."""
    config.addinivalue_line(
        "markers", "emulated_board(**options): options of the emulated board, as of mrl-sim"
    )


def pytest_addoption(parser: Any) -> None:
    """Adds the options for the engine and for a board that is plugged in."""
    parser.addoption(
        "--port",
        metavar="PORT",
        help="run the tests of emulated_board on the bare board at this port (mrl flash --build virtual); those that "
        "need more than a port are skipped",
    )
    parser.addoption(
        "--emulated-engine",
        choices=("python", "avr"),
        default="python",
        help="engine of emulated boards whose test does not choose one: the board in Python, or the firmware binary "
        "on a simulated chip, which needs a C compiler and libsimavr",
    )


def _options(request: Any) -> Any:
    marker = request.node.get_closest_marker("emulated_board")
    return dict(marker.kwargs) if marker else {}


@contextlib.contextmanager
def _told_in_one_line() -> Iterator[None]:
    """A board that cannot be made fails the test with its message alone."""
    try:
        yield
    except MrlError as error:
        raise pytest.fail.Exception(error.line, pytrace=False) from None


@pytest.fixture
def emulated_world(request: Any) -> "World":
    """The world: the marker's `world`, or the packaged room; override it for another one."""
    from sim_arduino.world.world import World
    from sim_arduino.world.world_file import load

    world = _options(request).get("world", "room")
    return world if isinstance(world, World) else load(world)


@pytest.fixture(scope="session")
def _plugged_port(pytestconfig: Any) -> str:
    """The port of a bare board that is plugged in; empty without one."""
    port = pytestconfig.getoption("--port")
    if not port:
        return ""
    from .plugged_board import require_bare

    with _told_in_one_line():
        return require_bare(port)


@pytest.fixture
def make_emulated_board(
    emulated_world: "World", pytestconfig: Any, _plugged_port: str
) -> Iterator[Callable[..., "EmulatedBoard"]]:
    """Makes any number of boards in one world: `make_emulated_board(name="two", pose="1,0,180")`."""
    if _plugged_port:
        pytest.skip("makes its own boards: --port is for tests of emulated_board")
    from .emulated_board import EmulatedBoard

    made: List[EmulatedBoard] = []
    engine = pytestconfig.getoption("--emulated-engine")
    closing = contextlib.ExitStack()

    def make(**options: Any) -> EmulatedBoard:
        usual = {"world": emulated_world, "name": f"robot{len(made) + 1}", "engine": engine}
        if options.get("profile", "current") != "current":
            usual["engine"] = "python"
        made.append(EmulatedBoard(**{**usual, **options}))
        closing.callback(made[-1].close)
        return made[-1]

    with closing:
        yield make


@pytest.fixture
def emulated_board(request: Any, _plugged_port: str) -> "EmulatedBoard":
    """A board on a pty, see `testing.EmulatedBoard`: port, true_pose, wait_until, motors, faults.

    With `--port` it is the bare board there, which has `port` and `wait_until`.
    """
    options = _options(request)
    if _plugged_port:
        from .plugged_board import PluggedBoard

        return cast("EmulatedBoard", PluggedBoard(_plugged_port, options))
    options.pop("world", None)
    with _told_in_one_line():
        board: EmulatedBoard = request.getfixturevalue("make_emulated_board")(**options)
    return board


@pytest.fixture
def emulated_faults(emulated_board: "EmulatedBoard") -> "Faults":
    """What goes wrong with the board: `inject("loss:rate=0.01")`, `unplug()`, `freeze(1.0)`, `clear()`."""
    return emulated_board.faults


@pytest.fixture
def emulated_motors(emulated_board: "EmulatedBoard") -> "Motors":
    """What reached the motor board: `commands()`, `assert_commanded(...)`, `assert_stopped()`."""
    return emulated_board.motors


@pytest.fixture
def true_pose(emulated_board: "EmulatedBoard") -> "Callable[[], Pose]":
    """Called, tells where the robot really is."""
    return lambda: emulated_board.true_pose
