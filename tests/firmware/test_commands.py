"""What each request does to the motor board, and what it answers."""

import pytest

from mrl_driver.protocol.table import (
    BY_NAME,
    COMMANDS,
    PROTOCOL_VERSION,
    REASONS,
    STOP_REASONS,
    TICK_S,
)
from mrl_driver.robot import models
from sim_arduino.hardware.wiring import Plant

STOP, KEYS = 0xFC, b"\xaa\x55"


def word(value: int) -> bytes:
    return (value & 0xFFFF).to_bytes(2, "big")


WRITES = [
    ("calibrate", (), [b"\xfb\x01\x01\x01" + KEYS]),
    ("set_pid_gains", (1, 2, 300), [b"\xf4" + word(1) + word(2) + word(300)]),
    ("set_encoder_prescaler", (3, 4), [b"\xf0\x03\x04" + KEYS]),
    ("preset_encoder", (1, -2), [b"\xef\x01\xff\xfe" + KEYS]),
    ("move_motors_pid", (40, -41), [b"\xf8" + word(40) + word(0) + word(-41)]),
    ("move_motors", (-100, 100), [b"\xf7" + word(-100) + word(0) + word(100)]),
    ("move_differential", (500, -800), [b"\xeb" + word(500) + word(-800)]),
    ("move_differential", (-1, -1), [b"\xeb\xff\xff\xff\xff"]),
    ("move_to_position", (3, -50, -1000), [b"\xee\x03" + word(-50) + word(-1000) + b"\x01"]),
    ("stop", (), [b"\xfc" + KEYS]),
    ("reset_encoders", (), [b"\xef" + bytes([n]) + b"\0\0" + KEYS for n in (1, 2, 3)]),
]


@pytest.mark.parametrize("name, args, writes", WRITES, ids=[f"{n}{a}" for n, a, _ in WRITES])
def test_what_reaches_the_motor_board(bench, name, args, writes):
    board = bench()
    board.send(name, *args)
    assert board.writes() == writes


def test_every_move_is_carried_out_in_order(bench):
    """One hundred commands as fast as the wire carries them."""
    board = bench()
    board.raw(b"".join(b"@11,%d,0e" % (n + 100) for n in range(100)), wait_s=0.2)
    assert board.writes(0xEB) == [b"\xeb" + word(n + 100) + word(0) for n in range(100)]


def test_a_stop_overtakes_moves_and_drops_them(bench):
    """While the motor board writes its EEPROM, moves wait; a stop does not, and is repeated afterwards."""
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.forget()
    board.raw(b"@11,100,0e@13e", wait_s=0.03)
    assert board.writes() == [b"\xfc" + KEYS] * 2


def test_a_move_behind_the_stop_is_carried_out_after_its_repetition(bench):
    """In each phase of the tasks that take turns: the pause ends in another pass of the loop each time."""
    for phase in range(14):
        board = bench()
        board.run(phase * TICK_S / 2)
        board.raw(b"@3,1,0e@11,200,0e@13e@11,100,0e", wait_s=0.05)
        moved = b"\xeb" + word(100) + word(0)
        assert board.writes()[1:] == [b"\xfc" + KEYS, b"\xfc" + KEYS, moved]


@pytest.mark.parametrize("name, args", [("set_pid_gains", (1, 2, 3)), ("default_config", ())])
def test_a_stop_in_a_pause_is_repeated_at_the_end_of_that_pause(bench, name, args):
    """Ahead of all that waits, be it the next part of the set-up: nothing may keep it from a board that missed it."""
    board = bench()
    board.send(name, *args, wait_s=0.003)
    board.forget()
    board.raw(b"@13e", wait_s=0.1)
    assert [data[0] for data in board.writes()[:2]] == [STOP, STOP]


def test_a_stop_reaches_a_board_that_refuses_everything_in_a_pause(bench):
    """The stop comes 0 to 1 ms after the gains, so also while these are on the bus; the pause takes 15 ms."""
    for ticks in range(16):
        board = bench()
        motors = board.plant.motor_board
        motors.busy_nack = True
        board.send("move_differential", 100, 0)
        board.send("set_pid_gains", 1, 2, 3, wait_s=ticks * TICK_S)
        board.raw(b"@13e", wait_s=0.018)
        assert motors.commands[-1].code == STOP
        status = dict(
            zip((field.name for field in BY_NAME["read_status"].reply), board.ask("read_status").args)
        )
        assert (status["faults"], STOP_REASONS[status["stop_reason"]]) == (0, "host")


def test_a_stop_leaves_other_commands_alone(bench):
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.raw(b"@11,100,0e@4,1,5e@11,200,0e@13e", wait_s=0.03)
    assert b"\xef\x01\x00\x05" + KEYS in board.writes() and not board.writes(0xEB)


def test_the_last_move_survives_a_crowd(bench):
    """13 moves arrive in a pause of the motor board, eight can wait: the newest is the last one carried out."""
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.raw(b"".join(b"@11,%d,0e" % n for n in range(100, 113)), wait_s=0.05)
    carried_out = [*range(100, 107), 112]
    assert board.writes(0xEB) == [b"\xeb" + word(speed) + word(0) for speed in carried_out]
    assert board.counter("unavailable") == 5


def test_pauses_of_the_motor_boards_eeprom_are_kept(bench):
    """Nothing is written to it while it is busy, neither at the start nor later."""
    board = bench(boot=False)
    board.run(0.2)
    board.raw(b"@2,1,2,3e@11,100,0e@3,1,0e@11,200,0e@6e", wait_s=0.1)
    assert board.plant.motor_board.too_early == 0


# ---- ceiling


@pytest.mark.parametrize(
    "asked, carried_out",
    [((650, 5000), (650, 5000)), ((1300, 1000), (650, 500)), ((-1300, 1000), (-650, 500)), ((100, -10000), (50, -5000)),
     ((1300, 20000), (325, 5000)), ((32767, 1), (650, 0)), ((-32768, -32768), (-650, -650))],
)  # fmt: skip
def test_ceiling_keeps_the_arc(bench, asked, carried_out):
    """Both speeds shrink by the same factor; TraxBot's ceiling is 650 mm/s and 5000 mrad/s."""
    board = bench()
    board.send("move_differential", *asked)
    assert board.writes(0xEB) == [b"\xeb" + word(carried_out[0]) + word(carried_out[1])]


def test_clamped_commands_are_counted(bench):
    board = bench()
    board.raw(b"@11,651,0e@11,650,0e@11,0,-5001e")
    assert board.field("read_status", "clamped") == 2


# ---- answers


def test_robot_info_is_kept_up_to_date(bench):
    """Battery and temperature are read by turns, every 40 ms."""
    board = bench()
    board.plant.motor_board.robot.set_battery(10.5)
    board.plant.motor_board.robot.state.temperature_c = 40.0
    board.run(0.12)
    temperature, _, battery, _, _ = board.ask("robot_info").args
    assert (temperature, battery) == pytest.approx((4000, 1050), abs=10)


def test_replies_end_with_cr_lf(bench):
    board = bench()
    board.send("read_encoders")
    assert board.heard == b"@6,0,0e\r\n"


HARMLESS = [row for row in COMMANDS if row.name not in ("xbee_text", "set_check", "set_baud")]


@pytest.mark.parametrize("row", HARMLESS, ids=lambda row: row.name)
def test_no_request_hurts_the_board(bench, row):
    """Whatever was asked, the next request is answered."""
    board = bench()
    board.send(row.name, *(field.high for field in row.request), wait_s=0.25)
    board.raw(b"@19e@24e@26e@28e", wait_s=0.05)
    assert board.ask("read_protocol").args[0] == PROTOCOL_VERSION


# ---- refusals

REFUSED = [
    (b"xyz\r", "noise"), (b"@11,50@13e", "restarted"), (b"@" + b"1" * 120, "too_long"), (b"@11,+5,0e", "not_integer"),
    (b"@11,40000,0e", "beyond_int16"), (b"@99e", "unknown_command"), (b"@9,1,40,1,40e", "argument_count"),
    (b"@9,101,0e", "argument_range"), (b"@36e", "bad_check"), (b"@20e", "unavailable"),
]  # fmt: skip


@pytest.mark.parametrize("wire, reason", REFUSED, ids=[reason for _, reason in REFUSED])
def test_refusals_are_counted_by_reason(bench, wire, reason):
    board = bench()
    board.raw(wire, wait_s=0.03)
    counters = dict(zip((row.name for row in REASONS), board.ask("read_counters").args))
    assert counters[reason] == 1


def test_counters_stay_at_their_maximum(bench):
    board = bench()
    board.raw(b"@" * 32800 + b"13e", wait_s=2.9)
    assert board.counter("restarted") == 32767


BAD_MOVES = [
    b"@11,1x,0e", b"@11,--5,0e", b"@11,007,0e", b"@11,1e3,0e", b"@11,,0e", b"@11,5e", b"@11,5,6,7e", b"@11,12345678,0e",
    b"@11, 5,0e", b"@11,0x10,0e", b"@11,\x00,0e", b"@11,\xff1,0e", b"@0e", b"@-11,1,1e", b"@9,-101,0e", b"@12,4,10,0e",
    b"@4,0,0e", b"@3,1,5e", b"@2,-1,0,0e", b"AT\r", b"+++",
]  # fmt: skip


@pytest.mark.parametrize("wire", BAD_MOVES, ids=[str(wire) for wire in BAD_MOVES])
def test_bad_input_moves_nothing_and_the_next_frame_works(bench, wire):
    board = bench()
    board.raw(wire + b"\r\n@13e")
    assert board.writes() == [b"\xfc" + KEYS]


def test_a_full_input_buffer_is_counted(bench):
    """100 bytes come while the loop stands still: 64 fit, the rest is counted."""
    board = bench()
    board.board.gap(board.board.now_s + 0.2, b"x" * 100)
    board.run(0.02)
    assert board.counter("overrun") == 36


# ---- no motor board


@pytest.fixture
def motorless(bench):
    plant = Plant(models.load("traxbot"))
    plant.motor_board.present = False
    return bench(plant=plant)


@pytest.mark.parametrize("name, args", [(n, a) for n, a, _ in WRITES], ids=[f"{n}{a}" for n, a, _ in WRITES])
def test_commands_to_a_missing_motor_board_are_refused(motorless, name, args):
    motorless.send(name, *args, wait_s=0.06)
    assert motorless.counter("unavailable") >= 1


def test_no_counts_without_a_motor_board(motorless):
    """Neither zeros nor a sentinel."""
    motorless.send("read_encoders", wait_s=0.1)
    motorless.send("start_stream", wait_s=0.1)
    assert not motorless.frames()


def test_info_without_a_motor_board(motorless):
    """It is answered; 0 V means that the motors have no power."""
    assert motorless.ask("robot_info").args == (0, 0, 0, 2, 1)


# ---- debug


def test_debug_text(bench):
    board = bench()
    board.send("set_debug", 1)
    board.forget()
    board.raw(b"@13e", wait_s=0.02)
    board.raw(b"@99e", wait_s=0.02)
    assert board.heard == b"[INFO] stop\r\n[ERROR] unknown_command\r\n"


def test_debug_text_leaves_frames_whole(bench):
    """Behind a full-rate stream no frame is damaged by text."""
    board = bench()
    board.send("set_debug", 1)
    board.send("start_stream")
    board.raw(b"@13e@99e" * 50, wait_s=0.3)
    bad = [event for event in board.events if getattr(event, "reason", "text") != "text"]
    assert not bad and len(board.frames()) > 50


def test_debug_text_never_cuts_an_answer_that_has_begun(bench):
    """`@6,` is out and its counters are on their way (0.28 ms) when the second '@' (0.17 ms) is refused."""
    board = bench()
    board.send("set_debug", 1)
    board.forget()
    board.raw(b"@6e@@", wait_s=0.02)
    assert b"@6,0,0e\r\n" in board.heard


def test_a_request_behind_several_that_fail_is_answered_at_once(bench):
    """Without the motor board no counts come; the loop goes on to the next request before it sleeps."""
    board = bench()
    board.plant.motor_board.present = False
    board.run(0.3)
    board.frames()
    board.raw(b"@31e@6e@6e@6e@17e")
    board.run(0.05)
    assert [frame.code for frame in board.frames()] == [31, 17]
