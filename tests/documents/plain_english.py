"""Finds phrases that are hard to read: `python -m tests.documents.plain_english` lists them and exits with 1.

It reads the Markdown files, without their code, every text in the Python packages (docstrings, help, errors and
comments), the launch files and makefiles, and the comments of the firmware and of the simulated chip.
"""

import ast
import io
import pathlib
import re
import sys
import tokenize
from typing import Iterator, List

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")
OTHERS = (
    *(
        "*.md",
        "*/*.md",
        "docs/*/*.md",
        "Makefile",
        "*/*.mk",
        "firmware/mrl_firmware/**/*.*",
        "sim_arduino/avr/*.[ch]",
    ),
    *("ros1_bridge/launch/*.launch", "ros1_bridge/nodes/*", "ros1_bridge/*/*.yaml"),
)
"""Patterns of the files to check besides the modules."""
PHRASES = {
    # words of the avoid list
    r"(?<!there )is no(?! longer)": "is not, there is no",
    r"(?<!there )are no(?! longer)": "are not, there are no",
    r"(?:is|are) none of": "is not one of",
    r"so many": "this many",
    r"so long(?! as)": "this long",
    r"so much": "this much",
    r"so near": "this close",
    r"so (?:often|few|little|late|soon|fast|slow|high|low|close|short)(?! (?:as|that))": "this often, this few",
    r"told": "reported, set, commanded",
    r"anew": "again",
    r"who(?:ever|m|mever)": "anybody who, that",
    r"(?<!anybody )(?<!everybody )(?<!user )(?<!user, )(?<!users )who": "that, the program that",
    r"surely": "always",
    r"amid(?:st)?": "among, within",
    r"unasked": "without a request",
    r"demand\w*": "require, check",
    r"yours:": "extend it:, add your own",
    r"take leave": "end the session",
    r"of it that": "that",
    r"not believed": "ignored",
    r"takes? no more": "accepts no, has accepted no",
    r"(?:cannot|can not) be known": "is unknown",
    r"asked (?:of|for by)": "requested",
    r"what is so": "within this",
    # words of the field
    r"check (?:values?|sums?)": "checksum",
    r"(?:a|the|its|their|no|whole|free|own) way(?! (?:to|of|from|in|that))(?<!in the way)": "path, distance",
    r"(?:robot|wheel|body)'s way": "path, distance",
    r"(?:which|wrong|other|either|worst|that|both) ways?(?! of)": "direction",
    r"on (?:its|their) way": "in transit",
    r"(?:raised|fast|faster|slow|slower|bad) (?:serial )?line": "serial link",
    r"(?:rate|rates|speed|timing) of the (?:serial )?line": "of the serial link",
    r"base types?": "drive type",
    # functions return and report, sonars measure
    r"tells? (?:whether|how|if|which|what|the)": "returns, reports, shows",
    r"(?:robot|board|driver|sonar|counter|telemetry)s? (?:tells?|says)": "reports, returns",
    r"hears?": "receives, measures",
    # older words
    r"beside": "next to",
    r"nearer": "closer",
    r"spelt": "written",
    r"one's own": "your own, its own",
    r"else's": "another's",
    r"(?:lest|thereof|therein|wherein|whereof|whence|hence|hereby|thereby|upon|albeit|shall)": "a plain word",
    r"(?:is|are) to be": "must be",
    r"begins? anew|goes on with": "starts again, continues with",
}
"""Regular expressions of whole words, and the words to use instead."""


ANY = re.compile("|".join(rf"\b{phrase}\b" for phrase in PHRASES), re.IGNORECASE)


def findings(text: str) -> Iterator[str]:
    """One line for each phrase of a text: the phrase in its context, and the words to use instead."""
    line = " ".join(text.split())
    for phrase, instead in PHRASES.items() if ANY.search(line) else ():
        for match in re.finditer(rf"\b{phrase}\b", line, re.IGNORECASE):
            context = line[max(0, match.start() - 30) : match.end() + 30]
            yield f"'{match[0]}' in '...{context}...', expected: {instead}"


def without_code(markdown: str) -> str:
    """The text of a document without its blocks of code and the code within lines."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", markdown, flags=re.S | re.M))


def texts(source: str) -> List[str]:
    """All strings and comments of a Python module."""
    nodes = ast.walk(ast.parse(source))
    strings = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return strings + [token.string for token in tokens if token.type == tokenize.COMMENT]


def comments(source: str) -> str:
    """All comments of a C or C++ file, joined, because a sentence may continue in the next line."""
    return " ".join(
        line or block for line, block in re.findall(r"//[/ -]*([^\n]*)|/\*(.*?)\*/", source, re.S)
    )


def parts_of(path: pathlib.Path) -> List[str]:
    """The texts of one file."""
    content = path.read_text(encoding="utf-8")
    if path.suffix == ".py" or path.parent.name == "nodes":
        return texts(content)
    if path.suffix in (".h", ".cpp", ".ino", ".c"):
        return [comments(content)]
    return [without_code(content) if path.suffix == ".md" else content]


def of_file(path: pathlib.Path) -> List[str]:
    """The findings in one file."""
    return [f"{path.relative_to(ROOT)}: {found}" for part in parts_of(path) for found in findings(part)]


def files() -> List[pathlib.Path]:
    """The files to check."""
    found: List[pathlib.Path] = []
    for pattern in (*OTHERS, *(f"{package}/**/*.py" for package in PACKAGES)):
        found += ROOT.glob(pattern)
    return sorted(set(found))


if __name__ == "__main__":
    FOUND = [line for path in files() for line in of_file(path)]
    print("\n".join(FOUND), end="\n" if FOUND else "")
    sys.exit(bool(FOUND))
