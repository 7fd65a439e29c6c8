"""What the board tells the motor board for moves at the ceilings of speed, and what it answers to requests."""

import math

import pytest

from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, TICK_S
from tests.firmware.test_failsafe import STOP

MOVE, MOVE_OMNI = 0xEB, 0xFA
WIDEST = 32767  # A ceiling that limits nothing


def word(value: int) -> bytes:
    return (value & 0xFFFF).to_bytes(2, "big")


@pytest.fixture
def limited(bench):
    def make(**parameters: int):
        board = bench()
        for name, value in parameters.items():
            board.send("write_config", PARAMETER_BY_NAME[name].number, value)
        board.run(0.1)
        board.forget()
        return board

    return make


def told(board, linear, angular):
    """What the motor board is told for a move in mm/s and mrad/s."""
    board.send("move_differential", linear, angular)
    (data,) = board.writes(MOVE)
    return tuple(int.from_bytes(data[at : at + 2], "big", signed=True) for at in (1, 3))


def told_shares(board, speed, rotation):
    """What the motor board is told for a move in percent of full speed."""
    board.send("move_omni", speed, rotation, 0)
    (data,) = board.writes(MOVE_OMNI)
    return data[1], int.from_bytes(data[2:4], "big", signed=True)


@pytest.mark.parametrize(
    "linear, angular, expected",
    [
        (-1, -1, (-1, -1)),
        (999, 2000, (999, 2000)),
        (1000, 2000, (1000, 2000)),
        (1001, 2000, (1000, 1998)),
        (1000, 2001, (999, 2000)),
        (-1001, 0, (-1000, 0)),
        (0, -2001, (0, -2000)),
        (2000, 4000, (1000, 2000)),
        (2001, 4000, (1000, 1999)),
        (2000, 4001, (999, 2000)),
        (-2000, 32767, (-122, 2000)),
        (32767, 2000, (1000, 61)),
        (-32768, -32768, (-1000, -1000 * 32768 // 32768)),
    ],
)
def test_the_speed_that_is_farther_beyond_its_ceiling_decides(limited, linear, angular, expected):
    """1000 mm/s and 2000 mrad/s; the other one is rounded towards zero."""
    assert told(limited(linear_ceiling=1000, angular_ceiling=2000), linear, angular) == expected


@pytest.mark.parametrize(
    "ceilings, asked, expected",
    [
        ((WIDEST, 100), (-32768, 200), (-16384, 100)),
        ((100, WIDEST), (200, -32768), (100, -16384)),
        ((WIDEST, 100), (-32768, 100), (-32768, 100)),
        ((100, WIDEST), (100, -32768), (100, -32768)),
        ((WIDEST - 1, WIDEST), (-32768, 32767), (-32766, 32765)),
    ],
)
def test_the_widest_ceiling_limits_nothing_beside_a_narrow_one(limited, ceilings, asked, expected):
    board = limited(linear_ceiling=ceilings[0], angular_ceiling=ceilings[1])
    assert told(board, *asked) == expected


def full_speed_mm_s(full_speed, wheel_radius):
    """Rim speed at full speed [rpm] of a wheel [0.01 mm]."""
    return 2 * math.pi / 60 * full_speed * wheel_radius / 100


@pytest.mark.parametrize(
    "full_speed, wheel_radius, share",
    [(4, 23873, 50), (3, 31831, 49), (4, 12057, 99), (1, 3600, 100), (10, 32767, 14)],
)
def test_a_linear_ceiling_is_a_share_of_full_speed_rounded_down(limited, full_speed, wheel_radius, share):
    """50 mm/s; by the first two wheels, 50.0005 % and 49.99998 %."""
    assert share == min(100, math.floor(100 * 50 / full_speed_mm_s(full_speed, wheel_radius)))
    board = limited(
        linear_ceiling=50, angular_ceiling=WIDEST, full_speed=full_speed, wheel_radius=wheel_radius
    )
    assert told_shares(board, 100, 0) == (share, 0)


@pytest.mark.parametrize("wheel_radius, share", [(6780, 50), (6781, 49), (3000, 100), (32767, 10)])
def test_an_angular_ceiling_is_a_share_of_full_rotation_rounded_down(limited, wheel_radius, share):
    """355 mrad/s at 10 mm from the middle; by the first two wheels, 50.000004 % and 49.99 %."""
    rim_mm_s = 0.355 * 10
    assert share == min(100, math.floor(100 * rim_mm_s / full_speed_mm_s(1, wheel_radius)))
    board = limited(
        linear_ceiling=WIDEST, angular_ceiling=355, axis_radius=1000, full_speed=1, wheel_radius=wheel_radius
    )
    assert told_shares(board, 0, -100) == (0, -share)


@pytest.mark.parametrize("asked", [(100, 0), (0, 100), (100, -100), (1, 1)])
def test_ceilings_below_one_percent_let_no_omni_move_turn_a_wheel(limited, asked):
    board = limited(linear_ceiling=1, angular_ceiling=1, full_speed=1000)
    assert told_shares(board, *asked) == (0, 0)


@pytest.mark.parametrize("clamped, speed", [(0, 50), (1, 51)])
def test_an_omni_move_beyond_its_share_is_counted(limited, clamped, speed):
    board = limited(linear_ceiling=50, angular_ceiling=WIDEST, full_speed=4, wheel_radius=23873)
    board.send("move_omni", speed, 0, 0)
    assert board.field("read_status", "clamped") == clamped


def test_every_move_is_carried_out_in_order(bench):
    board = bench()
    board.raw(b"".join(b"@11,%d,0e" % (n + 100) for n in range(100)), wait_s=0.2)
    assert board.writes(0xEB) == [b"\xeb" + word(n + 100) + word(0) for n in range(100)]


def test_a_move_behind_the_stop_is_carried_out_after_its_repetition(bench):
    """In each phase of the tasks that take turns: the pause ends in another pass of the loop each time."""
    for phase in range(14):
        board = bench()
        board.run(phase * TICK_S / 2)
        board.raw(b"@3,1,1e@11,200,0e@13e@11,100,0e", wait_s=0.05)
        moved = b"\xeb" + word(100) + word(0)
        assert board.writes()[1:] == [STOP, STOP, moved]


@pytest.mark.parametrize("name, args", [("set_pid_gains", (1, 2, 3)), ("default_config", ())])
def test_a_stop_in_a_pause_is_repeated_at_the_end_of_that_pause(bench, name, args):
    """Ahead of all that waits, be it the next part of the set-up: nothing may keep it from a board that missed it."""
    board = bench()
    board.send(name, *args, wait_s=0.003)
    board.forget()
    board.raw(b"@13e", wait_s=0.1)
    assert board.writes()[:2] == [STOP, STOP]


def test_a_stop_reaches_a_board_that_refuses_everything_in_a_pause(bench):
    """The stop comes 0 to 1 ms after the gains, so also while these are on the bus; the pause takes 15 ms."""
    for ticks in range(16):
        board = bench()
        motors = board.plant.motor_board
        motors.busy_nack = True
        board.send("move_differential", 100, 0)
        board.send("set_pid_gains", 1, 2, 3, wait_s=ticks * TICK_S)
        board.raw(b"@13e", wait_s=0.018)
        assert motors.commands[-1].code == STOP[0]
        assert (board.faults(), board.stop_reason()) == (0, "host")


def test_the_last_move_survives_a_crowd(bench):
    """13 moves arrive in a pause of the motor board, eight can wait: the newest is the last one carried out."""
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.raw(b"".join(b"@11,%d,0e" % n for n in range(100, 113)), wait_s=0.05)
    carried_out = [*range(100, 107), 112]
    assert board.writes(0xEB) == [b"\xeb" + word(speed) + word(0) for speed in carried_out]
    assert board.counter("unavailable") == 5


def test_counters_stay_at_their_maximum(bench):
    board = bench()
    board.raw(b"@" * 32800 + b"13e", wait_s=2.9)
    assert board.counter("restarted") == 32767


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


PRESET_WIRE, STOP_WIRE = b"@4,1,5e", b"@13e"
PRESET = b"\xef\x01\x00\x05\xaa\x55"
AT_ONCE = 16  # Bytes that are taken before the motor board is served [byte]


@pytest.mark.parametrize("size, first", [(AT_ONCE, STOP), (AT_ONCE + 1, PRESET)])
def test_a_stop_within_the_first_16_bytes_overtakes_a_command(bench, size, first):
    board = bench()
    fill = b"\r" * (size - len(PRESET_WIRE + STOP_WIRE))
    board.board.gap(board.board.now_s + 0.01, PRESET_WIRE + fill + STOP_WIRE)
    board.run(0.01)
    assert sorted(board.writes()) == sorted([PRESET, STOP]) and board.writes()[0] == first


@pytest.mark.parametrize("waiting", [3, 4, 17, 33, 49, 64])
def test_a_stop_behind_any_number_of_waiting_bytes_is_carried_out_within_two_passes(bench, waiting):
    """64 bytes at most wait for the loop; a pass takes them in four parts."""
    board = bench()
    board.board.gap(board.board.now_s + 0.02, b"\r" * (waiting - len(STOP_WIRE)) + STOP_WIRE[-waiting:])
    begun_s = board.board.now_s
    board.run(0.001)
    assert bool(board.writes()) == (waiting >= len(STOP_WIRE))
    assert all(t - begun_s < 0.2e-3 for t in board.write_times(STOP[0]))


@pytest.mark.parametrize("byte", [0x00, 0x01, 0x7F, 0x80, 0xFF])
def test_no_byte_within_a_frame_is_left_out(bench, byte):
    board = bench()
    board.raw(b"@1" + bytes([byte]) + b"3e")
    assert board.writes() == [] and board.counter("not_integer") == 1


@pytest.mark.parametrize("waiting", [20, 36, 52, 64])
def test_a_stream_that_is_started_late_in_a_pass_begins_at_once(bench, waiting):
    """The loop does not sleep before it has asked all tasks again; its first frame takes less than 1 ms to begin."""
    for phase in range(4):
        board = bench(sonars=False)
        board.run(0.01 * phase)
        board.forget()
        wire = b"@%d,100e" % BY_NAME["start_stream"].code
        board.board.gap(board.board.now_s + 0.02, b"\r" * (waiting - len(wire)) + wire)
        board.run(1e-3)
        assert board.heard[:1] == b"@"
