"""One Chromium and one `mrl web` for a module of tests; both start only for tests that ask for them."""

import pytest

from .browser import Browser
from .served import Served


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    chromium = Browser(tmp_path_factory.mktemp("chromium"))
    yield chromium
    chromium.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """For this computer alone, without a token."""
    server = Served(tmp_path_factory.mktemp("web"), "--listen", "127.0.0.1:0")
    yield server
    server.close()


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """For other computers as well: TLS, a link for driving, and one for watching only."""
    server = Served(tmp_path_factory.mktemp("shared"), "--listen", "0.0.0.0:0", links=2)
    yield server
    server.close()
