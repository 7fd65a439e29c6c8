"""The words for the reasons why a robot stands."""

from types import SimpleNamespace

from mrl_driver.protocol.table import STOP_REASONS
from mrl_driver.robot.hold import Hold
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.motion_command import STOPS
from mrl_driver.view import words


def test_every_reason_has_words():
    reasons = {reason.replace("_", " ") for reason in (*STOPS, *STOP_REASONS)}
    assert reasons - set(words.STOPS) == set()


MISMATCH, HELD = Mismatch("left", DEAD, 0.037, 0.0), Hold("held", 1, 0, 0, 0x0013A200408B0001)


def robot(**values):
    """What the words use of a Driver."""
    usual = {"ready": True, "battery_state": "ok", "battery_v": 11.0, "mismatch": None, "hold": None}
    return SimpleNamespace(**{**usual, "stop_reason": "none", **values})


def test_a_stop_is_told_in_full():
    told = [
        words.stopped_by(robot(**values))
        for values in (
            {"stop_reason": "user"},
            {"stop_reason": "battery"},
            {"stop_reason": "wheel_mismatch", "mismatch": MISMATCH},
            {"stop_reason": "radio_hold", "hold": HELD},
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
