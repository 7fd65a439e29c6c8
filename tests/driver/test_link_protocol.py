"""Every transport offers what `Link` says."""

import inspect

import pytest

from mrl_driver.driver.simulated import SteppedLink
from mrl_driver.recording.recorded_link import RecordedLink
from mrl_driver.transport.link import Link, SerialLink
from mrl_driver.transport.pyserial_link import UrlLink
from mrl_driver.transport.sockets import TcpLink, UdpLink

METHODS = [name for name, _ in inspect.getmembers(Link, inspect.isfunction) if not name.startswith("_")]


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("transport", [SerialLink, TcpLink, UdpLink, UrlLink, RecordedLink, SteppedLink])
def test_a_transport_has_the_methods_of_a_link_with_their_parameters(transport, name):
    assert inspect.signature(getattr(transport, name)) == inspect.signature(getattr(Link, name))
