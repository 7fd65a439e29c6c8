"""Bad lines: what the check value catches, greetings, and drives with random faults."""

import pytest

from mrl_driver.protocol import REPLIES, REQUESTS, Frame, FrameDecoder, Stamp, encode_reply, encode_request
from mrl_driver.protocol.table import BY_CODE
from tests.conftest import EXPLORE
from tests.long.fuzz import damage
from tests.long.fuzz.faulty_robot import drive
from tests.long.fuzz.greetings import faults_of, greet

STREAM = encode_reply(8, -12345, 23456, 120, 45, 300, stamp=Stamp(7, -1234), checked=True)


MOST_PER_MILLION = 30


@pytest.mark.parametrize("wire", [STREAM, encode_reply(6, 1, -1, stamp=Stamp(0, 0), checked=True)])
def test_every_single_fault_of_a_checked_reply_is_caught(wire):
    """Changed and lost bytes and swaps; the long run counts how rarely a lost byte passes."""
    assert damage.try_every_fault(damage.REPLIES, wire).wrong == 0


@pytest.mark.parametrize("request_", [(11, 500, -800), (13,), (9, -1, 100), (35, 10, 650)])
def test_every_single_fault_of_a_checked_request_is_caught(request_):
    assert damage.try_every_fault(damage.REQUESTS, encode_request(*request_, checked=True)).wrong == 0


@pytest.mark.parametrize(
    "request_", [(2, 700, 400, 200), (5,), (6,), (34, 10), (32, 1), (33, 250), (35, 10, 650), (37,)]
)
def test_no_single_fault_makes_a_guarded_request_in_plain_mode(request_):
    """Guarded rows carry their check value always, so nothing is configured by one wrong byte."""
    wire, sent = encode_request(*request_), Frame(request_[0], request_[1:])
    found = {event for damaged in damage.every_fault(wire) for event in FrameDecoder(REQUESTS).feed(damaged)}
    assert not [
        event for event in found if isinstance(event, Frame) and BY_CODE[event.code].guarded and event != sent
    ]


@pytest.mark.parametrize("direction", damage.DIRECTIONS)
@pytest.mark.parametrize("kind", damage.EXACT, ids=lambda kind: kind.__name__)
def test_one_changed_byte_never_passes(direction, kind):
    assert damage.try_random(damage.DIRECTIONS[direction], kind, 4000, seed=1).wrong == 0


@pytest.mark.parametrize("kind", damage.LOSSY, ids=lambda kind: kind.__name__)
def test_lost_and_swapped_bytes_pass_at_the_rate_of_16_bits_at_most(kind):
    tally = damage.try_random(REPLIES, kind, 10000, seed=2)
    assert tally.wrong <= max(1, MOST_PER_MILLION * tally.tried / 1e6) + 1


RATE = 0.01
SEEDS = {"python": (28, 106, 136, 184, 213, 228, 385, 879), "pc": (21, 33, 72, 385, 463, 807, 810, 879)}
"""Of each board: each makes a bare `calibrate` of a request to it."""


@pytest.mark.parametrize("board", SEEDS)
def test_no_greeting_moves_the_robot_on_lines_that_make_calibrate_of_it(board):
    assert not [seed for seed in SEEDS[board] if greet(board, faults_of(RATE), seed).moved]


@pytest.mark.parametrize("board", SEEDS)
def test_without_the_guard_of_calibrate_such_lines_move_the_robot(board):
    """The control; a change of what is sent moves the faults to other bytes."""
    moved = [seed for seed in SEEDS[board] if greet(board, faults_of(RATE), seed, plain_calibrate=True).moved]
    assert len(moved) > len(SEEDS[board]) // 2


LINK_SEEDS = range(24 if EXPLORE else 10)
DRIVE_S = 5.0
SETTLE_S = 3.0
WATCHDOG_S = 0.25
STOPPING_S = 0.35  # Motors run down from full speed
POSE_M = 0.03
"""Largest error of a drive of some metres, most of it from arcs between frames that were not lost."""


@pytest.mark.parametrize("seed", LINK_SEEDS)
def test_a_drive_with_faults_has_no_wrong_value_and_no_jump_and_ends_stopped(seed):
    robot, what = drive(seed, DRIVE_S)
    assert robot.accepted > 20, what
    if seed % 2:
        robot.driver.drive(0.3, 0.0)
        robot.driver.stop()
        robot.run(WATCHDOG_S + STOPPING_S)
    else:
        robot.engine.stall(60)
        robot.run(WATCHDOG_S + STOPPING_S)
    assert not robot.moves(), what
    robot.engine.clear()
    robot.run(SETTLE_S)
    assert robot.driver.ready, what
    assert not robot.moves(), what
    assert robot.wrong == [], what
    assert robot.jump_m <= 0, what
    assert what.breaks or robot.error_m < POSE_M, what
