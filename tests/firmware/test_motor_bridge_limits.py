"""The H-bridge back end at its limits, with pins and edges in place of motors.

A Cytron shows the duty of a wheel on one pin and its direction on another.
"""

from typing import Any, Dict, List, Tuple

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BRIDGES, BY_NAME, PARAMETER_BY_NAME, TICK_S, WIRING
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P
from sim_arduino.board import parameter_store
from sim_arduino.board.wheel_settings import FULL, PERIOD_TICKS
from sim_arduino.hardware.encoders import PinEdge
from tests import models
from tests.firmware.conftest import Bench
from tests.firmware.pc_board import BRIDGE, VOLTS_PER_COUNT
from tests.models import ENCODER_PINS

LEFT, RIGHT = 0, 1
MOTORS = (1, 3)  # Numbers of the left and the right motor in the protocol
PERIOD_S = PERIOD_TICKS * TICK_S
BYTE_S = 10 / 115200
PASS_S = 16e-6  # Of the loop in the build for the PC
STOP = encode_request(BY_NAME["stop"].code)
FEW = 16  # Periods in which a wheel may stand at full duty without being silent
MANY = 129  # Periods in which the output's mean shows each share of FULL: 255/16384 of a level in a period
BIT = {name: 1 << bit for bit, (name, _) in enumerate(WIRING)}
MASKING_EDGES = 251  # In one period
DUO = 23
COMMON = {
    "bridge": BRIDGES.index("cytron"),
    "wiring": 1,
    "ramp_time": 0,
    "battery_divider": 0,
    "friction_duty": 0,
}
STRONG = {**COMMON, "kp": 32767, "ki": 0}
"""The duty of a wheel that stands is 32.8 times its setpoint, so that a few periods show each share."""
GAIN = 33554 / 1024
WEAK = {**COMMON, "kp": 0, "ki": 0}  # The duty is the setpoint
UNIT = {
    **STRONG,
    "full_speed": 1000,
    "wheel_radius": 15645,
    "axis_radius": 32767,
    "linear_ceiling": 32767,
    "angular_ceiling": 32767,
}
TURN = 1342 / 4096  # Settings with one share of FULL for each mm/s, and this much for each mrad/s
MOVES = [
    ("move_motors_pid", (30, 0)),
    ("move_motors", (0, 30)),
    ("move_differential", (100, 0)),
    ("move_differential", (0, 100)),
    ("move_to_position", (1, 50, 1000)),
]


class Outside:
    """What is wired to the board: pins that are noted, encoders that count what the test says, a battery."""

    def __init__(self) -> None:
        self.i2c: Dict[int, Any] = {}
        self.bridge = self
        self.levels = {pin: 0 for pins in ENCODER_PINS for pin in pins}
        self.battery_count = 1023
        self.writes: List[Tuple[float, int]] = []
        self._duties = [0, 0]
        self._edges: List[PinEdge] = []
        self._places = [0, 0]
        self._now_s = 0.0

    def advance(self, to_s: float) -> None:
        self._now_s = to_s

    def adc_volts(self, channel: int, time_s: float) -> float:
        return (self.battery_count + 0.5) * VOLTS_PER_COUNT

    def pin_changed(self, pin: int, level: int, time_s: float) -> None:
        """Lamps and the like."""

    def write(
        self, time_s: float, motor: int, pwm_a: float, pwm_b: float, logic: float, _enable: float
    ) -> None:
        duty = round(pwm_a * 255)
        self._duties[motor] = -duty if logic else duty
        self.writes.append((time_s, self._duties[motor]))

    def take_edges(self) -> List[PinEdge]:
        edges, self._edges = self._edges, []
        return edges

    def count(self, encoder: int, counts: int) -> None:
        """An encoder turns by this much; the board sees it 1 ms later."""
        for _ in range(abs(counts)):
            self._turn(encoder, 1 if counts > 0 else -1)

    def _turn(self, encoder: int, step: int) -> None:
        """Forward: A rises, B rises, A falls, B falls."""
        edge = self._places[encoder] if step > 0 else (self._places[encoder] - 1) % 4
        self._places[encoder] = (self._places[encoder] + step) % 4
        level = int((edge < 2) == (step > 0))
        self._edges.append(PinEdge(self._now_s, ENCODER_PINS[encoder][edge % 2], level))

    def duty(self, motor: int) -> int:
        return self._duties[motor]


class Pins(Bench):
    def __init__(self, **values: int) -> None:
        self.config = parameter_store.Config(
            bytearray(models.wired_eeprom(DUO)), pins=wiring.rows(ATMEGA328P)
        )
        for name, value in values.items():
            self.config[name] = value
        super().__init__(
            plant=Outside(), library=BRIDGE, eeprom=parameter_store.image(self.config.values), boot=False
        )
        self.run(2 * PERIOD_S)
        self.forget()

    def write(self, **values: int) -> None:
        for name, value in values.items():
            self.send("write_config", PARAMETER_BY_NAME[name].number, value, wait_s=0.0)
        self.run(2e-3)

    def levels(self, periods: int) -> List[Tuple[int, int]]:
        """Outputs of both motors in each of the next periods."""
        found = []
        for _ in range(periods):
            self.run(PERIOD_S)
            found.append((self.plant.duty(LEFT), self.plant.duty(RIGHT)))
        return found

    def duties(self, periods: int) -> List[float]:
        """Mean outputs of both motors in the next periods, as shares of FULL."""
        return [sum(each) * FULL / 255 / periods for each in zip(*self.levels(periods))]

    def setpoints(self) -> List[int]:
        """Setpoints of wheels that stand, with strong gains."""
        return [round(duty / GAIN) for duty in self.duties(FEW)]

    def is_driven(self) -> bool:
        return self.plant.duty(LEFT) != 0 or self.plant.duty(RIGHT) != 0

    def count(self, left: int, right: int = 0) -> None:
        """The encoders count, and the board sees it at once: edges come 1 ms late, and a millisecond passes."""
        self.plant.count(LEFT, left)
        self.plant.count(RIGHT, right)
        self.run(1e-3)

    def mask(self, encoder: int) -> None:
        for _ in range(MASKING_EDGES):
            self.plant.count(encoder, 1)
            self.plant.count(encoder, -1)
        self.run(3e-3)


@pytest.fixture
def pins(close_later):
    def make(**values: int) -> Pins:
        made = Pins(**values)
        close_later(made.board)
        return made

    return make


# ---- shares of moves


@pytest.mark.parametrize("percent", [7, 6, -7, -6, 49])
def test_a_percentage_of_the_duty_is_rounded_towards_zero(pins, percent):
    """163.84 shares each, to a hundredth."""
    board = pins(**WEAK)
    board.send("move_motors", percent, -percent, wait_s=PERIOD_S)
    share = int(percent * 163.84375)
    assert board.duties(MANY) == pytest.approx([share, -share], abs=0.5)


ROUNDED = {**STRONG, "full_speed": 1000, "wheel_radius": 12926, "axis_radius": 113}
"""309/256 of a share for each mm/s, and 5/4096 for each mrad/s."""


@pytest.mark.parametrize("linear, angular, shares", [(99, 0, (119, 119)), (128, 0, (155, 155))])
def test_a_linear_speed_is_rounded_to_the_nearest_share(pins, linear, angular, shares):
    """The exact shares are 119 + 127/256 and 154 + 128/256."""
    board = pins(**ROUNDED)
    board.send("move_differential", linear, angular, wait_s=PERIOD_S)
    assert tuple(board.setpoints()) == shares


@pytest.mark.parametrize("angular, share", [(2867, 3), (2048, 3), (-2048, -2), (-2867, -3)])
def test_an_angular_speed_is_rounded_to_the_nearest_share(pins, angular, share):
    """2867 are 3.4998 shares, 2048 are 2.5; a half is rounded up."""
    board = pins(**ROUNDED, angular_ceiling=32767)
    board.send("move_differential", 0, angular, wait_s=PERIOD_S)
    assert board.setpoints() == [-share, share]


@pytest.mark.parametrize("slow, fast", [(14, FULL), (-14, FULL), (14, -FULL), (-14, -FULL)])
@pytest.mark.parametrize("wheel", [LEFT, RIGHT])
def test_a_wheel_at_its_full_speed_does_not_slow_down_the_other(pins, wheel, slow, fast):
    board = pins(**UNIT)
    drive(board, wheel, fast, slow)
    assert board.setpoints()[1 - wheel] == slow


@pytest.mark.parametrize("slow, fast", [(15, FULL + 1), (-15, FULL + 1), (15, -FULL - 1), (-15, -FULL - 1)])
@pytest.mark.parametrize("wheel", [LEFT, RIGHT])
def test_a_wheel_beyond_its_full_speed_by_the_least_slows_down_the_other(pins, wheel, slow, fast):
    """15 shares are less than the 16 in which slowing down takes speeds."""
    board = pins(**UNIT)
    drive(board, wheel, fast, slow)
    assert board.setpoints()[1 - wheel] == 0


SLOWED = [(18000, 464, 422), (18000, 480, 436)]
"""Shares that are wanted, and the slower one that both can reach."""


@pytest.mark.parametrize("fast, slow, slowed", SLOWED)
@pytest.mark.parametrize("wheel", [LEFT, RIGHT])
@pytest.mark.parametrize("sign", [1, -1])
def test_both_wheels_slow_down_by_the_same_factor(pins, wheel, sign, fast, slow, slowed):
    board = pins(**UNIT)
    drive(board, wheel, sign * fast, sign * slow)
    assert board.setpoints()[1 - wheel] == sign * slowed


def drive(board: Pins, wheel: int, speed: int, other: int) -> None:
    """Shares of both wheels, whose sum is even, as a move of linear and angular speed."""
    left, right = (speed, other) if wheel == LEFT else (other, speed)
    angular = round((right - left) / 2 / TURN)
    board.send("move_differential", (left + right) // 2, angular, wait_s=PERIOD_S)


def test_the_least_output_backward_is_as_small_as_forward(pins):
    """28 shares: a level of one in half of the periods."""
    board = pins(**WEAK)
    board.send("move_differential", -1, 0, wait_s=0.0)
    assert {left for left, _ in board.levels(20)} == {0, -1}


# ---- what is refused, and for how long


@pytest.mark.parametrize("name, args", MOVES)
def test_no_move_ends_the_refusal_after_a_stop_of_the_board(pins, name, args):
    board = pins(**STRONG)
    board.send("move_motors", 10, 10)
    board.mask(LEFT)
    board.send(name, *args)
    assert not board.is_driven() and board.counter("unavailable") == 1


@pytest.mark.parametrize("late_s, driven", [(-0.5e-3, False), (0.5e-3, True)])
def test_moves_are_refused_for_a_second_after_a_stop_of_the_board(pins, late_s, driven):
    board = pins(**STRONG)
    board.send("move_motors", 10, 10)
    move = encode_request(BY_NAME["move_motors"].code, 10, 10)
    board.mask(LEFT)
    stopped_s, _ = board.plant.writes[-1]
    sent_s = stopped_s + 1.0 + late_s - len(move) * BYTE_S
    board.run(sent_s - board.board.now_s)
    board.raw(move, wait_s=2 * PERIOD_S)
    assert board.is_driven() == driven


@pytest.mark.parametrize("encoder", [LEFT, RIGHT])
def test_each_encoder_that_oscillates_stops_both_motors_and_counts_again_from_the_next_move_on(pins, encoder):
    board = pins(**STRONG)
    board.send("move_motors", 10, 10)
    board.mask(encoder)
    assert not board.is_driven() and board.stop_reason() == "encoder"
    board.send("reset_encoders")
    board.count(5, 7)
    masked = (0, 7) if encoder == LEFT else (5, 0)
    right, left = board.ask("read_encoders").args
    assert (left, right) == masked
    board.send("stop")
    board.send("move_motors", 10, 10)
    board.send("reset_encoders")
    board.count(8, 4)
    assert board.ask("read_encoders").args == (4, 8)


@pytest.mark.parametrize("encoder", [LEFT, RIGHT])
def test_an_encoder_that_oscillates_while_the_motors_rest_stops_nothing(pins, encoder):
    board = pins(**STRONG)
    board.mask(encoder)
    board.send("move_motors", 10, 10)
    assert board.is_driven() and board.stop_reason() == "none"


# ---- the battery, which is measured in 128 ms

LEAST_CV = 960
MEASURED = {**STRONG, "battery_divider": 4096, "undervoltage": LEAST_CV}
"""Two centivolts for each count of the converter."""
MEAN_S = 0.3  # Time in which a mean begins and ends


def battery(board: Pins, centivolts: int) -> None:
    board.plant.battery_count = centivolts // 2
    board.run(MEAN_S)


@pytest.mark.parametrize("centivolts, driven", [(LEAST_CV, True), (LEAST_CV - 2, False)])
def test_the_motors_stop_below_the_battery_s_limit(pins, centivolts, driven):
    board = pins(**MEASURED)
    battery(board, 1200)
    board.send("move_motors", 10, 10)
    battery(board, centivolts)
    assert board.is_driven() == driven
    assert board.stop_reason() == ("none" if driven else "undervoltage")


@pytest.mark.parametrize("centivolts, driven", [(1018, False), (1020, True)])
def test_the_motors_drive_again_a_sixteenth_above_the_battery_s_limit(pins, centivolts, driven):
    board = pins(**MEASURED)
    battery(board, 900)
    battery(board, centivolts)
    board.send("move_motors", 10, 10)
    assert board.is_driven() == driven


# ---- parameters that change while the wheels turn


@pytest.mark.parametrize(
    "values",
    [{"wiring": 1 + BIT["single_channel"]}, {"bridge": BRIDGES.index("bts7960")}, {"gearbox": 1}],
    ids=str,
)
def test_new_wires_or_numbers_without_control_stop_the_motors_for_good(pins, values):
    board = pins(**STRONG)
    board.send("move_motors", 30, 30)
    assert board.is_driven()
    board.write(**values)
    board.run(4 * PERIOD_S)
    board.plant.writes.clear()
    board.run(4 * PERIOD_S)
    assert not board.plant.writes and board.stop_reason() == "host"


@pytest.mark.parametrize(
    "values", [{"kp": 100}, {"stop_mode": 1}, {"undervoltage": 1}, {"ramp_time": 5}], ids=str
)
def test_other_parameters_leave_the_motors_turning(pins, values):
    board = pins(**STRONG)
    board.send("move_motors", 30, 30)
    board.plant.writes.clear()
    board.write(**values)
    board.run(2 * PERIOD_S)
    assert board.is_driven() and all(duty for _, duty in board.plant.writes)


@pytest.mark.parametrize("single_from", ["the start", "the moment in which it is written"])
def test_one_channel_counts_a_half_of_the_edges(pins, single_from):
    """Also after another parameter is written."""
    single = 1 + BIT["single_channel"]
    board = pins(**{**STRONG, "wiring": single if single_from == "the start" else 1})
    board.write(**({"kp": 100} if single_from == "the start" else {"wiring": single}))
    board.count(8, -6)
    assert board.ask("read_encoders").args == (3, 4)


# ---- stops


@pytest.mark.parametrize("phase", range(5))
def test_a_stop_does_not_wait_for_the_next_period(pins, phase):
    """Both motors' pins change in the pass in which the request has arrived."""
    board = pins(**STRONG)
    board.send("move_motors", 10, 10)
    board.run(phase * PERIOD_S / 5)
    board.send("stop", wait_s=0.0)
    board.run(len(STOP) * BYTE_S + 1e-4)
    assert not board.is_driven()


# ---- counters


@pytest.mark.parametrize("left, right", [(9, 4), (-3, -11)])
def test_counters_are_read_at_the_moment_of_the_request(pins, left, right):
    board = pins(**STRONG)
    for turn in range(1, 6):
        board.run(PERIOD_S + 4e-4)
        board.count(left, right)
        assert board.ask("read_encoders", wait_s=3e-3).args == (turn * right, turn * left)


@pytest.mark.parametrize("name, args", [("preset_encoder", (7,)), ("set_encoder_prescaler", (0,))])
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_a_counter_is_set_at_the_moment_of_the_request(pins, name, args, side):
    """Counts of the present period are part of it, also the first ones that the board has seen."""
    board = pins(**STRONG)
    counted = 0
    for _ in range(5):
        board.run(PERIOD_S + 4e-4)
        board.count(*((12, 0) if side == LEFT else (0, 12)))
        counted += 12
        board.send(name, MOTORS[side], *args, wait_s=1e-3)
        if name == "preset_encoder":
            counted = 7
        board.run(2 * PERIOD_S)
        assert board.ask("read_encoders").args[1 - side] == counted
    assert board.counter("unavailable") == 0


def test_a_position_is_counted_from_the_moment_of_the_request(pins):
    board = pins(**STRONG)
    for turn in range(1, 6):
        board.run(PERIOD_S + 4e-4)
        board.count(12)
        board.send("move_to_position", 1, 50, 12 * turn, wait_s=2 * PERIOD_S)
        assert not board.is_driven()


def test_the_stamp_of_counters_is_the_time_at_which_they_were_read(pins):
    board = pins(**STRONG)
    board.check(True)
    board.run(0.5)
    before = board.board.now_s / TICK_S
    stamp = board.ask("read_encoders", wait_s=5e-3).stamp
    assert before <= stamp.time <= board.board.now_s / TICK_S


# ---- periods


def test_the_right_wheel_is_served_although_the_left_one_rests(pins):
    """15 % lie between two levels, which change from period to period."""
    board = pins(**STRONG)
    board.send("move_motors", 0, 15)
    assert {right for _, right in board.levels(20)} == {38, 39}


@pytest.mark.parametrize("passes", range(1, 8))
def test_a_sample_that_comes_while_a_wheel_is_served_is_not_slept_over(pins, passes):
    """The loop stands still for a period, so many passes after a sample; the bench refuses a board that oversleeps."""
    board = pins()
    for passes_since in (passes, FEW):
        board.board.gap(board.board.now_s + PERIOD_S, b"")
        board.run(passes_since * PASS_S)
