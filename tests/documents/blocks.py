"""Code blocks of the project's documents."""

import pathlib
import re
from typing import Dict, List, NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Block(NamedTuple):
    """A fenced block: its language, its text, and the paragraph before it."""

    language: str
    text: str
    before: str


def blocks(path: str) -> List[Block]:
    """All fenced blocks of a document."""
    text = (ROOT / path).read_text(encoding="utf-8")
    found = re.finditer(r"^```(\w+)\n(.*?)^```", text, re.S | re.M)
    return [Block(m[1], m[2], text[: m.start()].rstrip().rsplit("\n\n", 1)[-1]) for m in found]


def files(path: str) -> Dict[str, Block]:
    """The blocks whose paragraph names a file, by that file."""
    named = ((re.search(r"`([\w/]+\.\w+)`", each.before), each) for each in blocks(path))
    return {match[1]: each for match, each in named if match}
