"""The rule that holds for everything that reads: a valid result, or an error of the project in one line.

Never another exception, a long time, much memory, text that commands a terminal, or a robot that moves.
"""

import re
import time
import traceback
from pathlib import Path
from typing import Callable, Dict, NamedTuple, Sequence

from mrl_driver.errors import MrlError

MOST_S = 2.0  # Longest CPU time for one input [s]; inputs have at most 32 KiB
MOST_LETTERS = 1000  # Longest error [letters]
CORPORA = Path(__file__).parent / "corpora"
_VALUES = re.compile(r"'[^']*'|\"[^\"]*\"|[\d.]+")


class Forbidden(AssertionError):
    """What an input must never cause: motion, access, a line that is two."""


class Input(NamedTuple):
    """Something that reads.

    Attributes:
        name: Name of the folder of its corpus.
        read: Reads bytes; files may be written in the folder.  It raises MrlError for what is refused.
        tokens: Words of the format.
        cost: How long one input takes, in inputs of a plain file; `make test` tries fewer of dear ones.
    """

    name: str
    read: Callable[[bytes, Path], object]
    tokens: Sequence[bytes] = ()
    cost: int = 1


class Verdict(NamedTuple):
    """What an input did."""

    shape: str  # The answer without its values: inputs with a new one are worth more changes
    problem: str  # Why it breaks the rule; empty if it does not


def judge(input_: Input, data: bytes, folder: Path, most_s: float = MOST_S) -> Verdict:
    """Read an input and judge what comes of it; it may take this CPU time [s]."""
    begun_s, said, problem = time.process_time(), "", ""
    try:
        input_.read(data, folder)
    except MrlError as error:
        said = str(error).replace(str(folder), "")
        problem = wrong_words(said)
    except (Exception, RecursionError) as error:  # noqa: BLE001 - this is what is looked for
        problem = f"{type(error).__name__}: {traceback.format_exc(limit=-4)}"
    used_s = time.process_time() - begun_s
    if not problem and used_s > most_s:
        problem = f"took {used_s:.1f} s, expected at most {most_s:g} s"
    return Verdict(_VALUES.sub("", said)[:200], problem)


def wrong_words(text: str) -> str:
    """Why a text is not an error in one line; empty if it is one."""
    if not text.strip():
        return "the error has no words"
    if len(text) > MOST_LETTERS:
        return f"the error has {len(text)} letters, expected at most {MOST_LETTERS}: {text[:80]}..."
    return "" if text.isprintable() else f"the error is not one line of printable text: {text[:300]!r}"


def require_line(text: str) -> None:
    problem = wrong_words(text)
    if problem:
        raise Forbidden(problem)


def corpus(input_: Input) -> Dict[str, bytes]:
    """The kept inputs, by file name."""
    return {path.name: path.read_bytes() for path in sorted((CORPORA / input_.name).iterdir())}
