"""Workers end with the process that gives them work."""

import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest

from sim_arduino.experiments.workers import pool
from tests.waiting import wait_until

LONG_S = 600.0


def work(folder):
    """Takes long; notes when it begins, and when it is ended."""
    try:
        (folder / "begun").write_text(str(os.getpid()))
        time.sleep(LONG_S)
        (folder / "done").touch()
    finally:
        (folder / "ended").touch()


def is_alive(pid):
    try:
        return "Z" not in pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False


def test_an_interrupt_ends_what_is_begun_and_what_waits(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    with pytest.raises(KeyboardInterrupt), pool(1) as submit:
        for folder in (first, second):
            folder.mkdir()
            submit(work, folder)
        wait_until((first / "begun").exists)
        raise KeyboardInterrupt
    assert (first / "ended").exists() and not (first / "done").exists() and not list(second.iterdir())


def test_worker_whose_parent_is_killed_ends_its_work_and_itself(tmp_path):
    code = (
        "import pathlib, sys; from sim_arduino.experiments.workers import pool; "
        "from tests.experiments.test_workers import work\n"
        "with pool(1) as submit: submit(work, pathlib.Path(sys.argv[1])).result()"
    )
    begun = tmp_path / "begun"
    parent = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stderr=subprocess.DEVNULL)
    wait_until(lambda: begun.exists() and begun.read_text())
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    wait_until((tmp_path / "ended").exists)
    wait_until(lambda: not is_alive(int(begun.read_text())))
