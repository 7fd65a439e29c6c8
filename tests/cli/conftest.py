"""Boards on ptys, as the driver's tests have them; no test sees the user's own robots."""

import pytest

from tests.driver.conftest import serve  # noqa: F401


@pytest.fixture(autouse=True)
def _no_names(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("MRL_PORT", "MRL_ROBOT"):
        monkeypatch.delenv(name, raising=False)
