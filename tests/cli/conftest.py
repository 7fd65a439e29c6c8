"""Boards on ptys, as the driver's tests have them; no test sees the user's own robots."""

import signal

import pytest

from tests.driver.conftest import patient, prompt, serve  # noqa: F401


@pytest.fixture(autouse=True)
def _alone(tmp_path, monkeypatch):
    """An own folder for settings; the signal handlers of `mrl` go when the test ends."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("MRL_PORT", "MRL_ROBOT"):
        monkeypatch.delenv(name, raising=False)
    handlers = {
        number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    }
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
