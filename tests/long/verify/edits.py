"""Defects that are put into copies of sources."""

import shutil
from pathlib import Path
from typing import Optional, Tuple

from tests.long.bench.figures import ROOT

SOURCE = ROOT / "firmware" / "mrl_firmware"
Edit = Tuple[str, str, str]
"""Name of a file of the firmware, what stands there once, and what takes its place."""


def edited(path: Path, old: str, new: str) -> str:
    """The text of a file with `new` in place of `old`, which it must have once."""
    text = path.read_text()
    if text.count(old) != 1:
        raise ValueError(f"{path.name} has {text.count(old)} times {old!r}, expected once")
    return text.replace(old, new)


def sketch(folder: Path, edit: Optional[Edit]) -> Path:
    """Return the firmware's folder, or a copy of it in `folder` with the edit."""
    if not edit:
        return SOURCE
    copy = folder / SOURCE.name
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(SOURCE, copy)
    name, old, new = edit
    (path,) = copy.rglob(name)
    path.write_text(edited(path, old, new))
    return copy
