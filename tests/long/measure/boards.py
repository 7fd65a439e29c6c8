"""Boards in simulated time for `mrl measure`, each with one known fault, or sound."""

import contextlib
import random
from typing import Any, Callable, ContextManager, Dict, Iterator, Mapping, NamedTuple, Tuple

from mrl_driver.apps.calibration.fit import BY_TRUTH
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.apps.calibration.wiring_check import BITS
from mrl_driver.apps.measure import course
from mrl_driver.apps.measure.line import Clock
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver, SteppedLink
from mrl_driver.transport.link import Link
from sim_arduino.serve import factory

PAUSED, PAUSES_S = 0.05, (0.06, 0.15)
"""Share of the waits in which a slow computer pauses, and for how long [s]."""


class Bench(NamedTuple):
    """Two ways to a board: the link with the clock of its times [s], and a driver with options by name."""

    link: Callable[[], ContextManager[Tuple[Link, Clock]]]
    driver: Callable[..., ContextManager[Any]]


class SlowLink(SteppedLink):
    """A link whose reader pauses."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.rng = random.Random(0)

    def read(self, timeout_s: float) -> bytes:
        if self.rng.random() < PAUSED / 50:  # a wait of 20 ms is some fifty reads
            return self.skip(self.rng.uniform(*PAUSES_S))
        return super().read(timeout_s)


class SlowDriver(SteppedDriver):
    """A driver whose program pauses."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.rng = random.Random(0)

    def wait(self, timeout_s: Any = None) -> bool:
        if self.rng.random() < PAUSED:
            self.pause(self.rng.uniform(*PAUSES_S))
        return super().wait(timeout_s)


def bench(
    robot: str, watchdog_ms: int = 0, slow: bool = False, config: Mapping[str, int] = {}, **options: Any
) -> Bench:
    """Two ways to a board; each makes a new one of the same kind.

    `watchdog_ms` is in force whatever the board is told, `config` has parameters of the board, and `options`
    are those of `mrl-sim`.
    """

    @contextlib.contextmanager
    def engine() -> Iterator[Tuple[Any, factory.Emulated]]:
        made = factory.make(factory.Options(robot=robot, world="room", **options))
        for name, value in config.items():
            made.board.engine.config[name] = value  # type: ignore[attr-defined]
        with contextlib.closing(made):
            yield (Stubborn(made.engine, watchdog_ms) if watchdog_ms else made.engine), made

    @contextlib.contextmanager
    def link() -> Iterator[Tuple[Link, Clock]]:
        with engine() as (board, _):
            found = (SlowLink if slow else SteppedLink)(board)
            yield found, lambda: found.now_s

    @contextlib.contextmanager
    def driver(**given: Any) -> Iterator[SteppedDriver]:
        given.pop("reconnect", None)
        kind, model = SlowDriver if slow else SteppedDriver, robot if robot.endswith(".yaml") else "auto"
        with engine() as (board, made), kind(board, model, Options(**given)) as driven:
            driven.true_pose = lambda: made.plant.true_pose  # type: ignore[attr-defined]
            yield driven

    return Bench(link, driver)


def truth(robot: Any) -> course.Source:
    """Where the emulated robot of this driver is: by the board if it is a virtual one, else by the emulator."""
    own = course.source(robot, None, asks=False)
    return own if robot.board.virtual else course.Source(Truth(robot.true_pose), BY_TRUTH)


class Stubborn:
    """A board whose watchdog has another time than it was told, and that says otherwise."""

    def __init__(self, board: Any, watchdog_ms: int) -> None:
        self._board, self._watchdog_ms, self._tried = board, watchdog_ms, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._board, name)

    def receive(self, data: bytes) -> None:
        """The bytes reach the board."""
        self._board.receive(data)

    def advance(self, to_s: float) -> bytes:
        """The board runs, and its watchdog waits."""
        out: bytes = self._board.advance(to_s)
        if self._board.watchdog_ms:
            self._board.watchdog_ms = self._watchdog_ms
        return out


FAULTS: Dict[str, Dict[str, Any]] = {
    "watchdog_500": {"watchdog_ms": 500},
    "damage_0_1_percent": {"faults": ("change:rate=0.001",), "seed": 1},
    "usb_delay_16_ms": {"faults": ("delay:delay=0.016,jitter=0,direction=to_host",)},
    "wheel_5_percent_smaller": {"error": "wheel_ratio=0.95,wheel_size=0.975"},
    "slow_computer": {"slow": True},
    "axis_5_percent_longer": {"error": "axle=1.05"},
    "wheels_5_percent_smaller": {"error": "wheel_size=0.95"},
    "motors_exchanged": {"wiring": 1 | BITS["motors_swapped"], "config": {"wiring": 1}},
    "encoder_reversed": {"faults": ("encoder_swapped:wheel=left",)},
    "weak_battery": {"battery": 8.0},
    "empty_battery": {"battery": 8.55},
    "sonar_deaf": {"faults": ("sonar_failed:sonar=front,state=deaf",)},
    "sonar_dead": {"faults": ("sonar_failed:sonar=left,state=dead",)},
}
"""Options of boards, by the names of controls.yaml."""
ROBOTS = ("duo", "traxbot", "stingbot", "omni")


def sound(robot: str, seed: int) -> Bench:
    """A board without a fault: each seed draws other errors of its wheels, as small as the model allows."""
    rng = random.Random(seed)
    ratio, size, axle = (rng.gauss(1.0, sd) for sd in (0.003, 0.005, 0.005))
    error = f"wheel_ratio={ratio:.4f},wheel_size={size:.4f},axle={axle:.4f},noise=1e-5"
    return bench(robot, seed=seed, error=error)
