"""Bridges: truth tables, the way from the board's outputs to its inputs, and slices of time of a simulated chip."""

import math
from collections import defaultdict

import pytest

from mrl_driver.errors import SimulatorError
from mrl_driver.protocol import REPLIES, FrameDecoder
from mrl_driver.protocol.table import BRIDGES as NAMES
from mrl_driver.protocol.table import NOT_CONNECTED, WIRING
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P
from sim_arduino.board import PythonBoard, parameter_store
from sim_arduino.board.avr_board import BridgeWires
from sim_arduino.board.bridge_control import BATTERY_PERIOD_S, CONVERSIONS, MISSED_KICK_S, BatteryInput
from sim_arduino.board.parameter_store import Config
from sim_arduino.hardware.bridge import BRIDGES, Shares
from sim_arduino.hardware.bridge_plant import TOGGLE_S, TOGGLES, motor_params
from sim_arduino.hardware.omni3md import ADDRESS
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.models import DUO_PINS, ENCODER_PINS, bridged, model, wired_eeprom

BIT = {name: 1 << number for number, (name, _) in enumerate(WIRING)}
BRAKE = (1.0, 1.0, 1.0)


def plant_of(*wires, **options):
    return Plant(bridged(), wiring=sum(BIT[name] for name in wires), **options)


def drive(plant, left, right, seconds=1.0, share=1.0):
    """Drives the board's two motors with these signs for a time; returns the edges by pin."""
    bridge = plant.bridge
    for motor, sign in enumerate((left, right)):
        wires = (share, 1.0, 0.0) if sign > 0 else (share, 0.0, 1.0)
        bridge.write(bridge.time_s, motor, *(wires if sign else BRAKE))
    plant.advance(bridge.time_s + seconds)
    return bridge.take_edges()


def counts(edges):
    """What a board counts at its two encoder inputs, which both begin low."""
    found = []
    for pins in ENCODER_PINS:
        levels, count = dict.fromkeys(pins, 0), 0
        for edge in edges:
            if edge.pin in pins:
                levels[edge.pin] = edge.level
                a, b = (levels[pin] for pin in pins)
                count += 1 if (edge.pin == pins[0]) == (a != b) else -1
        found.append(count)
    return found


def test_the_encoders_count_what_the_wheels_turned():
    plant = plant_of()
    edges = drive(plant, 1, -1, 0.5)
    expected = [round(plant.bridge.motor(wheel).travel) for wheel in (0, 1)]
    assert counts(edges) == expected
    assert expected[0] > 1000 and expected[1] < -1000


def test_the_data_of_a_motor_and_its_load_give_its_equations():
    """12 V and 170 turns a minute: 1.2 A at stall and 0.05 A without load; 1.2 kg on two wheels of 65 mm."""
    wheel_m, per_rad, rad_s = (
        DUO.drive.metres_per_count * 1496 / math.tau,
        1496 / math.tau,
        170 * math.tau / 60,
    )
    newton_metres_per_a = 8.9 / rad_s / 1.15
    per_newton_metre = per_rad / (0.37 / rad_s**2 + 0.6 * wheel_m**2)
    friction = (0.05 * newton_metres_per_a + 0.03 * 0.6 * 9.81 * wheel_m) * per_newton_metre
    acceleration = newton_metres_per_a * per_newton_metre
    expected = (10.5, 11.5 / rad_s / per_rad, acceleration, friction, 1.5 * friction, 0.0)
    assert motor_params(bridged()) == pytest.approx(expected, rel=1e-3)


def test_a_wiring_that_was_stored_with_other_settings_is_not_in_force():
    """The power was cut while both were saved."""
    own, other = wired_eeprom(), wired_eeprom(bridge=NAMES.index("cytron"))
    at, rows = parameter_store.PINS_AT, wiring.rows(ATMEGA328P)
    assert Config(bytearray(own), rows).pins == wiring.of_board(DUO_PINS)
    assert Config(bytearray(other[:at] + own[at:]), rows).pins == wiring.of_board(wiring.EMPTY)


def test_a_robot_with_bridges_has_no_omni3md():
    plant = plant_of()
    assert ADDRESS not in plant.i2c
    with pytest.raises(SimulatorError, match="has H-bridges"):
        plant.motor_board  # noqa: B018


LEVELS = [f"{bits:03b}" for bits in range(8)]
TABLES = {
    "vnh5019": "coast coast coast brake brake backward forward brake",
    "cytron": "brake brake brake brake forward backward forward backward",
    "l298n": "coast coast coast coast brake backward forward brake",
    "tb6612": "coast brake brake brake coast backward forward brake",
    "drv8833": "coast coast coast backward coast forward coast brake",
    "bts7960": "coast brake coast backward coast forward coast brake",
    "l298n_enable": "coast coast coast coast brake backward forward brake",
    **dict.fromkeys(("l298p", "l298p_brake"), "coast coast coast coast forward backward brake brake"),
}
"""States at 000, 001, ... 111 of the wires PWM_A, PWM_B, LOGIC, copied from the data sheets named in `bridge.py`."""


def bridge(name):
    return BRIDGES[NAMES.index(name)]


@pytest.mark.parametrize("name", TABLES)
def test_the_states_are_those_of_the_data_sheet(name):
    assert [bridge(name).state(levels) for levels in LEVELS] == TABLES[name].split()


FORWARD = {
    **dict.fromkeys(("cytron", "l298p", "l298p_brake"), (0.0, 0.0)),
    **dict.fromkeys(("drv8833", "bts7960"), (0.0, 1.0)),
}
"""Wires B and LOGIC for a drive forward; the other bridges need B high."""
BETWEEN = dict.fromkeys(("vnh5019", "l298n", "l298n_enable", "l298p", "l298p_brake", "drv8833"), "coast")
"""What these bridges do between two pulses; the others brake."""


@pytest.mark.parametrize("name", TABLES)
def test_between_two_pulses_a_bridge_brakes_or_coasts(name):
    shares = bridge(name).shares(0.3, *FORWARD.get(name, (1.0, 0.0)))._asdict()
    expected = dict.fromkeys(shares, 0.0)
    expected.update({"forward": 0.3, BETWEEN.get(name, "brake"): 0.7})
    assert shares == pytest.approx(expected)


def test_an_inverted_pulse_beside_a_high_input_brakes_between():
    """Slow decay of a DRV8833: both wires of one timer rise together."""
    assert bridge("drv8833").shares(1.0, 0.7, 1.0) == pytest.approx(Shares(0.3, 0.0, 0.7, 0.0))


MHZ = 16000000
MS = 16000


class Chip:
    """A chip whose outputs are high for fixed shares of time; notes what is planned at its inputs."""

    frequency_hz = MHZ
    overshoot = 3

    def __init__(self):
        self.cycle, self.duties, self.levels, self.edges, self.stalled = 0, {}, {}, [], 0
        self.high = defaultdict(float)

    def run_until(self, cycle):
        """Like the real one, it stops some cycles late."""
        self.passed(cycle + self.overshoot - self.cycle)

    def passed(self, cycles):
        self.cycle += cycles
        for pin, duty in self.duties.items():
            self.high[pin] += duty * cycles

    def stall_until(self, cycle):
        self.stalled += cycle - self.cycle
        self.cycle = cycle

    def high_cycles(self, pin):
        return self.high[pin]

    def set_pin(self, pin, level):
        self.levels[pin] = level

    def plan_edges(self, pin, cycles):
        self.edges += [(cycle, pin, self.cycle) for cycle in cycles]


@pytest.fixture
def rig():
    plant = Plant(bridged())
    chip = Chip()
    return chip, plant, BridgeWires(chip, plant.bridge)


def full(chip):
    chip.duties = {5: 1.0, 6: 1.0, 7: 0.0, 11: 1.0, 3: 1.0, 9: 0.0}


def test_edges_are_planned_ahead_of_the_chip_and_none_is_missing(rig):
    """At most one slice ahead, in order for each pin, as many as the wheels turned."""
    chip, plant, wires = rig
    full(chip)
    wires.run(500 * MS, chip.run_until)
    assert all(now <= cycle <= now + MS for cycle, _, now in chip.edges)
    for pin in (2, 4, 8, 10):
        cycles = [cycle for cycle, its, _ in chip.edges if its == pin]
        assert cycles == sorted(cycles)
    turned = plant.bridge.motor(0).travel + plant.bridge.motor(1).travel
    assert len(chip.edges) == pytest.approx(turned, abs=2) and turned > 100


def test_slices_do_not_depend_on_how_the_engine_is_called():
    ends = []
    for step in (MS // 3, 7 * MS, 250 * MS):
        plant, chip = Plant(bridged()), Chip()
        chip.overshoot = 0
        wires = BridgeWires(chip, plant.bridge)
        full(chip)
        for cycle in range(0, 250 * MS + 1, step):
            wires.run(cycle, chip.run_until)
        wires.run(250 * MS, chip.run_until)
        ends.append((plant.bridge.motor(0).travel, len(chip.edges)))
    assert ends[0] == ends[1] == ends[2]


DUO = model("duo")
ROLL_OUT_S = 0.3


def config(**changed):
    found = Config(bytearray(parameter_store.image(parameter_store.first(DUO.ids[0], DUO))))
    for name, value in changed.items():
        found[name] = value
    return found


@pytest.fixture
def driving():
    board = PythonBoard(Plant(DUO, World()))
    board.advance(0.1)
    board.receive(b"@11,200,0e")
    board.advance(2.1)
    return board


def is_driven(board):
    return any(motor.shares.forward or motor.shares.backward for motor in board.plant.robot.motors)


def test_the_watchdog_switches_the_outputs_of_a_standing_program_off(driving):
    before_m = driving.plant.true_pose.x_m
    driving.gap(10.0, b"")
    way_m = driving.plant.true_pose.x_m - before_m
    assert 0.2 * MISSED_KICK_S < way_m < 0.2 * (MISSED_KICK_S + ROLL_OUT_S) and not is_driven(driving)


def test_counts_go_on_while_the_program_stands_still(driving):
    """The encoders' interrupts and the sampling go on, so that none is masked."""
    driving.gap(10.0, b"")
    driving.receive(b"@6e")
    (reply,) = FrameDecoder(REPLIES).feed(driving.advance(11.0))
    assert reply.args[1] * DUO.drive.metres_per_count == pytest.approx(driving.plant.true_pose.x_m, abs=1e-3)


def test_the_battery_is_the_mean_of_16_conversions():
    counts = iter(range(500, 1000))
    battery = BatteryInput(config(battery_divider=4000), lambda channel: next(counts), 0.0)
    battery.channel = 3
    battery.run(BATTERY_PERIOD_S * CONVERSIONS - 1e-6)
    assert not battery.measured
    battery.run(BATTERY_PERIOD_S * CONVERSIONS + 1e-6)
    assert battery.measured and battery.centivolts == int(507.5 / 1024 * 500 * 4.0)


# ---- wires on other pins

LED, A0 = ATMEGA328P.led, ATMEGA328P.analog
ELSEWHERE = {
    **dict(left_pwm_a=9, left_pwm_b=A0, left_logic=LED, right_pwm_a=10, right_pwm_b=12, right_logic=7),
    **dict(left_encoder_a=A0 + 4, left_encoder_b=5, right_encoder_a=3, right_encoder_b=NOT_CONNECTED),
    **dict(battery=A0 + 5, sonar_front=A0 + 1, sonar_left=NOT_CONNECTED, sonar_right=NOT_CONNECTED),
    **dict(sonar_trigger=2, sonar_power=4),
}
AHEAD = (1.0, 1.0, 0.0)


def elsewhere(chip="tb6612", **pins):
    board = {f"pin_{name}": pin for name, pin in {**ELSEWHERE, **pins}.items()}
    return Plant(bridged(chip, **board), World())


def states(bridge):
    """What the left and the right motor do all the time."""
    shares = [bridge.motor(wheel).shares._asdict() for wheel in (0, 1)]
    return [next(name for name, share in each.items() if share == 1.0) for each in shares]


def test_the_chips_pins_drive_the_wires_and_edges_come_out_at_the_pins_of_the_encoders():
    """The right encoder has one channel."""
    plant, chip = elsewhere(), Chip()
    wires = BridgeWires(chip, plant.bridge)
    chip.duties = {9: 1.0, LED: 1.0, 10: 1.0, 12: 1.0, 6: 1.0}
    wires.run(500 * MS, chip.run_until)
    assert states(plant.bridge) == ["backward", "forward"]
    assert {pin for _, pin, _ in chip.edges} == {A0 + 4, 5, 3}


@pytest.mark.parametrize(
    "bridge, wire, high",
    [("l298n", "pwm_a", (0, 1, 0)), ("drv8833", "logic", (1, 0, 0)), ("bts7960", "logic", (1, 0, 0))],
)
def test_an_enable_is_high_unless_it_is_on_a_pin_that_is_an_input(bridge, wire, high):
    plant = elsewhere(bridge, **{f"left_{wire}": NOT_CONNECTED})
    for motor in (0, 1):
        plant.bridge.write(0.0, motor, *high)
    assert states(plant.bridge) == ["forward", "coast"]


def test_analog_pins_are_those_of_the_table():
    plant = elsewhere()
    plant.pin_changed(4, 1, 0.0)
    plant.pin_changed(2, 1, 0.0)
    plant.advance(1.0)
    volts = [plant.adc_volts(channel, 1.0) for channel in range(6)]
    assert volts[1] > 0 and volts[5] == pytest.approx(plant.bridge.battery_v / 4.0)
    assert volts[0] == volts[2] == volts[3] == volts[4] == 0


@pytest.mark.parametrize("pins, needed_s", [({}, TOGGLES * TOGGLE_S), ({"left_logic": 8}, 0)])
def test_after_a_reset_by_the_host_the_bootloader_toggles_a_motor_wire_on_the_leds_pin(pins, needed_s):
    """A tb6612 with one input high and PWM low brakes; the board's program drives nothing meanwhile."""
    bridge = elsewhere(**pins).bridge
    bridge.write(0.0, 0, *AHEAD)
    assert bridge.boot(0.0) == needed_s
    found = []
    for number in range(1, 2 * TOGGLES):
        bridge.advance(TOGGLE_S * (0.5 * number + 0.25))
        if bridge.is_booting:
            bridge.write(bridge.time_s, 0, *AHEAD)
        found.append(states(bridge)[0])
    toggled = ["coast", "brake", "brake", "coast"] * TOGGLES
    assert found == (toggled[: 2 * TOGGLES - 1] if needed_s else ["coast"] * (2 * TOGGLES - 1))


def test_the_chip_stands_still_while_the_bootloader_moves_a_motor_wire():
    chip, bridge = Chip(), elsewhere().bridge
    wires = BridgeWires(chip, bridge)
    chip.duties = dict.fromkeys((9, A0, 10, 12), 1.0)
    bridge.boot(bridge.time_s)
    wires.run(int(1.5 * TOGGLES * TOGGLE_S * MHZ), chip.run_until)
    assert chip.stalled == pytest.approx(TOGGLES * TOGGLE_S * MHZ, abs=2 * MS)
    assert states(bridge) == ["forward", "forward"]


def test_a_python_board_answers_after_its_bootloader():
    plant = elsewhere()
    board = PythonBoard(plant, DUO.ids[0])
    board.advance(0.1)
    board.reset()
    board.receive(b"@6e")
    early = board.advance(0.1 + TOGGLES * TOGGLE_S)
    board.receive(b"@6e")
    assert b"@6," not in early and b"@6," in board.advance(0.2 + TOGGLES * TOGGLE_S)
