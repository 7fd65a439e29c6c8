"""Driver and board over links with random faults: no wrong value, no jump, and a stop in the end."""

import pytest

from tests.long.fuzz.faulty_robot import drive

SEEDS = range(24)
DRIVE_S = 5.0
SETTLE_S = 3.0
WATCHDOG_S = 0.25
STOPPING_S = 0.35  # Motors run down from full speed
POSE_M = 0.03
"""Largest error of a drive of some metres, most of it from arcs between frames that were not lost."""


@pytest.mark.parametrize("seed", SEEDS)
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
