"""What stops the motors when nobody says so, and what the host reads about it afterwards."""

import ctypes
from unittest import mock

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME, FAULTS, RESET_CAUSES, TICK_S
from mrl_driver.robot import models
from sim_arduino.hardware.wiring import Plant
from tests.firmware import pc_board

STOP = b"\xfc\xaa\x55"
FAULT = {name: 1 << bit for bit, (name, _) in enumerate(FAULTS)}
REACTION_S = 1e-3


@pytest.mark.parametrize("period_ms", [50, 250, 1000, 10000])
def test_link_watchdog_stops_in_time(bench, period_ms):
    board = bench()
    board.send("set_watchdog", period_ms)
    board.forget()
    board.raw(b"@11,100,0e", wait_s=0.0)
    heard_s = board.board.now_s + 10 * 10 / 115200
    board.run(period_ms * 1e-3 + 0.05)
    stopped_s = board.write_times(0xFC)[0]
    assert period_ms * 1e-3 <= stopped_s - heard_s + TICK_S <= period_ms * 1e-3 + REACTION_S


def test_link_watchdog_watches_again_after_it_has_stopped_the_motors(bench):
    board = bench()
    board.send("set_watchdog", 50)
    for _ in range(2):
        board.forget()
        board.send("move_differential", 100, 0, wait_s=0.1)
        assert board.writes()[-1] == STOP


def test_watchdog_across_the_wrap_of_the_clock(bench):
    """The 16-bit clock wraps 10 ms after the last frame: neither a false stop nor a missed one."""
    board = bench(first_tick=65536 - int(0.13 / TICK_S))
    board.send("set_watchdog", 100)
    board.forget()
    board.run(0.06)
    early = board.writes()
    board.run(0.1)
    assert (early, board.writes()) == ([], [STOP])


def test_half_a_frame_from_before_a_stall_is_forgotten(bench):
    board = bench()
    board.raw(b"@11,100,", wait_s=0.01)
    board.board.gap(board.board.now_s + 0.3, b"")
    board.forget()
    board.raw(b"0e", wait_s=0.02)
    assert not board.writes(0xEB)


def test_a_stall_is_not_silence_of_the_host(bench):
    """Check mode ends after 2 s without a frame; a loop that stood still for longer has not listened."""
    board = bench()
    board.check(True)
    board.board.gap(board.board.now_s + 2.5, b"")
    board.run(1.9)
    assert board.ask("get_stream").args == (0,)


def test_a_request_at_once_is_answered_at_once(bench):
    """Within the 300 ms that a host may wait, with room to spare."""
    board = bench(boot=False)
    board.raw(b"@5e", wait_s=0.02)
    assert board.frames()[0].code == 5


@pytest.mark.parametrize(
    "flags, cause",
    [
        (pc_board.POWER_ON, "power_on"),
        (pc_board.EXTERNAL | pc_board.KEPT, "external"),
        (pc_board.BROWN_OUT | pc_board.KEPT, "brown_out"),
        (pc_board.WATCHDOG | pc_board.KEPT, "watchdog"),
        (pc_board.MARKED | pc_board.KEPT, "watchdog"),
        (pc_board.KEPT, "external"),
        (0, "power_on"),
    ],
)
def test_reset_cause(bench, flags, cause):
    """The last three are behind a bootloader that clears the chip's flags."""
    board = bench(reset_flags=flags)
    assert RESET_CAUSES[board.field("read_status", "reset_cause")] == cause


@pytest.mark.parametrize("request_name", ["", "start_stream"])
def test_motor_boards_timeout_is_fed(bench, request_name):
    """Traffic at least every 100 ms, the shortest timeout there is, idle and behind a full-rate stream."""
    board = bench()
    if request_name:
        board.send(request_name)
    board.forget()
    board.run(2.0)
    times = [t for t, *_ in board.board.transfers]
    assert max(later - earlier for earlier, later in zip(times, times[1:])) < 0.09


def flap(board, times):
    """A loose wire: the motor board is there for 0.2 s, and gone for 0.2 s."""
    for _ in range(times):
        for present in (True, False):
            board.plant.motor_board.present = present
            board.run(0.2)


def test_a_motor_board_that_comes_and_goes_is_set_up_once_a_second_at_most(bench):
    """Each set-up writes its EEPROM, which bears 100 000 of them."""
    board = bench()
    flap(board, 10)
    board.forget()
    flap(board, 40)
    assert 1 <= len(board.writes(0xEA)) <= 16


def test_a_question_for_counts_is_given_up_when_the_motor_board_is_lost(bench):
    """The move before it uses up the attempts; the next question is answered."""
    board = bench()
    board.board.nack = lambda address, data: True
    board.raw(b"@11,100,0e@6e", wait_s=0.03)
    assert board.ask("get_stream").args == (0,)


def test_a_stop_asks_at_once_for_a_motor_board_that_was_lost(bench):
    board = bench()
    flap(board, 10)
    board.run(1.2)
    board.forget()
    board.plant.motor_board.present = True
    board.raw(b"@13e", wait_s=0.004)
    assert board.writes()[0] == STOP


def test_a_lost_motor_board_has_neither_voltage_nor_version(bench):
    board = bench()
    board.plant.motor_board.present = False
    board.run(0.3)
    assert board.ask("robot_info").args[:3] == (0, 0, 0)


def refuse(board, code, times):
    """The motor board refuses this command so many times."""
    left = [True] * times
    board.board.nack = lambda address, data: data[0] == code and bool(left) and left.pop()


def test_a_stop_drops_the_move_that_hangs_on_the_bus(bench):
    """It comes after the move has begun, and before that is taken for hung."""
    board = bench()
    board.board.hang_bus(True, recoveries=1)
    board.raw(b"@11,100,0e", wait_s=0.003)
    board.raw(b"@13e", wait_s=0.1)
    assert board.writes() == [STOP]


PARTS = {"geometry": 0xEA, "gains": 0xF4, "ramp": 0xEC, "timeout": 0xF1, "prescaler": 0xF0}


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_a_part_of_the_set_up_that_was_refused_is_sent_again(bench, part):
    board = bench()
    board.plant.motor_board.present = False
    board.run(0.2)
    board.forget()
    board.plant.motor_board.present = True
    refuse(board, part, 1)
    board.run(0.3)
    assert sorted(data[0] for data in board.writes()) == sorted([*PARTS.values(), *[0xF0] * 2, STOP[0]])


def test_a_hung_bus_is_flagged_and_does_not_block(bench):
    board = bench()
    board.board.hang_bus(True)
    board.raw(b"@6e", wait_s=0.3)
    assert board.ask("get_stream").args == (0,)
    both = FAULT["motor_board"] | FAULT["bus_hung"]
    assert board.faults() & both == both and board.board.longest_pass_s < 0.025


def test_a_bus_that_comes_free_is_used_again(bench):
    board = bench()
    board.board.hang_bus(True, recoveries=2)
    board.run(0.5)
    board.faults()
    assert board.faults() == 0 and board.ask("read_encoders").args == (0, 0)


def test_a_stop_during_a_hang_reaches_the_board_afterwards(bench):
    board = bench()
    board.board.hang_bus(True, recoveries=5)
    board.run(0.1)
    board.forget()
    board.raw(b"@13e", wait_s=0.8)
    assert STOP in board.writes()


def test_sensor_board_without_motors_keeps_the_convention_of_2013(bench):
    """Robot 6 and up, motor board never seen: 999 in 23, and nothing for 6."""
    plant = Plant(models.load("traxbot"), sonars=False)
    plant.motor_board.present = False
    board = bench(plant=plant, robot_id=7, library=pc_board.ENVIRONMENT)
    board.send("start_sensor_stream", 50, wait_s=0.3)
    board.send("read_encoders", wait_s=0.1)
    assert {frame.code for frame in board.frames()} == {23} and board.frames()[0].args[:2] == (999, 999)


def test_a_traxbot_without_its_motor_board_sends_no_999(bench):
    plant = Plant(models.load("traxbot"), sonars=False)
    plant.motor_board.present = False
    board = bench(plant=plant, robot_id=1, library=pc_board.ENVIRONMENT)
    board.send("start_sensor_stream", 50, wait_s=0.3)
    assert not board.frames()


def let_hours_pass(board, hours):
    """In steps of 4 s, the most that the 16-bit clock tells apart; each is a stall to the board.

    Sonars, which fire in each, and the physics of the robot, which stands, are left out for speed.
    """
    steps = int(hours * 900)
    now_us = board.board.now_s * 1e6
    with mock.patch.object(board.plant.robot, "step"):
        for step in range(1, steps + 1):
            board.board.native.pc_stall(ctypes.c_double(now_us + step * 4e6))
            board.board.native.pc_advance(board.board.native.pc_now_us() + 1)
    board.run(0.1)
    board.forget()


def test_everything_works_after_days(bench):
    """Across the wrap of the clock of streams, of 8 us (9.54 h), beyond those of 31 and 32 bits of ticks (38, 76 h)."""
    board = bench(sonars=False)
    for hours in (2**32 * 8e-6 / 3600 - 0.001, 29.5, 38.0):
        let_hours_pass(board, hours)
        board.raw(b"@11,100,0e")
        board.send("start_stream", 100, wait_s=8.0)
        assert board.writes(0xEB) and len(board.frames()) == pytest.approx(80, abs=2)
        board.send("stop_stream")
        high, low = board.ask("read_status").args[:2]
        assert high * 32768 + low == pytest.approx(board.board.now_s, abs=2)


HALF_MS = 0.5e-3
STALL_TICKS = 3906
BYTE_S = 10 / 115200
READ_BATTERY, READ_TEMPERATURE = 0xD5, 0xD4


@pytest.mark.parametrize("gap_s, dropped", [(0.25 - HALF_MS, False), (0.25 + HALF_MS, True)])
def test_a_stall_is_a_gap_of_250_ms(bench, gap_s, dropped):
    board = bench()
    board.forget()
    board.board.gap(board.board.now_s + gap_s, b"@11,100,0e")
    board.run(0.05)
    assert (not board.writes(0xEB)) == dropped


def test_check_mode_ends_2_s_after_the_last_frame(bench):
    board = bench()
    board.check(True)
    board.send("move_differential", 100, 0, wait_s=0.1)
    board.forget()
    begun_s = board.board.now_s
    board.send("get_stream", wait_s=2.1)
    heard_s = begun_s + len(encode_request(BY_NAME["get_stream"].code, checked=True)) * BYTE_S
    assert board.write_times(STOP[0])[0] - heard_s == pytest.approx(2.0, abs=HALF_MS)
    board.decoder.checked = False
    assert board.stop_reason() == "check_ended"


@pytest.mark.parametrize("begun, period_s", [(b"", 0.040), (b"@11,1", 0.064)])
def test_the_motor_board_is_polled_in_time(bench, begun, period_s):
    """Every 40 ms; while a request arrives, every 64 ms."""
    board = bench()
    board.raw(begun, wait_s=0.2)
    board.forget()
    board.run(1.0)
    polls = sorted(board.write_times(READ_BATTERY) + board.write_times(READ_TEMPERATURE))
    gaps = [after - before for before, after in zip(polls, polls[1:])]
    assert gaps == pytest.approx([period_s] * len(gaps), abs=HALF_MS)


def test_a_stall_is_longer_than_250_ms(bench):
    """A gap of exactly as many ticks is none; in one phase of four a tick more passes."""
    dropped = []
    for phase in range(4):
        board = bench()
        board.run(phase * TICK_S / 4)
        board.forget()
        board.board.gap(board.board.now_s + STALL_TICKS * TICK_S, b"@11,100,0e")
        board.run(0.05)
        dropped.append(not board.writes(0xEB))
    assert sum(dropped) <= 1


@pytest.mark.parametrize("after_s, baud", [(1.0 - HALF_MS, 500000), (1.0 + HALF_MS, 115200)])
def test_the_line_is_slow_again_1_s_after_the_last_frame(bench, after_s, baud):
    board = bench()
    wire = encode_request(BY_NAME["set_baud"].code, 2)
    board.raw(wire, wait_s=len(wire) * BYTE_S + after_s)
    board.board.set_host_baud(baud)
    assert board.ask("get_stream").args == (0,)
