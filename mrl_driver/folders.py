"""The user's folders of mrl-driver, as the XDG base directory rules place them."""

import os


def config() -> str:
    """For names of robots and robot models: `~/.config/mrl-driver` unless XDG_CONFIG_HOME says otherwise."""
    return _folder("XDG_CONFIG_HOME", "~/.config")


def cache() -> str:
    """For what is compiled on this machine: `~/.cache/mrl-driver` unless XDG_CACHE_HOME says otherwise."""
    return _folder("XDG_CACHE_HOME", "~/.cache")


def _folder(variable: str, usual: str) -> str:
    """By the rules a relative path is ignored."""
    base = os.environ.get(variable, "")
    return os.path.join(base if os.path.isabs(base) else os.path.expanduser(usual), "mrl-driver")
