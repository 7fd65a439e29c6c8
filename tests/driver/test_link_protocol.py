"""Every transport offers what `Link` says."""

import inspect
import os
import tty

import pytest

from mrl_driver.driver.simulated import SteppedLink
from mrl_driver.recording.recorded_link import RecordedLink
from mrl_driver.transport.link import Link, SerialLink
from mrl_driver.transport.pyserial_link import UrlLink
from mrl_driver.transport.sockets import TcpLink, UdpLink
from tests.scripted_line import Nobody

METHODS = [name for name, _ in inspect.getmembers(Link, inspect.isfunction) if not name.startswith("_")]


def test_the_protocol_has_these_methods():
    assert METHODS == ["close", "fileno", "read", "set_baud", "wake", "write"]


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("transport", [SerialLink, TcpLink, UdpLink, UrlLink, RecordedLink, SteppedLink])
def test_a_transport_has_the_methods_of_a_link_with_their_parameters(transport, name):
    assert inspect.signature(getattr(transport, name)) == inspect.signature(getattr(Link, name))


def test_an_open_port_is_a_link():
    master, slave = os.openpty()
    tty.setraw(slave)
    port = SerialLink(os.ttyname(slave))
    assert isinstance(port, Link) and isinstance(RecordedLink(port, lambda way, data: None), Link)
    port.close()
    os.close(master)
    os.close(slave)


def test_a_board_in_simulated_time_is_a_link():
    assert isinstance(SteppedLink(Nobody()), Link)


def test_what_lacks_a_method_is_no_link():
    assert not isinstance(Nobody(), Link)
