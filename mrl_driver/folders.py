"""The user's folders of mrl-driver, by the XDG base directory specification."""

import os


def config() -> str:
    """Return the folder for names of robots and robot models: `~/.config/mrl-driver`, or below XDG_CONFIG_HOME."""
    return _folder("XDG_CONFIG_HOME", "~/.config")


def cache() -> str:
    """For what is compiled on this machine: `~/.cache/mrl-driver` unless XDG_CACHE_HOME says otherwise."""
    return _folder("XDG_CACHE_HOME", "~/.cache")


def data() -> str:
    """Return the folder for recordings: `~/.local/share/mrl-driver`, or below XDG_DATA_HOME."""
    return _folder("XDG_DATA_HOME", "~/.local/share")


def _folder(variable: str, usual: str) -> str:
    """Return the folder below an XDG variable; the specification ignores a relative path."""
    base = os.environ.get(variable, "")
    return os.path.join(base if os.path.isabs(base) else os.path.expanduser(usual), "mrl-driver")
