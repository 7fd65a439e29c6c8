"""Whether the wheels turn, by their counts alone."""

from types import SimpleNamespace

import pytest

from mrl_driver.robot import models
from ros1_bridge.control.wheel_motion import STILL_M_S, WINDOW_S, WheelMotion

MODEL = models.load("traxbot")
POLL_S = 0.2


class Wheels:
    """A driver whose wheels have these counts, and what is said of it."""

    def __init__(self, model=MODEL):
        self.ready, self.may_be_moving, self.model = True, False, model
        self.telemetry = SimpleNamespace(stamp_s=5.0, counts=(700, -900), twist=(0.0, 0.0))
        self._motion = WheelMotion(self)
        self.moving = self._motion.moving

    def turn(self, speed_m_s, seconds=POLL_S):
        """The right wheel stands, the left one turns back."""
        right, left = self.telemetry.counts
        self.telemetry.counts = right, left - speed_m_s * seconds / MODEL.drive.metres_per_count
        self.telemetry.stamp_s += seconds
        return self.moving()


@pytest.mark.parametrize("speed_m_s, moves", [(0.9 * STILL_M_S, False), (1.1 * STILL_M_S, True)])
def test_one_wheel_faster_than_the_limit_is_motion(speed_m_s, moves):
    wheels = Wheels()
    wheels.moving()
    assert wheels.turn(speed_m_s) is moves
    assert wheels.turn(0.0) is False


def test_single_counts_between_two_frames_are_no_motion():
    wheels = Wheels()
    wheels.moving()
    assert wheels.turn(0.1, WINDOW_S / 20) is False
    assert wheels.turn(0.0, WINDOW_S) is False


def test_first_look_goes_by_the_last_frame():
    wheels = Wheels()
    wheels.telemetry.twist = 0.0, -0.2
    assert wheels.moving() is True


@pytest.mark.parametrize("may_be_moving, moves", [(True, None), (False, False)])
def test_without_telemetry_only_a_watchdog_says_that_it_stands(may_be_moving, moves):
    wheels = Wheels()
    wheels.moving()
    wheels.turn(0.2)
    wheels.ready, wheels.may_be_moving = False, may_be_moving
    assert wheels.moving() is moves


def test_counts_from_before_a_silence_are_not_compared():
    """The wheels may have turned long ago."""
    wheels = Wheels()
    wheels.moving()
    wheels.ready = False
    wheels.moving()
    wheels.ready = True
    assert wheels.turn(0.2, 60.0) is False
    assert wheels.turn(0.2) is True


def test_board_without_motors_does_not_say():
    wheels = Wheels(models.load("pioneer"))
    assert wheels.moving() is None
