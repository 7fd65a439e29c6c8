"""A port that cannot be opened yet: it is tried again until `port_timeout_s` has passed, whatever the error is."""

import errno
import os
import threading
from unittest import mock

import pytest

from mrl_driver.driver import Driver, Options, link_source
from mrl_driver.errors import LinkError, LinkLost, PortBusy, PortDenied, PortMissing
from mrl_driver.session.events import Awaited
from tests.waiting import PATIENCE_S

WAITS = Options(port_timeout_s=PATIENCE_S)


def refuse(*errors):
    """The port gives these errors, then opens."""
    left = list(errors)

    def opener(*args):
        if left:
            raise left.pop(0)
        return mock.DEFAULT

    return mock.patch.object(link_source, "open_link", side_effect=opener, wraps=link_source.open_link)


DENIED, MISSING, BUSY = PortDenied("no permission"), PortMissing("does not exist"), PortBusy("in use")
SILENT = LinkError("its device does not answer (Protocol error)")


def test_any_error_of_the_port_is_waited_for_and_told_once(serve):
    events = []
    robot = Driver(serve().path, options=WAITS)
    robot.on_event(events.append)
    with refuse(MISSING, DENIED, DENIED, SILENT, BUSY):
        assert robot.connect().robot_id == 1
    robot.close()
    told = [event.reason for event in events if isinstance(event, Awaited)]
    assert told == [
        "does not exist",
        "no permission",
        "its device does not answer (Protocol error)",
        "in use",
    ]


def test_a_port_that_gets_its_rights_late_is_opened(serve, monkeypatch):
    """As before udev has set them; the system is asked, not a stand-in."""
    port, opened, open_ = serve().path, [], os.open

    def late(path, *args, **kwargs):
        if path == port:
            opened.append(path)
            if len(opened) < 3:
                raise PermissionError(errno.EACCES, "Permission denied")
        return open_(path, *args, **kwargs)

    monkeypatch.setattr(os, "open", late)
    with Driver(port, options=WAITS) as robot:
        assert robot.ready and len(opened) == 3


def test_without_time_the_first_error_ends_it(serve):
    with refuse(DENIED), pytest.raises(PortDenied):
        Driver(serve().path).connect()


def test_after_the_time_the_last_error_ends_it(serve):
    robot = Driver(serve().path, options=Options(port_timeout_s=0.3))
    with refuse(MISSING, *[DENIED] * 1000), pytest.raises(PortDenied):
        robot.connect()


def test_a_driver_that_waits_for_its_port_can_be_closed(tmp_path):
    robot = Driver(str(tmp_path / "port"), options=WAITS)
    waits, ended = threading.Event(), []
    robot.on_event(lambda event: waits.set())

    def connect():
        try:
            robot.connect()
        except LinkLost as error:
            ended.append(error)

    thread = threading.Thread(target=connect)
    thread.start()
    assert waits.wait(PATIENCE_S)
    robot.close()
    thread.join(PATIENCE_S)
    assert len(ended) == 1
