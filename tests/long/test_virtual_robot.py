"""What takes longer with the robot of a bare board: hours of driving, and a course beside the emulator's."""

import contextlib
import math
from typing import Any, Tuple

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.conformance.bench import VirtualAvr
from tests.conftest import EXPLORE
from tests.firmware.pc_board import BRIDGE, PcBoard
from tests.firmware.test_virtual_robot import DUO, EEPROM, NEAR_RAD, SAMPLE_S, bare, drift
from tests.firmware.virtual_chip import run_to_sample

HOURS_S = (8 if EXPLORE else 2) * 3600
HOURS_M = 0.03
"""Of 6 km in eight hours, which only an exploring run drives: the counts are whole, so the host's headings differ from
the board's by some 0.5 mrad at random.  In two hours the board's clock of microseconds wraps.
"""
COURSE = (
    *((400, 0, 2.5), (0, 1500, 1.05)),
    (300, 600, 3.0),
    (-250, 400, 3.0),
    (400, -800, 3.0),
    (300, 1200, 2.6),
)
"""Requests of 11 [mm/s, mrad/s], and how long each is in force [s]: 4.6 m."""
COURSE_M, COURSE_RAD = 0.005, 0.01
BEGINS, EVERY, AFTER_S = (
    60,
    20,
    2e-3,
)  # samples, samples, and the time after a sample at which a request begins


def test_hours_of_driving_leave_no_drift_between_pose_and_counts():
    found = drift(HOURS_S)
    assert (
        found.driven_m > 600 * HOURS_S / 3600 and found.place_m < HOURS_M and found.heading_rad < NEAR_RAD
    ), found


def drive(board: Any, begin_s: float) -> Tuple[float, float, float]:
    """Repeats each request of the course every 20 periods of the control, and waits until the robot stands."""
    now_s = begin_s + BEGINS * SAMPLE_S + AFTER_S
    board.advance(now_s)
    for linear, angular, seconds in COURSE:
        for _ in range(round(seconds / 0.1)):
            board.receive(b"@11,%d,%de" % (linear, angular))
            now_s += EVERY * SAMPLE_S
            board.advance(now_s)
    board.receive(b"@13e")
    board.advance(now_s + 2.0)
    board.receive(b"@62e")
    found = FrameDecoder(REPLIES).feed(board.advance(now_s + 2.05))
    code = BY_NAME["read_virtual_pose"].code
    x, y, heading = next(
        (each.args for each in found if isinstance(each, Frame) and each.code == code), (0, 0, 0)
    )
    return x / 1000, y / 1000, heading / 1000


def image() -> Tuple[VirtualAvr, float]:
    """The image, and a time at which a period of its control begins [s]."""
    board = VirtualAvr(Plant(DUO, World()), EEPROM, False)
    board.advance(0.2)
    run_to_sample(board.machine)
    return board, board.machine.time_s


@pytest.fixture(scope="module")
def emulated_end() -> Any:
    """Where the course leaves the emulator's robot."""
    plant = Plant(DUO, World(), (1.0, 1.0, 0.0), footprint="none")
    with contextlib.closing(PcBoard(plant, EEPROM, BRIDGE)) as board:
        drive(board, 0.0)
        return plant.true_pose


@pytest.mark.parametrize("make", [lambda: (bare(), 0.0), image], ids=["pc", "image"])
def test_a_course_of_some_metres_ends_where_that_of_the_emulator_does(make, emulated_end):
    """The firmware and the commands are the same; the emulator has the motors of the other board.

    A command counts from the next period of the control on, so both boards get it at the same moment of a period.
    """
    virtual, begin_s = make()
    x_m, y_m, heading_rad = drive(virtual, begin_s)
    virtual.close()
    assert math.dist((x_m, y_m), emulated_end[:2]) < COURSE_M
    assert heading_rad == pytest.approx(emulated_end.yaw_rad, abs=COURSE_RAD)
