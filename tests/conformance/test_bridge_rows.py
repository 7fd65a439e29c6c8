"""Boards with an H-bridge: what they refuse, what stops them, and what their own parameters do."""

import pytest

from mrl_driver.protocol.table import BRIDGES, FAULTS, RESET_CAUSES, WIRING

from .bench import BLANK

WIRING_FAULT = 1 << [name for name, _ in FAULTS].index("wiring")
BITS = {name: 1 << bit for bit, (name, _) in enumerate(WIRING)}
DRIVE_S = 1.0
SPEED_M_S = 0.01
CORRECT = 1  # Wires as in HARDWARE.md
ENCODER_S = 0.1  # Longest time from the first wrong edge, or from drive without any edge, to the stop
MOVES = [
    ("move_motors_pid", (30, 30)),
    ("move_motors", (30, 30)),
    ("move_differential", (100, 0)),
    ("move_to_position", (1, 50, 1000)),
]
REFUSED = [
    ("calibrate", ()),
    ("move_omni", (30, 0, 90)),
    ("preset_encoder", (2, 1)),
    ("set_encoder_prescaler", (2, 0)),
    ("move_twist", (1, 3, 32767)),
]


# ---- what is refused


@pytest.mark.parametrize("name, args", REFUSED)
def test_what_two_motors_cannot_do_is_unavailable(bench, name, args):
    assert bench.ask(name, *args) == []
    assert bench.counters() == {"unavailable": 1} and not bench.is_driven()


UNSET = [{"wiring": 0}, {"wiring": BITS["motors_swapped"]}, {"bridge": 0}]


@pytest.mark.parametrize("name, args", MOVES)
@pytest.mark.parametrize("stored", UNSET, ids=str)
def test_without_bridge_and_wiring_moves_are_refused(make, stored, name, args):
    bench = make(stored=stored)
    assert bench.ask(name, *args, wait_s=0.1) == []
    assert bench.counters() == {"unavailable": 1}
    assert not bench.is_driven() and bench.status().faults == WIRING_FAULT


def test_without_wiring_counters_can_be_read(make):
    assert make(stored={"wiring": 0}).reply("read_encoders") == (0, 0)


def test_a_blank_eeprom_has_no_wiring(make):
    bench = make(eeprom=BLANK)
    bench.ask("move_differential", 100, 0)
    assert bench.status().faults & WIRING_FAULT and bench.counters() == {"unavailable": 1}


@pytest.mark.parametrize("name, args", MOVES)
def test_a_wiring_that_is_written_is_in_force_at_once(make, name, args):
    bench = make(stored={"wiring": 0})
    bench.write_config("wiring", CORRECT)
    bench.ask(name, *args, wait_s=0.1)
    assert bench.is_driven() and bench.counters() == {}
    bench.status()  # reads the fault that has been
    assert bench.status().faults == 0


@pytest.mark.parametrize("name, value", [("wiring", 0), ("bridge", 0), ("wiring", CORRECT)])
def test_a_change_of_the_wires_stops_the_motors(bench, name, value):
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.write_config(name, value)
    assert not bench.is_driven()


def test_numbers_that_cannot_be_controlled_refuse_moves(make):
    bench = make(stored={"gearbox": 1, "encoder_counts": 1})
    bench.ask("move_differential", 100, 0)
    assert bench.status().faults == WIRING_FAULT and not bench.is_driven()


# ---- bridges and wires


@pytest.mark.parametrize("chip", [number for number in range(1, len(BRIDGES))], ids=lambda n: BRIDGES[n])
def test_each_bridge_drives_both_ways_and_stops(make, chip):
    bench = make(board={"bridge": chip})
    bench.ask("move_differential", 0, 1000, wait_s=DRIVE_S)
    half_m = 0.5 * bench.model.drive.wheel_separation_m
    assert bench.wheels() == pytest.approx((-half_m, half_m), abs=SPEED_M_S)
    bench.ask("stop", wait_s=1.0)
    assert bench.wheels() == (0.0, 0.0)


@pytest.mark.parametrize(
    "names",
    [
        (),
        ("motors_swapped", "encoders_swapped"),
        ("left_motor_reversed", "left_encoder_reversed"),
        ("motors_swapped", "right_motor_reversed", "encoders_swapped", "right_encoder_reversed"),
        ("motors_swapped", "left_motor_reversed", "encoders_swapped", "left_encoder_reversed"),
        ("right_encoder_reversed",),
        ("single_channel",),
    ],
    ids="+".join,
)
def test_wires_that_the_board_knows_drive_the_right_wheels(make, names):
    """However the kit is wired: a turn to the left, and counters with the wheels' signs."""
    wiring = CORRECT + sum(BITS[name] for name in names)
    bench = make(wiring=wiring, stored={"wiring": wiring})
    bench.ask("move_differential", 100, 1000, wait_s=DRIVE_S)
    half_m = 0.5 * bench.model.drive.wheel_separation_m
    assert bench.wheels() == pytest.approx((0.1 - half_m, 0.1 + half_m), abs=SPEED_M_S)
    right, left = bench.reply("read_encoders")
    assert right > 400 and (left > 100) == (0.1 > half_m) and abs(left) > 100


# ---- what stops the motors


@pytest.mark.parametrize("wheel, linear", [(0, 200), (1, -20)])
def test_an_encoder_that_counts_in_the_wrong_direction_stops_the_motors(make, wheel, linear):
    """Within 100 ms of the first wrong edge."""
    bench = make(wiring=CORRECT + BITS[("left_encoder_reversed", "right_encoder_reversed")[wheel]])
    bench.ask("move_differential", linear, 0, wait_s=0.02)
    while abs(bench.wheels()[wheel]) < 0.003:
        bench.run(1e-3)
    turning_s = bench.now_s
    assert bench.run_until_released(1.0) - turning_s <= ENCODER_S + 0.02
    assert bench.stop_reason() == "encoder"


def test_open_loop_moves_bear_reversed_encoders(make):
    """`mrl calibrate wiring` turns motors whose encoders it does not know yet."""
    bench = make(wiring=CORRECT + BITS["left_encoder_reversed"])
    bench.ask("move_motors", 30, 30, wait_s=0.5)
    assert bench.wheels().left > 0.1 and bench.stop_reason() == "none"


@pytest.mark.parametrize("linear, angular", [(300, 0), (5, 0), (0, 3000)])
def test_sound_wheels_do_not_stop(bench, linear, angular):
    for sign in (1, -1, 1):
        bench.ask("move_differential", sign * linear, sign * angular, wait_s=0.7)
    assert bench.stop_reason() == "none"


def test_a_wheel_that_still_rolls_after_a_reversal_is_not_a_wrong_encoder(make):
    """It coasts for over 100 ms against a drive that is too weak to turn it back."""
    weak = {"stop_mode": 1, "kp": 0, "ki": 0, "friction_duty": 0, "ramp_time": 0}
    bench = make(board={"bridge": BRIDGES.index("vnh5019"), **weak})
    bench.ask("move_differential", 500, 0, wait_s=0.8)
    bench.ask("move_differential", -20, 0, wait_s=0.15)
    assert bench.wheels().left > 0.05
    assert bench.is_driven() and bench.stop_reason() == "none"


@pytest.mark.parametrize("wheel, channels", [(0, (0, 1)), (1, (0,))])
def test_a_silent_encoder_or_channel_stops_the_motors(bench, wheel, channels):
    for channel in channels:
        bench.plant.bridge.encoders[wheel].open(channel, True)
    bench.ask("move_differential", 200, 0, wait_s=0.1)
    assert bench.is_driven()
    bench.run_until_released(1.5)
    assert bench.stop_reason() == "encoder"


def test_an_encoder_line_that_oscillates_stops_the_motors(bench):
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.plant.bridge.encoders[1].open(0, True, 100e3)
    bench.run_until_released(0.1)
    assert bench.stop_reason() == "encoder"


@pytest.fixture
def freed(bench):
    """A board that has stopped the motors, because a wheel was blocked; the wheel turns again."""
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.plant.bridge.motor(0).blocked = True
    bench.run_until_released(2.0)
    assert bench.stop_reason() == "wheel_blocked"
    bench.plant.bridge.motor(0).blocked = False
    return bench


def test_a_blocked_wheel_stops_the_motors_and_moves_are_refused_for_a_second(freed):
    freed.ask("move_differential", 200, 0, wait_s=0.5)
    assert freed.counters() == {"unavailable": 1} and not freed.is_driven()
    freed.run(0.5)
    freed.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    assert freed.is_driven() and freed.stop_reason() == "none"


@pytest.mark.parametrize("request_", [("stop",), ("move_differential", 0, 0)], ids=["stop", "speed_zero"])
def test_a_stop_by_the_host_or_speed_zero_ends_that_second(freed, request_):
    freed.ask(*request_)
    freed.ask("move_differential", 200, 0, wait_s=0.2)
    assert freed.is_driven() and freed.counters() == {}


MEASURED = {"battery_divider": 3000, "undervoltage": 1000}
BATTERY_S = 0.4  # Two means of the battery's voltage


def test_undervoltage_stops_the_motors(make):
    bench = make(board=MEASURED)
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.plant.robot.sag(4.0)
    bench.run_until_released(BATTERY_S)
    assert bench.stop_reason() == "undervoltage"


def test_below_the_voltage_moves_are_refused_until_it_is_back(make):
    bench = make(board=MEASURED)
    bench.plant.robot.sag(4.0)
    bench.run(BATTERY_S)
    bench.ask("move_differential", 200, 0)
    bench.plant.robot.sag(bench.plant.bridge.battery_v + 4.0 - 10.3)  # it must recover by a sixteenth
    bench.run(BATTERY_S)
    bench.ask("move_differential", 200, 0)
    assert bench.counters() == {"unavailable": 2}
    bench.plant.robot.sag(0.0)
    bench.run(BATTERY_S)
    bench.ask("move_differential", 200, 0)
    assert bench.is_driven()


# ---- readings


def test_robot_info_is_0_for_what_is_not_measured(bench):
    assert bench.reply("robot_info") == (0, 0, 0, 2, bench.model.ids[0])


def test_a_divider_measures_the_battery(make):
    bench = make(board=MEASURED, battery_v=11.4)
    bench.run(BATTERY_S)
    assert bench.reply("robot_info")[2] == pytest.approx(1140, abs=3)
    assert bench.reply("read_protocol")[1] & 1024 == 0


def test_status_counts_impossible_transitions(bench):
    assert bench.reply("read_status")[6:] == (0,)


def test_the_third_counter_of_the_omni_stream_is_0(bench):
    events = bench.ask("start_omni_stream", 20, wait_s=0.1)
    assert {event.args[:3] for event in events} == {(0, 0, 0)}


# ---- parameters


COASTING = [name for name in BRIDGES if name != "cytron"]  # A BTS7960 can with a wire to its enable


@pytest.mark.parametrize("mode", [0, 1])
@pytest.mark.parametrize("chip", BRIDGES[1:])
def test_a_stop_brakes_or_coasts_if_the_chip_can_and_may(make, chip, mode):
    bench = make(board={"bridge": BRIDGES.index(chip)}, stored={"stop_mode": mode})
    bench.ask("move_motors", 60, -60, wait_s=0.1)
    bench.ask("stop")
    shares = [bench.plant.bridge.motor(wheel).shares for wheel in (0, 1)]
    coasts = chip == "l298p" or (mode == 1 and chip in COASTING)
    assert [each.coast if coasts else each.brake for each in shares] == [1.0, 1.0]


def test_a_position_is_reached_with_a_ramp_without_going_beyond(make):
    """The ramp limits how fast the wheel becomes faster, not how fast it becomes slower."""
    bench, counts = make(stored={"ramp_time": 3000}), []
    bench.ask("move_to_position", 1, 100, 1500)
    for _ in range(300):
        bench.run(0.01)
        counts.append(bench.plant.bridge.motor(0).travel)
    assert max(counts) < 1510 and counts[-1] > 1490


def test_a_reversal_rests_at_zero(make):
    bench = make(stored={"reversal_pause": 300, "ramp_time": 0})
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.ask("move_differential", -200, 0, wait_s=0.0)
    bench.run_until_released(0.1)
    bench.run(0.29)
    assert not bench.is_driven()
    bench.run(0.05)
    assert bench.is_driven() and bench.wheels().left < 0.0


# ---- resets


def test_a_brown_out_is_a_reset_without_drive(bench):
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.brown_out()
    bench.run(0.6)
    assert not bench.is_driven()
    assert RESET_CAUSES[bench.status().reset_cause] == "brown_out"


def test_during_a_reset_no_motor_is_driven(bench):
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.board.reset()
    bench.run(0.002)
    assert not bench.is_driven()


# ---- what a move keeps to


def test_a_mended_encoder_counts_again(bench):
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.plant.bridge.encoders[1].open(0, True, 100e3)
    bench.run_until_released(0.1)
    bench.plant.bridge.encoders[1].open(0, False)
    bench.ask("stop")
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    assert bench.wheels() == pytest.approx((0.2, 0.2), abs=SPEED_M_S)


def test_a_wheel_beyond_full_speed_slows_both_down_alike(make):
    """0.125 and 0.875 m/s are asked for, and a wheel can turn at 0.579 m/s without load."""
    bench = make()
    bench.ask("move_differential", 500, 5000, wait_s=DRIVE_S)
    left, right = bench.wheels()
    assert right > 0.5 and left / right == pytest.approx(0.125 / 0.875, abs=0.03)


def test_the_same_direction_needs_no_pause(make):
    bench = make(stored={"reversal_pause": 1000, "ramp_time": 0})
    bench.ask("move_differential", 200, 0, wait_s=DRIVE_S)
    bench.ask("move_differential", 0, 0, wait_s=0.1)
    bench.ask("move_differential", 200, 0, wait_s=0.05)
    assert bench.is_driven()


def test_a_wheel_at_its_count_is_not_driven(bench):
    bench.ask("move_to_position", 1, 50, 1200, wait_s=4.0)
    for _ in range(100):
        bench.run(5e-3)
        assert not bench.is_driven() and bench.wheels() == (0.0, 0.0)
