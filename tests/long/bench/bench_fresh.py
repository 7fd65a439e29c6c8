"""What the README's commands need in a minimal Debian: what `make test-fresh` has seen there, in build/fresh.

A figure has the release, the command and, but for amd64, the architecture in its name.
"""

import re
from typing import Dict, Iterator, Tuple

from tests.long.bench.figures import ROOT
from tests.long.bench.report import Measured

MB = {"kB": 1e-3, "MB": 1.0, "GB": 1e3}


def figures() -> Dict[str, Measured]:
    """Packages of Debian, and MB: theirs and Python's, to download and on the disk, and the sums of both."""
    found: Dict[str, Measured] = {}
    for path in (ROOT / "build" / "fresh").glob("*.sizes"):
        release, command, arch = re.findall(r"(\w+)-root-(\w+)-(\w+)", path.stem)[0]
        name = "_".join((release, command, *[arch] * (arch != "amd64")))
        found.update((f"{name}_{key}", value) for key, value in sizes(path.read_text(encoding="utf-8")))
    return found


def sizes(said: str) -> Iterator[Tuple[str, int]]:
    """The figures from what apt says it will do, and from `du -sk` of the virtual environment and pip's cache."""
    packages = re.search(r"(\d+) newly installed", said)
    fetched = re.search(r"^Need to get ([\d.]+) ([kMG]B)", said, re.M)
    kept = re.search(r"^After this operation, ([\d.]+) ([kMG]B)", said, re.M)
    if packages and fetched and kept:
        apt_mb, apt_disk_mb = (float(each[1]) * MB[each[2]] for each in (fetched, kept))
        yield from (
            ("packages", int(packages[1])),
            ("apt_mb", round(apt_mb)),
            ("apt_disk_mb", round(apt_disk_mb)),
        )
        venv, cache = (re.search(rf"^(\d+)\t.*{folder}$", said, re.M) for folder in ("venv", "/pip"))
        if venv and cache:
            venv_mb, pip_mb = (int(each[1]) / 1000 for each in (venv, cache))
            yield from (("pip_mb", round(pip_mb)), ("venv_mb", round(venv_mb)))
            yield from (("download_mb", round(apt_mb + pip_mb)), ("disk_mb", round(apt_disk_mb + venv_mb)))
