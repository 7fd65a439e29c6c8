"""The ceilings of speed at their limits: what the board tells the motor board for moves in mm/s and in shares."""

import math

import pytest

from mrl_driver.protocol.table import PARAMETER_BY_NAME

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
        linear_ceiling=WIDEST,
        angular_ceiling=355,
        axis_radius=1000,
        full_speed=1,
        wheel_radius=wheel_radius,
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
