"""Rows that move the motors: what the wheels do, and when such requests need a checksum."""

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME, COMMANDS
from sim_arduino.board.python_board import CHECK_SILENCE_S
from tests.scripted_line import ScriptedLine

SPEED_M_S = 0.01
"""How near a wheel comes to the speed that was asked for; an OMNI-3MD rounds, and an encoder's edges are 5 ms apart."""
REACHED_COUNTS = 3
POSITION_S = 4.0  # Longer than any positional move here
RELEASED_S = 0.005  # From the last bit of a request, or the end of the wait for one, to motors without drive
ROLL_OUT_S = 1.0
STRAIGHT_RAD = 0.02
DRIVE = ("move_differential", 200, 0)


def speeds(bench, name, *args):
    """True speeds of the wheels, long after a move [m/s]."""
    assert bench.ask(name, *args, wait_s=bench.ramped_s) == []
    return bench.wheels()


@pytest.mark.parametrize("left, right", [(40, -30), (-25, 50), (20, 0)])
def test_percent_of_full_speed_turns_each_wheel_at_its_share(bench, left, right):
    full = bench.full_speed_m_s()
    assert speeds(bench, "move_motors_pid", left, right) == pytest.approx(
        (left / 100 * full, right / 100 * full), abs=SPEED_M_S
    )


@pytest.mark.parametrize("left, right", [(-40, 30), (60, 60)])
def test_percent_of_full_duty_turns_each_wheel_its_way(bench, left, right):
    """The speed is that of a motor without control: below the share of full speed that the battery would give."""
    turned = speeds(bench, "move_motors", left, right)
    assert turned.left * left > 0 and turned.right * right > 0


@pytest.mark.parametrize("linear, angular", [(200, 1000), (300, 0), (-200, 0), (0, -1500)])
def test_drives_at_the_speed_that_was_asked_for(bench, linear, angular):
    half_m = 0.5 * bench.model.drive.wheel_separation_m
    turning = angular / 1000 * half_m
    wanted = linear / 1000 - turning, linear / 1000 + turning
    assert speeds(bench, "move_differential", linear, angular) == pytest.approx(wanted, abs=SPEED_M_S)


def test_a_drive_without_further_requests_goes_on(bench):
    bench.ask("move_differential", 200, 0, wait_s=3.0)
    before = bench.true_pose.x_m
    bench.run(1.0)
    assert bench.true_pose.x_m - before > 0.19


def test_speed_beyond_the_ceiling_is_clamped(bench):
    bench.write_config("linear_ceiling", 150)
    assert speeds(bench, "move_differential", 2000, 0) == pytest.approx((0.15, 0.15), abs=SPEED_M_S)
    assert bench.status().clamped == 1


@pytest.mark.parametrize(
    "ceiling, most, asked, linear_m_s, angular_rad_s",
    [("linear_ceiling", 200, (400, 2000), 0.2, 1.0), ("angular_ceiling", 1000, (100, -4000), 0.025, -1.0)],
)
def test_both_ceilings_keep_the_curvature(bench, ceiling, most, asked, linear_m_s, angular_rad_s):
    bench.write_config(ceiling, most)
    turn_m_s = 0.5 * bench.model.drive.wheel_separation_m * angular_rad_s
    turned = speeds(bench, "move_differential", *asked)
    assert turned == pytest.approx((linear_m_s - turn_m_s, linear_m_s + turn_m_s), abs=SPEED_M_S)


def test_a_reversal_ends_at_the_other_speed(bench):
    speeds(bench, *DRIVE)
    assert speeds(bench, "move_differential", -200, 0) == pytest.approx((-0.2, -0.2), abs=SPEED_M_S)


def test_stop_releases_the_motors_at_once(bench):
    speeds(bench, *DRIVE)
    bench.send(b"@13e", wait_s=0.0)
    sent_s = bench.now_s
    assert bench.run_until_released(0.1) - sent_s <= RELEASED_S
    bench.run(ROLL_OUT_S)
    assert bench.wheels() == (0.0, 0.0)


def test_a_stopped_robot_stays_where_it_is(bench):
    speeds(bench, *DRIVE)
    bench.ask("stop", wait_s=ROLL_OUT_S)
    before = bench.true_pose
    bench.run(2.0)
    assert bench.true_pose == before


def test_a_move_after_a_stop_drives_again(bench):
    speeds(bench, *DRIVE)
    bench.ask("stop")
    assert speeds(bench, *DRIVE) == pytest.approx((0.2, 0.2), abs=SPEED_M_S)
    assert bench.stop_reason() == "none"


def test_a_move_right_behind_a_stop_lasts(bench):
    """A prescaler keeps a motor board busy; the stop that is repeated afterwards stays ahead of the move."""
    bench.send(b"@3,2,1e@11,200,0e@13e@11,100,0e", wait_s=bench.ramped_s)
    assert bench.wheels() == pytest.approx((0.1, 0.1), abs=SPEED_M_S)
    assert bench.stop_reason() == "none"


@pytest.mark.parametrize("motor, position", [(1, 1200), (3, -1000), (3, 30)])
def test_a_positional_move_ends_at_its_count(bench, motor, position):
    assert bench.ask("move_to_position", motor, 50, position, wait_s=POSITION_S) == []
    right, left = bench.reply("read_encoders")
    reached, other = (left, right) if motor == 1 else (right, left)
    assert reached == pytest.approx(position, abs=REACHED_COUNTS) and other == pytest.approx(0, abs=1)


def test_a_positional_move_is_not_faster_than_its_speed(bench):
    bench.ask("preset_encoder", 1, -30000)
    bench.ask("move_to_position", 1, 20, 30000, wait_s=POSITION_S)
    assert bench.wheels().left <= 0.2 * bench.full_speed_m_s() + SPEED_M_S


def test_a_prescaled_counter_counts_a_tenth(bench):
    bench.ask("set_encoder_prescaler", 3, 1, wait_s=0.1)
    speeds(bench, *DRIVE)
    right, left = bench.reply("read_encoders")
    assert left > 1000 and right == pytest.approx(left / 10, rel=0.02)


@pytest.mark.parametrize("check", [True, False])
def test_a_greeting_ends_the_prescalers_of_another_program(bench, check):
    """Straight ahead, a wheel with a tenth of its counts is a turn.  The first request 32 is lost."""
    bench.ask("set_encoder_prescaler", 3, 1, wait_s=0.1)
    losses = [b""]
    line = ScriptedLine(bench.board)
    line.to_board = lambda data: losses.pop() if losses and b"@32," in data else data
    with SteppedDriver(line, bench.model, Options(check=check, virtual=bench.motors == "virtual")) as driver:
        driver.drive(0.2, 0.0)
        driver.wait(0.48)  # the command ends after 0.5 s
        assert driver.pose.x_m > 0.01 and driver.pose.yaw_rad == pytest.approx(0.0, abs=STRAIGHT_RAD)
    assert not losses


def test_reset_encoders_sets_both_counters_to_0(bench):
    bench.ask("preset_encoder", 1, 1234)
    bench.ask("preset_encoder", 3, -99)
    assert bench.ask("reset_encoders", wait_s=0.1) == []
    assert bench.reply("read_encoders") == (0, 0) and bench.counters() == {}


def test_counters_follow_the_wheels(bench):
    speeds(bench, *DRIVE)
    bench.ask("stop", wait_s=ROLL_OUT_S)
    right, left = bench.reply("read_encoders")
    way_m = bench.true_pose.x_m
    for count in (right, left):
        assert count * bench.model.drive.metres_per_count == pytest.approx(way_m, abs=1e-3)


def test_gains_are_parameters(bench):
    assert bench.ask("set_pid_gains", 900, 300, 10, wait_s=0.1) == []
    assert [bench.reply("read_config", index) for index in (5, 6, 7)] == [(5, 900), (6, 300), (7, 10)]


def test_other_gains_are_in_force_at_once(make):
    plain, changed = make(), make()
    changed.ask("set_pid_gains", 0, 0, 0, wait_s=0.1)
    plain.run(0.1)
    for bench in (plain, changed):
        bench.ask(*DRIVE, wait_s=1.0)
    assert abs(plain.wheels().left - changed.wheels().left) > 0.005


def test_a_longer_ramp_takes_longer(bench):
    bench.write_config("ramp_time", 8000)
    bench.ask("move_motors_pid", 50, 50, wait_s=1.0)
    assert bench.wheels().left < 0.3 * bench.full_speed_m_s()


MOVES = {
    "move_motors_pid": (20, 20),
    "move_motors": (20, 20),
    "move_differential": (200, 0),
    "move_to_position": (1, 20, 3000),
    "move_omni": (20, 0, 0),
}
DRIVE_S = 0.2
PLAIN_MOVES = [encode_request(BY_NAME[name].code, *args) for name, args in MOVES.items()]
SILENT_S = CHECK_SILENCE_S + 0.1


def is_set_going(bench, wire):
    """Whether a request turns a motor; afterwards the robot stands."""
    bench.send(wire, DRIVE_S)
    driven = bench.is_driven()
    bench.send(b"@13e", DRIVE_S)
    return driven


def after_silence(bench):
    """The host has turned checksums on, and was silent until the board has ended them."""
    bench.ask("set_check", 1)
    bench.run(SILENT_S)
    bench.checked = False
    return bench


def test_moves_and_calibrate_are_the_requests_that_turn_motors():
    assert {row.name for row in COMMANDS if row.turns} == {"calibrate", "move_twist", "move_wheels", *MOVES}


def test_no_other_request_turns_a_motor(bench):
    for row in COMMANDS:
        if not row.turns and row.name not in ("xbee_text", "set_baud"):
            bench.send(encode_request(row.code, *(field.high for field in row.request)))
            bench.send(encode_request(BY_NAME["set_check"].code, 0, checked=True))
            assert not bench.is_driven(), row.name


def test_a_host_of_2013_moves_without_a_checksum(omni3md):
    assert [is_set_going(omni3md, wire) for wire in PLAIN_MOVES] == [True] * len(MOVES)


def test_calibrate_needs_a_checksum_always(bench):
    assert not is_set_going(bench, b"@1e")
    assert bench.counters() == {"bad_check": 1}


def test_calibrate_with_its_checksum_turns_the_wheels(omni3md):
    assert is_set_going(omni3md, encode_request(1))


def test_once_the_host_has_asked_for_checksums_each_move_needs_one(bench):
    """Also after the board has ended them, because the host fell silent."""
    after_silence(bench)
    assert not any(is_set_going(bench, wire) for wire in PLAIN_MOVES)
    assert bench.counters() == {"bad_check": len(MOVES)}


def test_after_the_silence_a_move_with_a_checksum_drives(bench):
    after_silence(bench)
    assert is_set_going(bench, encode_request(BY_NAME["move_differential"].code, 200, 0, checked=True))


def test_other_requests_need_none_after_the_silence(bench):
    assert after_silence(bench).reply("read_encoders") == (0, 0)


def test_a_host_that_turns_checksums_off_moves_without_them(bench):
    bench.ask("set_check", 1)
    bench.send(encode_request(BY_NAME["set_check"].code, 0, checked=True))
    bench.checked = False
    assert is_set_going(bench, b"@11,200,0e")


def test_a_reset_ends_the_need_of_checksums(bench):
    after_silence(bench)
    bench.board.reset()
    bench.run(0.5)
    assert is_set_going(bench, b"@11,200,0e")


def test_a_parameter_lets_hosts_of_2013_calibrate(omni3md):
    omni3md.write_config("plain_calibrate", 1)
    assert is_set_going(omni3md, b"@1e") and is_set_going(omni3md, encode_request(1))


def test_the_parameter_counts_until_the_host_asks_for_checksums(omni3md):
    omni3md.write_config("plain_calibrate", 1)
    after_silence(omni3md)
    assert not is_set_going(omni3md, b"@1e")
