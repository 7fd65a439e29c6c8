"""What a live view knows of a robot: messages, rate, delays."""

import math
from types import SimpleNamespace

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.events import Reconnected
from mrl_driver.view.live_model import LiveModel


class Robot:
    """What a view uses of a Driver."""

    def __init__(self, **values):
        self.model = self.mismatch = self.recorder = None
        self.warning, self.link_delay_s = "", math.nan
        vars(self).update(values)

    def on_telemetry(self, listener):
        self.move = lambda x_m: listener(SimpleNamespace(pose=Pose(x_m, 0.0, 0.0)))

    def on_event(self, listener):
        self.tell = listener


def model_of(robot, **options):
    return LiveModel(robot, 100.0, lambda: "state", **options)


def test_the_path_and_the_rate_come_from_the_telemetry():
    robot = Robot()
    model = model_of(robot)
    model.shown(100.0)
    for i in range(10):
        robot.move(0.1 * i)
    shown = model.shown(100.5)
    assert (shown.rate_hz, shown.elapsed_s, len(shown.trail)) == (20.0, 0.5, 10)
    assert shown.distance_m == pytest.approx(0.9)


def test_the_most_important_message_is_shown():
    robot = Robot(warning="old firmware")
    model = model_of(robot, remedy="release and press again")
    seen = [model.shown(100.0).notice]
    robot.tell(Reconnected("/dev/y"))
    seen.append(model.shown(100.0).notice)
    robot.recorder = SimpleNamespace(loss="the disk is full")
    seen += [model.shown(100.0).notice, model.shown(100.0, warning="too slow").notice]
    robot.mismatch = Mismatch("left", DEAD, 0.037, 0.0)
    seen.append(model.shown(100.0, warning="too slow").notice)
    assert seen == [
        "old firmware",
        "the robot answers again, on /dev/y",
        "the disk is full",
        "too slow",
        f"{robot.mismatch}; release and press again",
    ]


def test_the_delay_is_the_sum_of_what_is_known():
    nan = math.nan
    for input_s, link_s, total_s in (
        (0.012, 0.03, 0.042),
        (nan, 0.03, 0.03),
        (0.012, nan, 0.012),
        (nan,) * 3,
    ):
        model = model_of(Robot(link_delay_s=link_s))
        assert model.delays_s(input_s) == pytest.approx((total_s, input_s, link_s), nan_ok=True)
