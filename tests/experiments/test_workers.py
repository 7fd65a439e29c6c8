"""Workers end with the process that gives them work."""

import contextlib
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import time

import pytest

from mrl_driver.errors import MrlError
from sim_arduino.experiments import workers
from sim_arduino.experiments.workers import pool
from tests.waiting import PATIENCE_S, wait_until

LONG_S, STEP_S = 600.0, 0.05


def sleep_long():
    """Sleeps in short steps: a signal just before one long sleep would not end it."""
    end_s = time.monotonic() + LONG_S
    while time.monotonic() < end_s:
        time.sleep(STEP_S)


def work(folder):
    """Takes long; notes when it begins, and when it is ended."""
    try:
        (folder / "begun").write_text(str(os.getpid()))
        sleep_long()
        (folder / "done").touch()
    finally:
        (folder / "ended").touch()


def is_alive(pid):
    try:
        return "Z" not in pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False


def worker_of(folder):
    """The process that has begun the work of this folder."""
    begun = folder / "begun"
    return int(wait_until(lambda: begun.exists() and begun.read_text()))


def test_a_worker_that_is_told_to_end_ends_its_work_and_itself(tmp_path):
    """`timeout` sends its signal to the workers, too; one that waited for more work would keep its parent for ever."""
    with pool(1) as submit:
        future = submit(work, tmp_path)
        worker = worker_of(tmp_path)
        os.kill(worker, signal.SIGTERM)
        for each in (future, submit(work, tmp_path)):
            with pytest.raises(MrlError, match="a worker process has ended early"):
                each.result(PATIENCE_S)
    assert (tmp_path / "ended").exists() and not is_alive(worker)


def stay(folder):
    """Takes long, and swallows every signal that would end it."""
    (folder / "begun").write_text(str(os.getpid()))
    while True:
        with contextlib.suppress(SystemExit):
            time.sleep(LONG_S)


def test_work_that_does_not_end_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "GRACE_S", 0.3)
    with pytest.raises(KeyboardInterrupt), pool(1) as submit:
        submit(stay, tmp_path)
        worker = worker_of(tmp_path)
        raise KeyboardInterrupt
    assert not is_alive(worker)


def divide(numerator, denominator):
    return numerator / denominator


def test_results_and_errors_come_back_with_the_place_of_the_error():
    with pool(2) as submit:
        results = [submit(divide, each, 2) for each in range(5)]
        wrong, unknown = submit(divide, 1, 0), submit(lambda: None)
    assert [future.result() for future in results] == [0.0, 0.5, 1.0, 1.5, 2.0]
    error = wrong.exception()
    assert isinstance(error, ZeroDivisionError) and "in divide" in str(error.__cause__)
    assert isinstance(unknown.exception(), (AttributeError, pickle.PicklingError))


def test_worker_whose_parent_is_killed_ends_its_work_and_itself(tmp_path):
    code = (
        "import pathlib, sys; from sim_arduino.experiments.workers import pool; "
        "from tests.experiments.test_workers import work\n"
        "with pool(1) as submit: submit(work, pathlib.Path(sys.argv[1])).result()"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stderr=subprocess.DEVNULL)
    worker = worker_of(tmp_path)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    wait_until((tmp_path / "ended").exists)
    wait_until(lambda: not is_alive(worker))
