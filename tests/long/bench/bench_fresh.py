"""What the README's commands need in a minimal Debian: what `make test-fresh` has seen there, in build/fresh.

A figure has the release, the command and, but for amd64, the architecture in its name.
"""

import re
from typing import Dict, Iterator, Tuple

from tests.long.bench.figures import ROOT
from tests.long.bench.report import Measured

MB = {"kB": 1e-3, "MB": 1.0, "GB": 1e3}


def figures() -> Dict[str, Measured]:
    """Packages of Debian; MB of theirs and of the virtual environment; times to the first motion."""
    found: Dict[str, Measured] = {}
    for path in (ROOT / "build" / "fresh").glob("*-root-*.sizes"):
        release, command, arch = re.findall(r"(\w+)-root-(\w+)-(\w+)", path.stem)[0]
        name = "_".join((release, command, *[arch] * (arch != "amd64")))
        said = path.read_text(encoding="utf-8")
        found.update((f"{name}_{key}", value) for key, value in (*sizes(said), *times(said)))
    return found


def times(said: str) -> Iterator[Tuple[str, float]]:
    """The figures from what `tests.packaging.first_motion` prints of a clone and of a wheel."""
    pattern = r"^(.+), Python 3.*\n.*\(CPU ([\d.]+) s\); first motion after ([\d.]+) s"
    for source, pip_s, moved_s in re.findall(pattern, said, re.M):
        kind = "wheel" if source.endswith(".whl") else "clone"
        yield f"{kind}_pip_cpu_s", float(pip_s)
        yield f"{kind}_first_motion_s", float(moved_s)


def sizes(said: str) -> Iterator[Tuple[str, int]]:
    """The figures from what apt says it will do, and from `du -sk` of the virtual environment."""
    packages = re.search(r"(\d+) newly installed", said)
    fetched = re.search(r"^Need to get ([\d.]+) ([kMG]B)", said, re.M)
    kept = re.search(r"^After this operation, ([\d.]+) ([kMG]B)", said, re.M)
    venv = re.search(r"^(\d+)\t.*venv$", said, re.M)
    if packages and fetched and kept:
        yield "packages", int(packages[1])
        yield "download_mb", round(float(fetched[1]) * MB[fetched[2]])
        yield "disk_mb", round(float(kept[1]) * MB[kept[2]])
    if venv:
        yield "venv_mb", round(int(venv[1]) / 1000)
