"""The files of the page: from this package, compressed once, and asked for again only if they have changed."""

import gzip
import hashlib
import pathlib
from typing import Dict, NamedTuple, Optional, Tuple

FOLDER = pathlib.Path(__file__).resolve().parent / "page"
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".webmanifest": "application/manifest+json",
}
PLAIN = "text/plain; charset=utf-8"
_LONGEST = 60
"""No name has more characters; the system refuses one of more than 255 bytes with an error of its own."""
_SMALL = 200
"""Shorter files are not compressed [byte]."""


class Asset(NamedTuple):
    """One file as it is sent."""

    data: bytes
    packed: bytes
    """The same, compressed; empty if that saves nothing."""
    kind: str
    tag: str
    """Changes with the content; for the headers `ETag` and `If-None-Match`."""


class Assets:
    """The files below a folder; no name leads out of it."""

    def __init__(self, folder: pathlib.Path = FOLDER) -> None:
        self._folder = folder
        self._known: Dict[str, Tuple[Tuple[int, int], Asset]] = {}

    def get(self, name: str) -> Optional[Asset]:
        """Return a file by its path below the folder, such as `vendor/uplot/uPlot.min.css`; None if there is none."""
        parts = name.split("/")
        path = self._folder.joinpath(*parts)
        if any(part in ("", ".", "..") or "\0" in part for part in parts) or len(name) > _LONGEST:
            return None
        if not path.is_file():
            return None
        seen = path.stat()
        version = seen.st_mtime_ns, seen.st_size
        known = self._known.get(name)
        if known is None or known[0] != version:
            known = self._known[name] = version, _read(path)
        return known[1]


def _read(path: pathlib.Path) -> Asset:
    data = path.read_bytes()
    packed = gzip.compress(data, mtime=0) if len(data) > _SMALL else b""
    tag = f'"{hashlib.sha256(data).hexdigest()[:16]}"'
    return Asset(data, packed if len(packed) < len(data) else b"", TYPES.get(path.suffix, PLAIN), tag)
