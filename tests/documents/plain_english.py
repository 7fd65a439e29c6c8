"""Finds phrases that are hard to read: `python -m tests.documents.plain_english` lists them and exits with 1.

It reads the Markdown files, without their code, and every text in the Python packages: docstrings, help and errors.
"""

import ast
import pathlib
import re
import sys
from typing import Iterator, List

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")
PHRASES = {
    r"(?<!there )is no(?! longer)": "is not, there is no",
    r"(?<!there )are no(?! longer)": "are not, there are no",
    r"so many": "this many",
    r"so long(?! as)": "this long",
    r"so much": "this much",
    r"so near": "this close",
    r"told": "reported, set, commanded",
    r"anew": "again",
    r"whoever": "anybody who",
    r"who cannot": "that cannot",
    r"surely": "always",
    r"amid": "among, within",
    r"unasked": "without a request",
    r"check values?": "checksum",
}
"""Regular expressions of whole words, and the words to use instead."""
NOT_YET = ()
"""Files and folders that are not rewritten yet; remove each when it is."""


def findings(text: str) -> Iterator[str]:
    """One line for each phrase of a text: the phrase in its context, and the words to use instead."""
    line = " ".join(text.split())
    for phrase, instead in PHRASES.items():
        for match in re.finditer(rf"\b{phrase}\b", line, re.IGNORECASE):
            context = line[max(0, match.start() - 30) : match.end() + 30]
            yield f"'{match[0]}' in '...{context}...', expected: {instead}"


def without_code(markdown: str) -> str:
    """The text of a document without its blocks of code and the code within lines."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", markdown, flags=re.S | re.M))


def texts(source: str) -> List[str]:
    """All strings of a Python module."""
    nodes = ast.walk(ast.parse(source))
    return [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]


def of_file(path: pathlib.Path) -> List[str]:
    """The findings in one file."""
    content = path.read_text(encoding="utf-8")
    parts = [without_code(content)] if path.suffix == ".md" else texts(content)
    return [f"{path.relative_to(ROOT)}: {found}" for part in parts for found in findings(part)]


def files() -> List[pathlib.Path]:
    """The files to check."""
    found = [*ROOT.glob("*.md"), *ROOT.glob("*/*.md")]
    for package in PACKAGES:
        found += ROOT.glob(f"{package}/**/*.py")
    return sorted(path for path in set(found) if not str(path.relative_to(ROOT)).startswith(NOT_YET))


if __name__ == "__main__":
    FOUND = [line for path in files() for line in of_file(path)]
    print("\n".join(FOUND), end="\n" if FOUND else "")
    sys.exit(bool(FOUND))
