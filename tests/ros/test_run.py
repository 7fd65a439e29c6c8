"""`make run` as a program: what it prints, how it ends, and that nothing is left behind."""

import os
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

from ros1_bridge.processes import wait_until
from ros1_bridge.run import master_answers

from .rig import ROOT, START_S, free_port

END_S = 6.0


class Started:
    """A run on a ROS master of its own, logs in `folder`; its processes carry a mark in their environment."""

    def __init__(self, folder, *options, **env):
        self._mark = uuid.uuid4().hex
        uri = f"http://127.0.0.1:{free_port()}"
        self.env = {**os.environ, "ROS_MASTER_URI": uri, "MRL_RUN_MARK": self._mark, **env}
        command = [
            sys.executable,
            "-m",
            "ros1_bridge.run",
            "--engine",
            "python",
            "--logs",
            str(folder),
            *options,
        ]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=self.env,
            stdin=subprocess.DEVNULL,
            stdout=pipe,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def alive(self):
        """Process ids of all that belong to the run, the dead but unreaped ones left out."""
        return [pid for pid in map(int, filter(str.isdigit, os.listdir("/proc"))) if self._is_ours(pid)]

    def _is_ours(self, pid):
        try:
            return self._mark.encode() in Path(f"/proc/{pid}/environ").read_bytes()
        except OSError:
            return False

    def named(self, name):
        """The process whose command line has `name`."""
        found = [p for p in self.alive() if name.encode() in Path(f"/proc/{p}/cmdline").read_bytes()]
        return found[0] if found else None

    def wait_for_odometry(self):
        """Read output up to the first line with a pose."""
        for line in self.process.stdout:
            if " s  x " in line:
                return
        raise AssertionError("the run ended before its first odometry")

    def end(self):
        """Wait for the end; the rest of the output."""
        return self.process.communicate(timeout=START_S)[0]


@pytest.fixture
def start(tmp_path):
    runs = []

    def starter(*options, **env):
        runs.append(Started(tmp_path, *options, **env))
        return runs[-1]

    yield starter
    for run in runs:
        for pid in run.alive():
            os.kill(pid, signal.SIGKILL)
        run.process.stdout.close()
        run.process.wait()


def test_duration_ends_the_run_with_a_summary_and_nothing_left(start):
    run = start("--duration", "2.5")
    output = run.end()
    assert run.process.returncode == 0, output
    assert output.splitlines()[-1].startswith("ran 2.5 s: pose x ")
    assert "0 link errors" in output
    assert run.alive() == []


def test_interrupt_ends_everything(start):
    run = start()
    run.wait_for_odometry()
    run.process.send_signal(signal.SIGINT)
    output = run.end()
    assert run.process.returncode == 130, output
    assert run.alive() == []


def test_killed_supervisor_leaves_nothing(start):
    run = start()
    run.wait_for_odometry()
    run.process.kill()
    assert wait_until(lambda: run.alive() == [], END_S), [
        Path(f"/proc/{pid}/cmdline").read_bytes() for pid in run.alive()
    ]


def test_part_that_dies_ends_the_run_with_its_code_and_words(start):
    run = start()
    run.wait_for_odometry()
    os.kill(run.named("sim_arduino"), signal.SIGKILL)
    output = run.end()
    assert run.process.returncode in (6, 137)
    assert "ended with exit code" in output
    assert run.alive() == []


def test_foreign_roscore_is_used_and_left_running(start, master):
    run = start("--duration", "1", ROS_MASTER_URI=master["ROS_MASTER_URI"])
    assert "using the roscore that runs at" in run.end()
    assert run.process.returncode == 0
    assert master_answers(master["ROS_MASTER_URI"])


def test_real_robot_that_is_not_there_is_one_line(start):
    run = start("--port", "/dev/not_there")
    output = run.end()
    assert run.process.returncode == 3
    assert "does not exist" in output


def test_real_robot_is_not_moved_unasked(start, rig):
    wire = rig.tap(rig.board().port)
    run = start("--port", wire.port, "--duration", "2")
    assert run.end()
    assert run.process.returncode == 0
    assert not any(b"@11," in data for _, data in wire.sent)
