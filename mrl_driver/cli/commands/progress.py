"""Progress bars on stderr if it is a terminal; otherwise nothing."""

import contextlib
import sys
from typing import Callable, ContextManager, Iterator, TypeVar

Connection = TypeVar("Connection")


@contextlib.contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show a bar during the block; call the yielded function with the amount of work done."""
    if not sys.stderr.isatty() or not total:
        yield lambda amount: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        bar.console.show_cursor()  # Ctrl-Z would leave it hidden
        task = bar.add_task(what, total=total)
        yield lambda amount: bar.advance(task, amount)


@contextlib.contextmanager
def waiting(what: str) -> Iterator[None]:
    """Show a spinner during the block."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status(what):
        console.show_cursor()  # Ctrl-Z would leave it hidden
        yield


@contextlib.contextmanager
def answered(connection: ContextManager[Connection]) -> Iterator[Connection]:
    """Connect for the block, and show a spinner until the board has answered."""
    with contextlib.ExitStack() as stack:
        with waiting("waiting for the board to answer"):
            driver = stack.enter_context(connection)
        yield driver
