"""Defects that are put into copies of sources."""

from pathlib import Path


def edited(path: Path, old: str, new: str) -> str:
    """The text of a file with `new` in place of `old`, which it must have once."""
    text = path.read_text()
    if text.count(old) != 1:
        raise ValueError(f"{path.name} has {text.count(old)} times {old!r}, expected once")
    return text.replace(old, new)
