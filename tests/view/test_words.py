"""The words for the reasons why a robot stands."""

from types import SimpleNamespace

import pytest

from mrl_driver.protocol.table import STOP_REASONS
from mrl_driver.robot.hold import Hold
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.motion_command import STOPS
from mrl_driver.view import words


def test_every_reason_has_words():
    reasons = {reason.replace("_", " ") for reason in (*STOPS, *STOP_REASONS)}
    assert reasons - set(words.STOPS) == set()


def test_a_reason_is_told_in_a_sentence():
    assert words.stopped_text("command_timeout") == "stopped: no new command arrived in time"


@pytest.mark.parametrize("reason", ["none", "user", "host"])
def test_a_wanted_stop_needs_no_reason(reason):
    assert words.stopped_text(reason) == "stopped"


def test_a_reason_of_a_later_version_is_told_as_it_is():
    assert words.stopped_text("over_heated") == "stopped: over heated"


MISMATCH, HELD = Mismatch("left", DEAD, 0.037, 0.0), Hold("held", 1, 0, 0, 0x0013A200408B0001)


def robot(**values):
    """What the words use of a Driver."""
    usual = {"ready": True, "battery_state": "ok", "battery_v": 11.0, "mismatch": None, "hold": None}
    return SimpleNamespace(**{**usual, "stop_reason": "none", **values})


@pytest.mark.parametrize(
    "values, words_of_it",
    [
        ({"stop_reason": "user"}, "stopped"),
        (
            {"stop_reason": "battery"},
            "stopped: the battery is empty or switched off; charge it, or switch it on",
        ),
        ({"stop_reason": "wheel_mismatch", "mismatch": MISMATCH}, f"stopped: {MISMATCH}"),
        ({"stop_reason": "radio_hold", "hold": HELD}, f"stopped: {HELD}"),
    ],
)
def test_a_stop_is_told_in_full(values, words_of_it):
    assert words.stopped_by(robot(**values)) == words_of_it


@pytest.mark.parametrize(
    "values, words_of_it",
    [
        (
            {"ready": False},
            "the robot sends no data or is just starting; when its data are back, turn the key",
        ),
        ({"battery_state": "empty", "battery_v": 8.9}, "the battery is empty at 8.9 V; charge it"),
        ({"mismatch": MISMATCH}, f"{MISMATCH}; turn the key"),
        ({"hold": HELD}, str(HELD)),
        ({"hold": HELD._replace(state="free")}, "the robot takes no commands now; turn the key"),
    ],
)
def test_a_refusal_says_why_and_what_to_do(values, words_of_it):
    assert words.why_refused(robot(**values), "turn the key") == words_of_it
