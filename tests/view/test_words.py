"""The words for the reasons why a robot stands."""

import pytest

from mrl_driver.protocol.table import STOP_REASONS
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
