"""Tests that notice: small changes to the sources, and which tests fail with them; see README.md."""

from typing import Any, Callable, Iterator, List, Sequence, Tuple

Draw = Callable[[Sequence[Any]], Sequence[Any]]
"""Takes all mutants of a group, and gives those that are tried."""
Results = Iterator[Tuple[str, int, List[str]]]
"""Each source, how many of its mutants were tried, and what survived."""
