"""A port that this program shares with another one, or that sends its own bytes back."""

import pytest

from mrl_driver.driver import Driver, Options, link_source
from mrl_driver.errors import NotARobot, PortBusy


def test_a_board_whose_answers_another_program_takes_ends_with_that_programs_name(serve, monkeypatch):
    """It has opened the port after this one, or its user is another."""
    port = serve()
    port.held.set()
    monkeypatch.setattr(link_source, "opened_by", lambda name: f"cat (process 7) at {name}")
    with pytest.raises(
        PortBusy, match=rf"in use by cat \(process 7\) at {port.path}, which takes .*no answer"
    ):
        Driver(port.path, options=Options(greeting_s=0.3)).connect()


def test_a_board_that_is_silent_without_another_program_is_silent(serve):
    port = serve()
    port.held.set()
    with pytest.raises(NotARobot, match="no answer"):
        Driver(port.path, options=Options(greeting_s=0.3)).connect()


def test_own_bytes_that_come_back_are_named():
    """As from a loopback plug, or a login prompt."""
    with pytest.raises(NotARobot, match=r"the bytes that were sent come back \(b'@"):
        Driver("loop://").connect()
