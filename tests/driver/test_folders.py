"""Where the user's own files are."""

import pytest

from mrl_driver import folders


@pytest.mark.parametrize(
    "config, cache, expected",
    [
        (None, None, ("/home/ada/.config/mrl-driver", "/home/ada/.cache/mrl-driver")),
        ("/c", "/d", ("/c/mrl-driver", "/d/mrl-driver")),
        ("", "relative/path", ("/home/ada/.config/mrl-driver", "/home/ada/.cache/mrl-driver")),
    ],
)
def test_they_are_in_the_home_folder_unless_a_variable_names_an_absolute_path(
    monkeypatch, config, cache, expected
):
    for name, value in (("HOME", "/home/ada"), ("XDG_CONFIG_HOME", config), ("XDG_CACHE_HOME", cache)):
        monkeypatch.delenv(name, raising=False) if value is None else monkeypatch.setenv(name, value)
    assert (folders.config(), folders.cache()) == expected
