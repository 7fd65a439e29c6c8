"""Changes inputs at random: bytes, numbers, words of the format, and pieces of other inputs."""

import random
import re
from typing import Callable, Sequence

from tests.long.fuzz import damage

MOST_BYTES = 32768  # Longest input [byte]; one more than that is cut
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
_ODD = (
    *(b"0", b"-1", b"1", b"255", b"256", b"1023", b"32767", b"32768", b"-32769", b"65536", b"4294967296", b"1e308"),
    *(b"nan", b".nan", b"NaN", b"inf", b".inf", b"-Infinity", b"1e999", b"-1e-320", b"9" * 400, b"9" * 5000),
    *(b"\xb2", b"\xd9\xa1", b"0x10", b"+5", b"007", b"true", b"null", b"''", b"[]", b"{}", b"[[]]"),
)  # fmt: skip
"""What stands where a number is expected."""
_TOKENS = (
    *(b"\n", b"\r\n", b"\0", b"\x1b[2J", b"\xff\xfe", b"\xe2\x80\xae", b" ", b"\t", b'"', b"'", b"\\", b"/", b"../"),
    *(b"[", b"]", b"{", b"}", b":", b",", b"#", b"%s", b"&a", b"*a", b"<<: *a", b"!!", b"</script>", b"NULL"),
)  # fmt: skip
"""Bytes that mean something to many formats."""


def mutate(data: bytes, others: Sequence[bytes], tokens: Sequence[bytes], rng: random.Random) -> bytes:
    """Return an input changed in one to eight places; `others` lend pieces, `tokens` are words of its format."""
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        if len(data) < 2:
            return data + rng.choice((*_TOKENS, *_ODD, *tokens))
        change = rng.choice(_BYTES + _TEXTS * 2)
        data = change(data, rng) if change in _BYTES else change(data, rng, others, tokens)  # type: ignore
    return data[:MOST_BYTES]


def _number(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """Another number, or none, in place of one."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    start, end = rng.choice(found).span()
    return data[:start] + rng.choice(_ODD) + data[end:]


def _token(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    i = rng.randrange(len(data) + 1)
    return data[:i] + rng.choice((*_TOKENS, *tokens)) + data[i:]


def _word(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    words = list(re.finditer(rb"\w+", data))
    if not words:
        return data
    start, end = rng.choice(words).span()
    return data[:start] + rng.choice((*_ODD, *tokens, *_TOKENS)) + data[end:]


def _repeat(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    i = rng.randrange(len(data))
    piece = data[i : i + rng.choice((1, 1, 2, 5, 20, 100))]
    return data[:i] + piece * rng.choice((2, 3, 10, 40, 2000)) + data[i:]


def _splice(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    other = rng.choice(others)
    return data[: rng.randrange(len(data))] + other[rng.randrange(len(other) + 1) :]


def _cut(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    return data[: rng.randrange(len(data))]


def _line(data: bytes, rng: random.Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A line less, or twice, or elsewhere."""
    lines = data.splitlines(True)
    taken = lines.pop(rng.randrange(len(lines)))
    for _ in range(rng.randrange(3)):
        lines.insert(rng.randrange(len(lines) + 1), taken)
    return b"".join(lines)


_BYTES: "tuple[Callable[..., bytes], ...]" = (*damage.EXACT, *damage.LOSSY)
_TEXTS: "tuple[Callable[..., bytes], ...]" = (_number, _token, _word, _repeat, _splice, _cut, _line)
