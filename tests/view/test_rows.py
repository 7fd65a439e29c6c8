"""The sections and rows of a live view."""

import math
from types import SimpleNamespace

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.odometry import Twist
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.events import Reconnected
from mrl_driver.view import words
from mrl_driver.view.live_model import LiveModel
from mrl_driver.view.rows import sections
from mrl_driver.view.shown_state import Bar, Row, Shown
from tests.models import model as load

STATE = Shown(
    name="traxbot 1",
    model=load("traxbot"),
    pose=Pose(1.0, -0.25, math.pi / 2),
    twist=Twist(0.2, -0.5),
    command=Twist(0.25, 0.0),
    stop_reason="none",
    ranges={"right": 0.2, "front": math.inf, "left": math.nan, "rear": 1.5},
    sensors={"light": "500 count"},
    battery_v=11.4,
    battery_share=0.5,
    battery_state="low",
    board=[Row("faults", "none")],
    ready=True,
    age_s=0.012,
    errors=Row("errors", "0 lost, 0 bad"),
)


def told(state=STATE, delays_s=(math.nan,) * 3, **others):
    """Rows by section and name."""
    shown = state._replace(rate_hz=20.0, distance_m=3.2, delays_s=delays_s, **others)
    return {section.title: {row.name: row for row in section.rows} for section in sections(shown)}


def test_motion_is_told_in_numbers_with_units():
    assert [row.value for row in told()["motion"].values()] == [
        "x +1.000  y -0.250 m",
        "+90.0 deg",
        "+0.200 m/s  -29 deg/s",
        "+0.250 m/s  +0 deg/s",
        "3.20 m",
    ]


def test_a_stopped_robot_says_why():
    asked = told(command=None, stop_reason="host_paused")["motion"]["asked"]
    assert asked == Row("asked", "stopped: the computer that drives the robot was too busy", "yellow")


def test_sonars_come_as_seen_from_above_with_bars():
    assert list(told()["sonars"].values()) == [
        Row("left", "no reading", bar=Bar(0.0, "cyan")),
        Row("front", "nothing", bar=Bar(1.0, "cyan")),
        Row("right", "0.20 m", bar=Bar(pytest.approx(0.0667, abs=1e-3), "red")),
        Row("rear", "1.50 m", bar=Bar(0.5, "cyan")),
    ]


def test_silence_is_told_in_red():
    assert told(ready=False, age_s=1.25)["link"]["state"] == Row(
        "state", "no telemetry for 1.2 s", "bold red"
    )


def test_the_speed_of_a_silent_robot_is_unknown():
    """A driver has zero then, which nobody has measured."""
    assert told(ready=False, twist=Twist(0.0, 0.0))["motion"]["speed"].value == "unknown"


def test_delays_are_told_by_their_parts():
    values = [told(delays_s=each)["link"]["delay"].value for each in ((0.042, 0.012, 0.03), (math.nan,) * 3)]
    assert values == ["42 ms: key 12, link 30", "unknown: key ?, link ?"]


def test_every_reason_has_words():
    assert set(words.STOPS) == set(StopReason)


MISMATCH, HELD = Mismatch("left", DEAD, 0.037, 0.0), Hold("held", 1, 0, 0, 0x0013A200408B0001)


def robot(**values):
    """What the words use of a Driver."""
    usual = {
        "ready": True,
        "battery_state": "ok",
        "battery_v": 11.0,
        "mismatch": None,
        "hold": None,
        "inputs": None,
    }
    fake = SimpleNamespace(**{**usual, "stop_reason": "none", **values})
    fake.board = fake.radio = fake
    return fake


def test_a_stop_is_told_in_full():
    told = [
        words.stopped_by(robot(**values))
        for values in (
            {"stop_reason": "user"},
            {"stop_reason": "battery"},
            {"stop_reason": "wheel_mismatch", "mismatch": MISMATCH},
            {"stop_reason": StopReason.HELD, "hold": HELD},
        )
    ]
    assert told == [
        "stopped",
        "stopped: the battery is empty or switched off; switch motor power on, or connect the battery",
        f"stopped: {MISMATCH}",
        f"stopped: {HELD}",
    ]


def test_a_refusal_says_why_and_what_to_do():
    told = [
        words.why_refused(robot(**values), "turn the key")
        for values in (
            {"ready": False},
            {"battery_state": "empty", "battery_v": 8.9},
            {"mismatch": MISMATCH},
            {"hold": HELD},
            {"hold": HELD._replace(state="free")},
        )
    ]
    assert told == [
        "the robot sends no data or is just starting; when its data are back, turn the key",
        "the battery is empty at 8.9 V; charge it",
        f"{MISMATCH}; turn the key",
        str(HELD),
        "the robot takes no commands now; turn the key",
    ]


class Robot:
    """What a view uses of a Driver."""

    def __init__(self, **values):
        self.model = self.mismatch = self.recorder = None
        self.warning, self.link = "", SimpleNamespace(delay_s=math.nan)
        vars(self).update(values)

    def on_telemetry(self, listener):
        self.move = lambda x_m: listener(SimpleNamespace(pose=Pose(x_m, 0.0, 0.0), stamp_s=x_m))

    def on_event(self, listener):
        self.tell = listener


def model_of(robot, **options):
    return LiveModel(robot, 100.0, lambda: STATE, **options)


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
        model = model_of(Robot(link=SimpleNamespace(delay_s=link_s)))
        assert model.delays_s(input_s) == pytest.approx((total_s, input_s, link_s), nan_ok=True)
