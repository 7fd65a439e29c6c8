"""SECURITY.md names limits and guards as they are in the code."""

import re

import pytest

from mrl_driver.protocol.table import MOST_HOLDERS
from ros1_bridge.relay import relay_frames, topic_sender

from .blocks import ROOT

TEXT = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
MEGA = 1 << 20


def number(file, name):
    """A constant of a module that needs optional packages."""
    return int(re.search(rf"^(?:\w+, )*{name}\b.*?= .*?(\d+)", (ROOT / file).read_text(), re.M)[1])


@pytest.mark.parametrize(
    "words",
    [
        f"at most {number('mrl_driver/web/messages.py', 'MOST_BYTES')} bytes",
        f"16 pages, 100 connections, {number('mrl_driver/web/client.py', 'MOST_PER_S')} messages/s from each",
        f"{topic_sender.MOST_RECEIVERS} connections",
        f"frames of at most {relay_frames.LONGEST_BYTES // MEGA} MB",
        {4: "at most four holders"}[MOST_HOLDERS],
    ],
)
def test_limits_are_those_of_the_code(words):
    assert words in TEXT


def test_pages_and_connections_are_limited_as_it_says():
    source = (ROOT / "mrl_driver/web/server.py").read_text()
    assert "MOST_CLIENTS, MOST_CONNECTIONS = 16, 100" in source
