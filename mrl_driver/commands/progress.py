"""Progress bars on stderr, where that is a terminal; elsewhere nothing."""

import contextlib
from typing import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


@contextlib.contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """A bar while the block lasts; call what it gives with the amount that was done."""
    console = Console(stderr=True)
    if not console.is_terminal or not total:
        yield lambda amount: None
        return
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda amount: bar.advance(task, amount)


@contextlib.contextmanager
def waiting(what: str) -> Iterator[None]:
    """A spinner while the block lasts."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(what):
        yield
