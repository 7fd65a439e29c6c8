"""Lines of text that are passed on in a thread of their own."""

import threading
from unittest import mock

from mrl_driver.transport import relay
from mrl_driver.transport.relay import Teller
from tests.waiting import wait_until


def test_lines_that_find_no_room_are_counted(monkeypatch):
    """As in a terminal that was stopped for long."""
    told, begun, goes_on = [], threading.Event(), threading.Event()

    def tell(line):
        told.append(line)
        begun.set()
        goes_on.wait()

    teller = Teller(tell)
    teller("first")
    begun.wait()
    for _ in range(102):
        teller("more")
    with monkeypatch.context() as patch:
        patch.setattr(relay, "END_S", 0.01)
        teller.close()  # it waits for neither room nor the line
    goes_on.set()
    wait_until(lambda: len(told) == 101)
    teller("last but one")
    teller("last")
    teller.close()
    assert told[-2:] == ["last but one; 2 lines before this one were left out", "last"]


def test_the_lines_that_wait_are_passed_on_at_the_end():
    told = []
    teller = Teller(told.append)
    teller("one")
    teller("two")
    teller.close()
    assert told == ["one", "two"]


def test_after_a_line_that_cannot_be_written_the_next_is_passed_on():
    told = mock.Mock(side_effect=[BrokenPipeError, None])
    teller = Teller(told)
    teller("one")
    teller("two")
    teller.close()
    assert told.mock_calls == [mock.call("one"), mock.call("two")]
