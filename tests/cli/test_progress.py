"""Bars and spinners: on a terminal alone."""

import contextlib
import os

import pytest

from mrl_driver.cli.commands.progress import progress, waiting


def on_terminal(run):
    """What a terminal shows of it."""
    master, slave = os.openpty()
    try:
        with os.fdopen(slave, "w") as stderr, contextlib.redirect_stderr(stderr):
            run()
            stderr.write("end of it")
            stderr.flush()
            shown = ""
            while "end of it" not in shown:
                shown += os.read(master, 65536).decode()
        return shown
    finally:
        os.close(master)


def read_a_file():
    with progress("reading drive.mrl", 2.0) as advance:
        advance(1.0)
        advance(1.0)


def wait_for_the_board():
    with waiting("waiting for the board to answer"):
        pass


@pytest.mark.parametrize(
    ("run", "words"),
    [(read_a_file, "reading drive.mrl"), (wait_for_the_board, "waiting for the board to answer")],
)
def test_it_is_shown_on_a_terminal_alone(run, words, monkeypatch, capsys):
    monkeypatch.setenv("TERM", "xterm")
    assert words in on_terminal(run)
    run()
    assert capsys.readouterr() == ("", "")
