"""`make run` as a program: what it prints, how it ends, that nothing is left behind, and its own ROS master."""

import contextlib
import fcntl
import itertools
import os
import pty
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
import uuid
import xmlrpc.client
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner
from rosgraph.masterapi import is_online

from mrl_driver.robot import models
from ros1_bridge.demo import launcher
from ros1_bridge.demo.launcher import Run, start_master
from ros1_bridge.node.processes import Child, RunError, answers, environment, free_port
from tests.waiting import PATIENCE_S, wait_until

from .rig import ROOT, START_S

MOVE = 11
PYTHON = ("--engine", "python")
LOOKS = 10  # Pictures of the live view, which take a second, before a key is pressed


class Started:
    """A run with its logs in `folder`; its processes carry a mark in their environment."""

    def __init__(self, folder, *options, uri, terminal=None, **variables):
        self._mark = uuid.uuid4().hex
        env = {**os.environ, "ROS_MASTER_URI": uri, "MRL_RUN_MARK": self._mark, "TERM": "xterm", **variables}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "ros1_bridge.demo.launcher", "--logs", str(folder), *options],
            cwd=ROOT,
            env=env,
            stdin=subprocess.DEVNULL if terminal is None else terminal,
            stdout=subprocess.PIPE if terminal is None else terminal,
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
        for pid in self.alive():
            with contextlib.suppress(OSError):  # it has ended since
                if name.encode() in Path(f"/proc/{pid}/cmdline").read_bytes():
                    return pid
        return None

    def wait_for(self, words):
        """Read output up to the first line with `words`; that line."""
        seen = []
        for line in self.process.stdout:
            seen.append(line)
            if words in line:
                return line
        raise AssertionError(f"the run ended before it printed {words!r}: {''.join(seen)}")

    def wait_for_odometry(self):
        """Read output up to the first line with a pose."""
        self.wait_for(" s  x ")

    def end(self):
        """Wait for the end; the rest of the output."""
        return self.process.communicate(timeout=START_S)[0]


@contextlib.contextmanager
def starting(folder, master):
    """Starts runs: with the worker's master in their environment, or with `alone` one that is not there."""
    runs = []

    def starter(*options, alone=False, **how):
        uri = f"http://127.0.0.1:{free_port()}" if alone else master["ROS_MASTER_URI"]
        runs.append(Started(folder, *options, uri=uri, **how))
        return runs[-1]

    yield starter
    for run in runs:
        for pid in run.alive():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if run.process.stdout:
            run.process.stdout.close()
        run.process.wait()


@pytest.fixture
def start(tmp_path, master):
    with starting(tmp_path, master) as starter:
        yield starter


def test_duration_ends_the_run_of_the_firmwares_image_with_a_summary_and_nothing_left(start):
    run = start("--duration", "1", alone=True)
    output = run.end()
    assert run.process.returncode == 0, output
    assert re.search(r"^ran [1-9]\d*\.\d s: pose x ", output, re.M)
    assert re.search(r"^next:(\n  .{1,78}){3}\n\Z", output, re.M)
    assert re.search(r"\b\d+ link errors", output) and "emulated in Python" not in output
    assert run.alive() == []


def test_killed_supervisor_leaves_nothing(start):
    run = start(*PYTHON, alone=True)
    run.wait_for_odometry()
    run.process.kill()
    wait_until(lambda: run.alive() == [], step_s=0.1, what="the end of all its processes")


def shown(user, words, key=b""):
    """Read the terminal until it shows `words`; press a key with each picture until then, which holds it down."""
    seen, until = b"", time.monotonic() + START_S
    while words not in seen:
        if key:
            os.write(user, key)
        assert select.select([user], [], [], max(0.0, until - time.monotonic()))[0], seen[-2000:]
        seen += os.read(user, 65536)


def test_real_robot_is_driven_by_keys_alone_and_q_gives_back_the_terminal(start, rig, master):
    """On a terminal, while a roscore is there, which is left running; nothing moves before a key is pressed."""
    user, program = pty.openpty()
    fcntl.ioctl(program, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
    settings, wire = termios.tcgetattr(program), rig.tap(rig.board().port)
    run = start("--port", wire.port, terminal=program)
    for _ in range(LOOKS):
        shown(user, b" Hz, ")
    unasked, since = [data for _, data in wire.sent], time.monotonic()
    assert unasked and not any(b"@11," in data for data in unasked)
    shown(user, b"+0.250 m/s", key=b"w")
    wire.wait_for(MOVE, since)
    shown(user, b"stopped")
    os.write(user, b"q")
    shown(user, b"ran ")
    assert run.process.wait(START_S) == 0 and termios.tcgetattr(program) == settings
    assert is_online(master["ROS_MASTER_URI"])
    os.close(user)
    os.close(program)


def test_relative_paths_are_those_of_the_folder_in_which_the_run_began(tmp_path, monkeypatch):
    """The parts have other working folders."""
    seen = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        launcher, "supervise", lambda run, *names: seen.extend([str(run.logs.parent), *names[:2]])
    )
    monkeypatch.setattr(launcher, "handle_end_signals", lambda *_, **options: {})
    Path("own.yaml").write_text(Path(models.path_of("traxbot")).read_text())
    os.symlink("/dev/null", "ttySIM0")
    done = CliRunner().invoke(launcher.main, ["--robot", "own.yaml", "--port", "ttySIM0", "--logs", "logs"])
    assert done.exit_code == 0, done.output
    assert seen == [f"{tmp_path}/{name}" for name in ("logs", "own.yaml", "ttySIM0")]


@pytest.mark.parametrize(
    "options, code, words",
    [
        (("--port", "/dev/not_there"), 3, "[port_missing]"),
        (
            ("--logs", "/dev/null/my logs"),
            2,
            "is it another user's? Then: sudo chown -R $USER '/dev/null/my logs'",
        ),
    ],
)
def test_run_that_cannot_begin_is_one_line(start, options, code, words):
    """At once: not even a roscore is started."""
    run = start(*options)
    output = run.end()
    assert run.process.returncode == code and len(output.splitlines()) == 1 and words in output


URI = "ROS_MASTER_URI="


def nodes_on(uri):
    """Names of all nodes that publish, subscribe or serve on a master."""
    with xmlrpc.client.ServerProxy(uri) as proxy:
        state = proxy.getSystemState("/tests")[2]
    return {node for kind in state for _, nodes in kind for node in nodes}


def uri_of(run):
    """The master that a run names, read from its output."""
    return run.wait_for(URI).split(URI)[1].split()[0]


@pytest.fixture(scope="module")
def pair(tmp_path_factory, master):
    """Two runs at once where a master is there already: their masters, nodes, logs and ends.

    The first one is interrupted, and the emulated board of the second is killed.
    """
    folder = tmp_path_factory.mktemp("pair") / "run"
    with starting(folder, master) as starter:
        runs = [starter(*PYTHON) for _ in range(2)]
        uris = [uri_of(run) for run in runs]
        for run in runs:
            run.wait_for_odometry()
        nodes = [nodes_on(uri) for uri in uris]
        foreign = nodes_on(master["ROS_MASTER_URI"])
        runs[0].process.send_signal(signal.SIGINT)
        os.kill(runs[1].named("sim_board"), signal.SIGKILL)
        outputs = [run.end() for run in runs]
        codes = [run.process.returncode for run in runs]
        alive = [run.alive() for run in runs]
        logs = list(folder.glob("*/roslaunch.log"))
        yield SimpleNamespace(
            uris=uris, nodes=nodes, foreign=foreign, outputs=outputs, codes=codes, alive=alive, logs=logs
        )


def test_two_runs_at_once_have_master_and_logs_each_and_stay_off_that_of_the_environment(pair, master):
    assert len({*pair.uris, master["ROS_MASTER_URI"]}) == 3 and len(pair.logs) == 2
    assert all({"/robot_node", "/run/rosout"} <= nodes for nodes in pair.nodes)
    assert not {"/robot_node", "/demo_view"} & pair.foreign


def test_interrupt_and_death_of_a_part_end_everything_with_a_code(pair):
    assert pair.codes[0] == 130 and pair.codes[1] in (6, 137), pair.outputs
    assert "ended with exit code" in pair.outputs[1] and pair.alive == [[], []]


def test_the_words_of_a_part_that_ended_are_its_last_line_without_colours(tmp_path):
    script = r"printf 'usage: x\n  [--y]\nx: error: \033[31mno y\033[0m\n====\033[0m\n'; exit 2"
    child = Child("x", ("sh", "-c", script), tmp_path / "x.log", dict(os.environ), tmp_path)
    child.finish(PATIENCE_S)
    assert child.last_words() == f"x ended with exit code 2: x: error: no y (its log is {child.log})"


@pytest.fixture
def run(tmp_path):
    """A run that has started nothing, with programs in a folder `bin` before the others; ended after the test."""
    (tmp_path / "bin").mkdir()
    made = Run(
        {**environment(tmp_path, free_port()), "PATH": f"{tmp_path}/bin:{os.environ['PATH']}"}, tmp_path
    )
    yield made
    made.stop()


def stand_in(folder, lines):
    """In place of rosmaster, a shell script."""
    fake = folder / "bin" / "rosmaster"
    fake.write_text(f"#!/bin/sh\n{lines}\n")
    fake.chmod(0o755)


def test_port_that_another_master_has_is_refused(run, master):
    """Its nodes would get the commands."""
    run.env["ROS_MASTER_URI"] = master["ROS_MASTER_URI"]
    with pytest.raises(RunError, match="port .* is already in use; run the same command again"):
        start_master(run)


def test_another_master_at_the_address_does_not_count(run, master):
    assert not answers(run.start("rosmaster", "sleep", "999"), master["ROS_MASTER_URI"])


@pytest.mark.parametrize("reply", [None, b"hello", b"HTTP/1.0 200 OK\r\n\r\nhello"])
def test_another_program_at_the_address_does_not_count(run, reply):
    """Not even one that says nothing, for which Ctrl-C would wait."""

    def serve():
        with listener.accept()[0] as connection:
            connection.recv(65536)
            connection.sendall(reply)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = threading.Thread(target=serve)
        if reply:
            server.start()
        uri = f"http://127.0.0.1:{listener.getsockname()[1]}"
        assert not answers(run.start("rosmaster", "sleep", "999"), uri)
        if reply:
            server.join()


def test_a_master_that_is_slow_is_waited_for_and_said(run, tmp_path, monkeypatch, capsys):
    """On this clock the wait takes hours: a limit would end it."""
    slow = tmp_path / "slow"
    stand_in(tmp_path, f"until [ -e '{slow}' ]; do sleep 0.02; done; exec {shutil.which('rosmaster')} \"$@\"")
    ticks = itertools.count(step=1000)
    clock = SimpleNamespace(
        monotonic=lambda: next(ticks), sleep=lambda _: next(ticks) > 20_000 and slow.touch()
    )
    monkeypatch.setattr(launcher, "time", clock)
    start_master(run)
    assert is_online(run.env["ROS_MASTER_URI"])
    assert capsys.readouterr().out.count("the ROS master is still starting; its log is ") == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGQUIT])
def test_signal_while_the_master_starts_ends_everything(start, tmp_path, number):
    (tmp_path / "bin").mkdir()
    stand_in(tmp_path, "exec sleep 999")
    run = start(*PYTHON, alone=True, PATH=f"{tmp_path}/bin:{os.environ['PATH']}")
    run.wait_for("starting the ROS node")
    wait_until(lambda: run.named("sleep"), step_s=0.02)
    run.process.send_signal(number)
    run.end()
    assert run.process.returncode == 128 + number and run.alive() == []


def test_each_master_has_a_home_of_its_own(tmp_path):
    """Two masters that make one home at the same time end with an error."""
    assert environment(tmp_path, 20001)["ROS_HOME"] != environment(tmp_path, 20002)["ROS_HOME"]


def test_port_of_the_master_is_none_that_connections_get():
    """Another program would take it now and then, before roscore does."""
    first = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
    assert all(free_port() < first for _ in range(10))
