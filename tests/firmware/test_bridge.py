"""The H-bridge back end on the PC, with the emulated motors and encoders: requests, control of a wheel, safety."""

import math
from typing import Any, Callable, Dict, List

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

    def speeds(self, seconds: float, wheel: int = 0) -> List[float]:
        """True speeds of a wheel, once each millisecond [m/s]."""
        found = []
        for _ in range(round(seconds * 1e3)):
            self.run(1e-3)
            found.append(self.speed(wheel))
        return found

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
@pytest.mark.parametrize("percent", [60, -60])
def test_each_chip_drives_in_both_directions(kit, chip, percent):
    """The duty's share of time in the direction, and the rest without a drive."""
    bench = kit(chip)
    bench.send("move_motors", percent, percent, wait_s=0.1)
    shares = bench.shares()
    along, against = (shares.forward, shares.backward) if percent > 0 else (shares.backward, shares.forward)
    assert along == pytest.approx(0.6, abs=0.005) and against == 0.0


@pytest.mark.parametrize("chip", CHIPS)
def test_each_chip_brakes_at_a_stop(kit, chip):
    bench = kit(chip)
    bench.send("move_motors", 60, -60, wait_s=0.1)
    bench.send("stop")
    assert [bench.shares(wheel).brake for wheel in (0, 1)] == [1.0, 1.0]


@pytest.mark.parametrize("chip", ["vnh5019", "l298n", "tb6612", "drv8833"])
def test_coasting_is_opt_in(kit, chip):
    bench = kit(chip, stop_mode=1)
    bench.send("move_motors", 60, -60, wait_s=0.1)
    bench.send("stop")
    assert [bench.shares(wheel).coast for wheel in (0, 1)] == [1.0, 1.0]


@pytest.mark.parametrize("chip", ["cytron", "bts7960"])
def test_chips_that_cannot_coast_brake(kit, chip):
    bench = kit(chip, stop_mode=1)
    bench.send("move_motors", 60, -60, wait_s=0.1)
    bench.send("stop")
    assert bench.shares().brake == 1.0


@pytest.mark.parametrize("bits", [0, 2, 4, 8, 16, 32, 64, 6, 48, 50, 126])
def test_stored_wiring_undoes_the_cables(kit, bits):
    bench = kit(wires=1 + bits, wiring=1 + bits)
    bench.send("move_differential", 200, 500, wait_s=0.5)
    left, right = (bench.speed(wheel) for wheel in (0, 1))
    assert (left, right) == (pytest.approx(0.1625, abs=0.01), pytest.approx(0.2375, abs=0.01))
    right_count, left_count = bench.ask("read_encoders").args
    assert 0 < left_count < right_count


# ---- what is refused


@pytest.mark.parametrize("name, args", MOVES)
@pytest.mark.parametrize(
    "values", [{"bridge": 0}, {"wiring": 0}, {"wiring": 126}, {"gearbox": 1, "encoder_counts": 100}]
)
def test_without_bridge_wiring_or_counts_each_move_is_refused(kit, name, args, values):
    bench = kit(**values)
    bench.send(name, *args, wait_s=0.3)
    assert bench.counter("unavailable") == 1 and not bench.is_driven()
    assert bench.field("read_status", "faults") & FAULT["wiring"]


def test_the_fault_goes_when_the_wiring_is_set(kit):
    bench = kit()
    bench.ask("read_status")
    assert not bench.field("read_status", "faults") & FAULT["wiring"]


# ---- control


def test_speed_is_that_of_the_command_without_overshoot(kit):
    """0.3 m/s, no ramp: at most 5 % above, within 5 % after 250 ms, 1 % on average."""
    bench = kit()
    bench.send("move_differential", 300, 0, wait_s=0)
    speeds = bench.speeds(0.8)
    assert max(speeds) < 0.315
    assert min(speeds[250:]) > 0.285
    assert sum(speeds[400:]) / 400 == pytest.approx(0.3, rel=0.01)


def test_the_integral_does_not_wind_up_at_full_duty(kit):
    """A second at a speed that the battery does not give, then a lower one."""
    bench = kit(full_speed=400, linear_ceiling=32767)
    bench.send("move_differential", 1300, 0, wait_s=1.0)
    assert bench.shares().forward == 1.0
    bench.send("move_differential", 400, 0, wait_s=0)
    assert bench.seconds_to(lambda: bench.speed() < 0.42) < 0.12


def test_slow_speed_is_even(kit):
    """0.02 m/s, 147 edges/s with a phase error of 20 %: at most 20 % from peak to peak."""
    bench = kit(phase=0.2)
    bench.send("move_differential", 20, 0, wait_s=1.0)
    speeds = bench.speeds(2.0)
    mean = sum(speeds) / len(speeds)
    assert mean == pytest.approx(0.02, rel=0.03) and max(speeds) - min(speeds) < 0.2 * mean


def test_a_wheel_beyond_its_full_speed_keeps_the_arc(kit):
    """0.5 m/s and 5 rad/s ask 0.875 and 0.125 m/s of the wheels."""
    bench = kit(linear_ceiling=32767, angular_ceiling=32767)
    bench.send("move_differential", 500, 5000, wait_s=1.0)
    assert bench.speed(1) / bench.speed(0) == pytest.approx(7.0, rel=0.1)


def test_percent_moves_are_shares_of_full_speed(kit):
    """Full speed is 170/min on 65 mm: 0.5786 m/s."""
    bench = kit()
    bench.send("move_motors_pid", 40, -40, wait_s=0.5)
    assert (bench.speed(0), bench.speed(1)) == (
        pytest.approx(0.2314, rel=0.02),
        pytest.approx(-0.2314, rel=0.02),
    )


def test_the_ramp_takes_its_time_to_full_speed(kit):
    bench = kit(ramp_time=1000)
    bench.send("move_differential", 289, 0, wait_s=0)
    assert bench.seconds_to(lambda: bench.speed() > 0.26) == pytest.approx(0.5, abs=0.08)


def test_a_reversal_rests_at_zero(kit):
    bench = kit(reversal_pause=300)
    bench.send("move_differential", 200, 0, wait_s=0.4)
    bench.send("move_differential", -200, 0, wait_s=0)
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.01
    assert bench.seconds_to(bench.is_driven) == pytest.approx(0.3, abs=0.01)
    assert bench.shares().backward


def test_a_position_is_reached_and_held(kit):
    bench = kit()
    bench.send("move_to_position", 1, 50, 700, wait_s=2.0)
    bench.send("move_to_position", 3, 50, -700, wait_s=2.0)
    right, left = bench.ask("read_encoders").args
    assert abs(left - 700) <= 4 and abs(right + 700) <= 4


def test_a_position_is_reached_with_a_ramp_without_going_beyond(kit):
    """The ramp limits how fast the wheel becomes faster, not how fast it becomes slower."""
    bench = kit(ramp_time=3000)
    bench.send("move_to_position", 1, 100, 1500, wait_s=0)
    counts = []
    for _ in range(300):
        bench.run(0.01)
        counts.append(bench.plant.bridge.motor(0).travel)
    assert max(counts) < 1510 and counts[-1] > 1490


def test_the_duty_is_finer_than_the_steps_of_the_output(kit):
    """1 % lies between 2 and 3 of 255 steps: the mean over the periods is right."""
    bench = kit()
    bench.send("move_motors", 1, 1, wait_s=0.1)
    duties = []
    for _ in range(200):
        bench.run(1e-3)
        duties.append(bench.shares().forward)
    assert sum(duties) / len(duties) == pytest.approx(0.01, rel=0.02)


def test_gains_of_command_2_are_in_force(kit):
    """Without gains, the feed-forward of a full speed that is too high is all that drives."""
    bench = kit(full_speed=340, friction_duty=0)
    bench.send("set_pid_gains", 0, 0, 0)
    bench.send("move_differential", 300, 0, wait_s=0.6)
    assert bench.speed() < 0.2
    bench.send("set_pid_gains", 1600, 23700, 0, wait_s=0.6)
    assert bench.speed() == pytest.approx(0.3, rel=0.03)


def test_one_channel_counts_in_the_direction_of_the_command(kit):
    single = 1 + BIT["single_channel"]
    bench = kit(wires=single, wiring=single)
    bench.send("move_differential", -200, 0, wait_s=1.0)
    assert bench.speed() == pytest.approx(-0.2, rel=0.05)
    assert bench.ask("read_encoders").args[0] < -500


# ---- counters


def test_counters_are_those_of_the_wheels(kit):
    bench = kit()
    bench.send("move_differential", 200, 500, wait_s=0.5)
    bench.send("stop", wait_s=0.5)
    right, left = bench.ask("read_encoders").args
    travels = [bench.plant.bridge.motor(wheel).travel for wheel in (0, 1)]
    assert (left, right) == (pytest.approx(travels[0], abs=1), pytest.approx(travels[1], abs=1))


def test_preset_and_reset(kit):
    bench = kit()
    bench.send("preset_encoder", 1, -32000)
    bench.send("preset_encoder", 3, 5)
    assert bench.ask("read_encoders").args == (5, -32000)
    bench.send("reset_encoders")
    assert bench.ask("read_encoders").args == (0, 0)


@pytest.mark.parametrize("linear", [200, -200])
def test_prescaler_divides_the_counts(kit, linear):
    """Rounded down, as on the OMNI-3MD."""
    bench = kit()
    bench.send("set_encoder_prescaler", 1, 2)
    bench.send("move_differential", linear, 0, wait_s=1.0)
    bench.send("stop", wait_s=0.5)
    right, left = bench.ask("read_encoders").args
    assert left == right // 100


# ---- safety


def test_a_blocked_wheel_stops_the_robot(kit):
    bench = kit()
    bench.send("move_differential", 200, 0, wait_s=0.5)
    faults.wheel_blocked(bench.plant, True, "left")
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.8
    assert bench.stop_reason() == "wheel_blocked"


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


def test_channels_that_are_swapped_on_the_way_stop_the_robot(kit):
    bench = kit()
    bench.send("move_differential", 300, 0, wait_s=0.5)
    faults.encoder_swapped(bench.plant, True, "left")
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.1
    assert bench.stop_reason() == "encoder"


@pytest.mark.parametrize("channels", ["a", "b", "ab"])
def test_an_encoder_with_an_open_wire_stops_the_robot(kit, channels):
    bench = kit()
    for channel in channels:
        faults.encoder_open(bench.plant, True, "right", channel)
    bench.send("move_differential", 200, 0, wait_s=0)
    bench.run(0.05)
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.5
    assert bench.stop_reason() == "encoder"


@pytest.mark.parametrize("channel", ["a", "b"])
def test_a_wire_that_breaks_on_the_way_stops_the_robot(kit, channel):
    """The other channel's edges go to and fro."""
    bench = kit()
    bench.send("move_differential", 200, 0, wait_s=0.5)
    faults.encoder_open(bench.plant, True, "right", channel)
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.5
    assert bench.stop_reason() == "encoder"


def test_an_oscillating_line_stops_the_robot(kit):
    bench = kit()
    bench.send("move_differential", 200, 0, wait_s=0.5)
    faults.encoder_oscillation(bench.plant, True, "left", "b", 100e3)
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.03
    assert bench.stop_reason() == "encoder"


def test_a_masked_encoder_counts_again_from_the_next_move_on(kit):
    bench = kit()
    bench.send("move_differential", 200, 0, wait_s=0.5)
    faults.encoder_oscillation(bench.plant, True, "left", "b", 100e3)
    bench.run(0.1)
    faults.encoder_oscillation(bench.plant, False, "left", "b", 100e3)
    bench.send("stop")
    bench.send("move_differential", 200, 0, wait_s=0.5)
    assert bench.speed() == pytest.approx(0.2, rel=0.05) and bench.stop_reason() == "none"


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


def test_a_weak_battery_stops_the_robot(kit):
    bench = kit(battery_divider=4000, undervoltage=1000)
    bench.send("move_differential", 200, 0, wait_s=0.5)
    assert bench.is_driven()
    faults.battery_sag(bench.plant, True, 4.0)
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.3
    assert bench.stop_reason() == "undervoltage"
    bench.send("move_differential", 200, 0)
    assert not bench.is_driven()
    faults.battery_sag(bench.plant, False, 0.0)
    bench.run(0.3)
    bench.send("move_differential", 200, 0)
    assert bench.is_driven()


def test_silence_of_the_host_stops_the_robot(kit):
    bench = kit()
    bench.send("set_watchdog", 250)
    bench.send("move_differential", 200, 0, wait_s=0)
    bench.run(0.24)
    assert bench.is_driven()
    assert bench.seconds_to(lambda: not bench.is_driven()) < 0.025
    assert bench.stop_reason() == "link_watchdog"


# ---- replies
