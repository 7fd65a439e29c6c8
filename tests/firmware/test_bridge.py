"""The H-bridge back end on the PC, with the emulated motors and encoders: requests, control of a wheel, safety."""

import math
from typing import Any, Callable, Dict

import pytest

from mrl_driver.protocol.table import BRIDGES, FAULTS, PARAMETERS, STOP_REASONS, WIRING
from sim_arduino.faults import hardware_faults as faults
from sim_arduino.hardware.robot_physics import AS_MODELLED
from sim_arduino.hardware.wiring import Plant
from tests import models
from tests.firmware.conftest import Bench
from tests.firmware.pc_board import BRIDGE

PARAMETER = {each.name: index for index, each in enumerate(PARAMETERS)}
BIT = {name: 1 << bit for bit, (name, _) in enumerate(WIRING)}
FAULT = {name: 1 << bit for bit, (name, _) in enumerate(FAULTS)}
SET = {"wiring": 1, "kp": 1600, "ki": 23700, "friction_duty": 53, "ramp_time": 0, "full_speed": 170}
"""A wired kit with the gains that `mrl calibrate gains` fits to it; no ramp."""
M_PER_COUNT = models.model("duo").drive.metres_per_count
PERIOD_S = 78 * 64e-6
CHIPS = BRIDGES[1:]
MOVES = [
    ("move_differential", (200, 0)),
    ("move_motors_pid", (30, 30)),
    ("move_motors", (30, 30)),
    ("move_to_position", (1, 50, 100)),
]


class Kit(Bench):
    """A board with an H-bridge and the emulated kit."""

    def write(self, **values: int) -> None:
        for name, value in values.items():
            self.send("write_config", PARAMETER[name], value, wait_s=0.005)

    def speed(self, wheel: int = 0) -> float:
        """True speed of a wheel [m/s]."""
        return float(self.plant.bridge.motor(wheel).speed * M_PER_COUNT)

    def shares(self, wheel: int = 0) -> Any:
        return self.plant.bridge.motor(wheel).shares

    def stop_reason(self) -> str:
        return STOP_REASONS[self.field("read_status", "stop_reason")]

    def seconds_to(self, condition: Callable[[], bool], most_s: float = 2.0) -> float:
        """Time until a condition holds [s]; infinite if it does not within `most_s`."""
        start_s = self.board.now_s
        while self.board.now_s < start_s + most_s:
            if condition():
                return self.board.now_s - start_s
            self.run(1e-3)
        return math.inf

    def is_driven(self) -> bool:
        return any(self.shares(wheel).forward or self.shares(wheel).backward for wheel in (0, 1))


@pytest.fixture
def kit():
    made: Dict[int, Kit] = {}

    def make(
        chip: str = "tb6612", wires: int = 1, ready: bool = True, phase: float = 0.0, **values: int
    ) -> Kit:
        model = models.model("duo")
        board = {**model.board, "bridge": BRIDGES.index(chip), "battery_divider": 4000}
        errors = AS_MODELLED._replace(encoder_phase=phase)
        plant = Plant(model._replace(board=board), wiring=wires, errors=errors)
        made[len(made)] = bench = Kit(plant=plant, library=BRIDGE, robot_id=23)
        if ready:
            bench.write(**{"bridge": BRIDGES.index(chip), **SET, **values})
        return bench

    yield make
    for each in made.values():
        each.board.close()


# ---- wires


@pytest.mark.parametrize("chip", CHIPS)
def test_each_chip_brakes_at_a_stop(kit, chip):
    bench = kit(chip)
    bench.send("move_motors", 60, -60, wait_s=0.1)
    bench.send("stop")
    assert [bench.shares(wheel).brake for wheel in (0, 1)] == [1.0, 1.0]


# ---- what is refused


# ---- control


def test_a_position_is_reached_with_a_ramp_without_going_beyond(kit):
    """The ramp limits how fast the wheel becomes faster, not how fast it becomes slower."""
    bench = kit(ramp_time=3000)
    bench.send("move_to_position", 1, 100, 1500, wait_s=0)
    counts = []
    for _ in range(300):
        bench.run(0.01)
        counts.append(bench.plant.bridge.motor(0).travel)
    assert max(counts) < 1510 and counts[-1] > 1490


# ---- counters


# ---- safety


@pytest.mark.parametrize("wheel", ["left", "right"])
@pytest.mark.parametrize("linear", [300, -20])
def test_an_encoder_that_counts_in_the_wrong_direction_stops_the_robot(kit, wheel, linear):
    """Within 100 ms of the first wrong count."""
    bench = kit()
    faults.encoder_swapped(bench.plant, True, wheel)
    start = bench.ask("read_encoders").args
    bench.send("move_differential", linear, 0, wait_s=0)
    bench.seconds_to(lambda: bench.ask("read_encoders", wait_s=2e-3).args != start)
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.1
    assert bench.stop_reason() == "encoder"


def test_open_loop_moves_bear_reversed_encoders(kit):
    """`mrl calibrate wiring` turns motors whose encoders it does not know yet."""
    bench = kit(wires=1 + BIT["left_encoder_reversed"])
    bench.send("move_motors", 30, 30, wait_s=0.5)
    assert bench.speed() > 0.1 and bench.stop_reason() == "none"


@pytest.mark.parametrize("linear, angular", [(300, 0), (-300, 0), (50, 0), (5, 0), (0, 3000)])
def test_sound_wheels_do_not_stop(kit, linear, angular):
    bench = kit()
    for sign in (1, -1, 1):
        bench.send("move_differential", sign * linear, sign * angular, wait_s=0.7)
    assert bench.stop_reason() == "none"


def test_a_wheel_that_still_rolls_after_a_reversal_is_not_a_wrong_encoder(kit):
    """It coasts for over 100 ms against a drive that is too weak to turn it back."""
    bench = kit("vnh5019", stop_mode=1, kp=0, ki=0, friction_duty=0)
    bench.send("move_differential", 500, 0, wait_s=0.8)
    bench.send("move_differential", -20, 0, wait_s=0.15)
    assert bench.speed() > 0.05
    assert bench.is_driven() and bench.stop_reason() == "none"


# ---- replies
