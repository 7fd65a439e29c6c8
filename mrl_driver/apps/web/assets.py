"""The files of the page: from this package, compressed once, and asked for again only if they have changed."""

import gzip
import hashlib
import pathlib
from typing import Dict, NamedTuple

FOLDER = pathlib.Path(__file__).resolve().parent / "page"
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
PLAIN = "text/plain; charset=utf-8"


class Asset(NamedTuple):
    """One file as it is sent."""

    data: bytes
    packed: bytes  # the same, compressed; empty if that saves nothing
    kind: str
    tag: str  # changes with the content; for the headers `ETag` and `If-None-Match`


def load(folder: pathlib.Path = FOLDER) -> Dict[str, Asset]:
    """Return all files by their paths below the folder, such as `vendor/uplot/uPlot.min.css`."""
    return {path.relative_to(folder).as_posix(): _read(path) for path in folder.rglob("*") if path.is_file()}


def _read(path: pathlib.Path) -> Asset:
    data = path.read_bytes()
    packed = gzip.compress(data, mtime=0)
    tag = f'"{hashlib.sha256(data).hexdigest()[:16]}"'
    return Asset(data, packed if len(packed) < len(data) else b"", TYPES.get(path.suffix, PLAIN), tag)
