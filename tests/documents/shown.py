"""Commands that documents show: in blocks of a shell, on indented lines, and within lines."""

import re
import shlex
from typing import Iterator, List, NamedTuple

from .blocks import ROOT, blocks

DOCUMENTS = (
    "README.md",
    "CONTRIBUTING.md",
    "HARDWARE.md",
    *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))),
    "BENCHMARKS.md",
    *(f"docs/tutorials/{path.name}" for path in sorted((ROOT / "docs" / "tutorials").glob("*.md"))),
    "docs/robots/kits.md",
    "firmware/README.md",
    "firmware/SENSORS.md",
    "ros1_bridge/README.md",
    "sim_arduino/README.md",
)
PROGRAMS = ("make", "mrl", "mrl-sim", "pip", "pytest", "python", "roslaunch", "rosrun", "sudo")
"""Within a line only these are commands; elsewhere all is."""
_PROMPT = re.compile(r"^\w*\$\s+")
_STAND_INS = {"[IMAGE=...]": "", "...": "", "n": "1", "PORT": "/dev/ttyACM0", "ID": "1", "FILE": "drive.log"}


class Shown(NamedTuple):
    """A command, and where it is shown."""

    document: str
    words: List[str]

    def __str__(self) -> str:
        return f"{self.document}: {' '.join(self.words)}"


def shown() -> List[Shown]:
    """All commands of all documents, each once."""
    found = {str(each): each for document in DOCUMENTS for each in _of(document)}
    return list(found.values())


def _of(document: str) -> Iterator[Shown]:
    text = (ROOT / document).read_text(encoding="utf-8")
    for block in blocks(document):
        if block.language in ("sh", "bash", "console"):
            yield from _lines(document, block.text.replace("\\\n", " ").splitlines())
    prose = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    yield from _lines(document, re.findall(r"^ {4}(\S.*)$", prose, re.M))
    for inline in re.findall(r"`([^`\n]+)`", prose):
        if inline.split()[0].rpartition("/")[2] in PROGRAMS and len(inline.split()) > 1:
            yield from _lines(document, [inline])


def _lines(document: str, lines: List[str]) -> Iterator[Shown]:
    for line in lines:
        bare = re.sub(r"\s#.*", "", _PROMPT.sub("", line))
        for command in re.split(r"; |\s\|\|?\s", bare):
            command = command.replace('"$(which mrl)"', "mrl")
            words = [_STAND_INS.get(word, word) for word in shlex.split(command)]
            words = [word for word in words if word and word != "sudo"]
            while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
                words = words[1:]
            if words:
                yield Shown(document, words)
