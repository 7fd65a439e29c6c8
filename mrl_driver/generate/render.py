"""Renders the command table and the robot models into the firmware's `protocol.h` and into `firmware/PROTOCOL.md`.

    python -m mrl_driver.generate            writes both files
    python -m mrl_driver.generate --check    exit code 1 and one line per stale file; writes nothing

Both files are committed, so that the Arduino IDE needs no Python.
"""

import sys
from pathlib import Path
from typing import Callable, Dict, List, Sequence

from .cpp_header import header
from .reference import reference

ROOT = Path(__file__).resolve().parent.parent.parent

FILES: Dict[str, Callable[[], str]] = {
    "firmware/mrl_firmware/protocol.h": header,
    "firmware/PROTOCOL.md": reference,
}


def stale() -> List[str]:
    """Names of the generated files that do not hold what the table says."""
    return [name for name, render in FILES.items() if _read(ROOT / name) != render()]


def main(arguments: Sequence[str]) -> int:
    """Writes what is stale, or with `--check` only names it; the exit code."""
    names = stale()
    if "--check" in arguments:
        for name in names:
            sys.stderr.write(f"{name} is stale: run `python -m mrl_driver.generate`\n")
        return 1 if names else 0
    for name in names:
        (ROOT / name).write_text(FILES[name](), encoding="utf-8")
    return 0


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
