"""Runs `mrl` in this process: what it prints, and its exit code."""

import contextlib
import io
from typing import NamedTuple

from mrl_driver.cli import main


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def mrl(*args):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main.main([str(arg) for arg in args])
        except SystemExit as end:
            code = end.code
    return Done(code or 0, out.getvalue(), err.getvalue())


def fails(code, *args):
    """Run `mrl`, expect that exit code and one line on stderr; the line."""
    done = mrl(*args)
    assert done.returncode == code, done
    assert done.stderr.count("\n") == 1 and "Traceback" not in done.stderr, done.stderr
    return done.stderr
