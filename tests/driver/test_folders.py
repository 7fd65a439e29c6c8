"""Where the user's own files are."""

import pytest

from mrl_driver import folders


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    return tmp_path


def test_without_a_variable_they_are_in_the_home_folder(home):
    assert (folders.config(), folders.cache()) == (f"{home}/.config/mrl-driver", f"{home}/.cache/mrl-driver")


def test_variables_move_them(monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", "/c")
    monkeypatch.setenv("XDG_CACHE_HOME", "/d")
    assert (folders.config(), folders.cache()) == ("/c/mrl-driver", "/d/mrl-driver")


@pytest.mark.parametrize("value", ["", "relative/path"])
def test_a_variable_that_names_no_absolute_path_is_ignored(home, monkeypatch, value):
    monkeypatch.setenv("XDG_CONFIG_HOME", value)
    assert folders.config() == f"{home}/.config/mrl-driver"
