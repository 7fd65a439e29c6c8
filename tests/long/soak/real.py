"""The soak in real time: faults of process, disk, master, subscriber and port, on three robots at once.

What needs no process, port or master of its own strikes in simulated time.
"""

import gc
import os
import random
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Tuple

import click

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError
from mrl_driver.recording.recording import Recording
from tests.long.programs import PYTHON, ROOT, Program, holds, left_behind
from tests.waiting import wait_until

from .robot import LATE_S, SoakRobot
from .tally import GROWTH, Tally

TIMEOUT_S, BEYOND_S = 0.3, 0.05
HOST_DEAD_S, SIGNAL_S, EXIT_S = 0.3, 0.1, 2.0
RECORDING_LOST_S = 1.0
HEARD_S = 0.04  # Mean time between two messages that are published every 20 ms [s]
AFTER_S = 0.5  # How long no motion is watched after a fault [s]
LOOK_S = 0.15  # The emulator has run up to a time at the latest so long after it [s]
CONNECTIONS = 4  # Connections of a node that are made and ended while it is looked at
FIRST_ROUND = 20  # Faults after which a program has all that it needs, so that it may not grow any more
Fault = Callable[[], None]


class Rig:
    """A robot and what drives it; `faults` are run in random order until the end."""

    name = "rig"

    def __init__(self, folder: Path, tally: Tally, seed: int) -> None:
        self.folder, self.tally, self.rng = folder / self.name, tally, random.Random(f"{self.name} {seed}")
        self.folder.mkdir()
        self.robot = SoakRobot(str(self.folder / "robot"))
        self.fault = ""
        self.ended = False

    def deck(self) -> List[Fault]:
        raise NotImplementedError

    def begin(self) -> None:
        raise NotImplementedError

    def recover(self) -> None:
        """After a part that failed: begin anew."""
        raise NotImplementedError

    def end(self) -> None:
        self.robot.close()

    def run(self, until_s: float) -> None:
        self.begin()
        while True:
            deck = self.deck()
            self.rng.shuffle(deck)
            for fault in deck:
                if self.ended or time.monotonic() >= until_s:
                    return
                self.fault = fault.__name__
                self.robot.server.latest_s = 0.0
                try:
                    fault()
                except (AssertionError, MrlError, OSError, subprocess.SubprocessError) as error:
                    self.check("rig", False, error=str(error)[:300])
                    self.robot.mend()
                    self.recover()

    def struck(self, *rows: int) -> None:
        self.tally.struck(self.fault, *rows)

    def check(self, judge: str, good: bool, **what: Any) -> None:
        self.tally.check(judge, good, fault=self.fault, rig=self.name, **what)

    def check_stop(self, from_s: float, limit_s: float, until_s: Optional[float] = None) -> None:
        """From a time on nobody asks the robot to move: it must stop in time, and stay so."""
        until_s = max(from_s + limit_s + AFTER_S, until_s or 0.0)
        time.sleep(max(0.0, until_s + LOOK_S - time.monotonic()))
        window = self.robot.judge(from_s, until_s)
        late_s = self.robot.server.latest_s
        told = {
            "fault": self.fault,
            "stopped_s": window.stopped_s,
            "limit_s": limit_s,
            "computer_late_s": late_s,
        }
        if window.again and not self.robot.judge(from_s, until_s, late_s).again:
            # The last command waited for the computer, so that it is not one of after the end.
            self.tally.busy("forbidden_motion")
        else:
            self.tally.check("forbidden_motion", not window.again, rig=self.name, again=window.again, **told)
        self.tally.measured("pulses_in_a_window", window.pulses)
        if window.stopped_s is None:
            self.tally.check("time_to_stop", False, rig=self.name, **told)
        else:
            self.check_figure("time_to_stop", window.stopped_s, limit_s)

    def check_drives_on(self) -> None:
        """The commands go on, and so does the robot; a busy computer may stop it for a moment."""
        with suppress(AssertionError):
            wait_until(lambda: self.robot.driven, timeout_s=1.0)
        self.check("drives_on", self.robot.driven)

    def check_figure(self, judge: str, value: float, limit: float) -> None:
        """Judge a time; not while the computer held up the emulator."""
        if value > limit and self.robot.server.latest_s > LATE_S:
            self.tally.busy(judge)
            return
        if value <= limit:
            self.tally.measured(f"{judge}_{self.fault}", value)
        self.check(judge, value <= limit, value=round(value, 4), limit=limit)

    def check_jump(self, jump_m: float) -> None:
        self.check("pose_jump", jump_m <= 0.0, jump_m=jump_m)
        self.tally.measured("pose_jump_m", jump_m)


class DriverRig(Rig):
    """A user's program with a `Driver`, whose commands stay in force until a stop."""

    def begin(self) -> None:
        command = [PYTHON, "-m", "tests.long.soak.worker", self.robot.link, "0"]
        self.worker = Program(command, self.folder / "worker.log")
        self.worker.await_word("ready", True)

    def recover(self) -> None:
        self.worker.end()
        self.begin()

    def end(self) -> None:
        self.worker.send("end")
        with suppress(AssertionError):
            self.check_jump(self.worker.await_word("closed", True)["jump_m"])
        self.worker.end(signal.SIGTERM)
        super().end()

    def _speeds(self) -> str:
        return f"{self.rng.choice((0.1, 0.2, 0.3))} {self.rng.choice((0.0, 0.5, -0.5))}"

    def drive(self) -> None:
        """The user drives, with commands that go on."""
        self.worker.ask("keep " + self._speeds())
        wait_until(lambda: self.robot.driven, what="motion")
        time.sleep(self.rng.uniform(0.05, 0.4))

    def drive_once(self) -> None:
        """The user's last command of this fault; the robot moves."""
        for _ in range(50):
            self.worker.ask("once " + self._speeds())
            with suppress(AssertionError):
                wait_until(lambda: self.robot.driven, timeout_s=0.2)
                return
        raise AssertionError("50 commands did not move the robot")


class LiveRig(DriverRig):
    """The program lives through all faults, so that what it keeps adds up."""

    name = "live"

    def begin(self) -> None:
        super().begin()
        self._settled = 0
        self._before: Optional[Dict[str, int]] = None

    def settle(self) -> None:
        """The user stops the robot, which must obey; after the first faults, what the program holds is noted."""
        begun_s = time.monotonic()
        self.worker.ask("stop")
        wait_until(lambda: self.robot.judge(begun_s, time.monotonic()).stopped_s is not None, what="a stop")
        wait_until(lambda: self.worker.ask("state")["is_ready"], step_s=0.05, what="telemetry")
        self._settled += 1
        if self._settled == FIRST_ROUND:
            self._before = holds(self.worker.process.pid)

    def end(self) -> None:
        with suppress(AssertionError):
            self.settle()
            if self._before is not None:
                self.tally.growth("driver", self._before, holds(self.worker.process.pid), GROWTH)
            self.tally.measured("driver_frames", self.worker.ask("state")["frames"])
        super().end()

    def deck(self) -> List[Fault]:
        twice = (self.suspended, self.write_blocked, self.reopened)
        return [*twice * 2, self.disk_full, self.second_program]

    def suspended(self) -> None:
        """The program is suspended while the robot drives, and goes on later."""
        self.drive_once()
        self.struck(19)
        stopped_s = self.worker.send_signal(signal.SIGSTOP)
        time.sleep(self.rng.uniform(0.4, 2.0))
        self.worker.send_signal(signal.SIGCONT)
        self.check_stop(stopped_s, HOST_DEAD_S, time.monotonic() + AFTER_S)
        self.check_figure("age_s", self.worker.ask("state")["age_s"], 0.1)
        self.settle()

    def write_blocked(self) -> None:
        """The board takes no bytes, and the program sends many."""
        self.drive_once()
        self.struck(15)
        self.robot.server.deaf = True
        deaf_s = time.monotonic()
        self.check("write_blocks", self.worker.ask("flood 2000")["blocked"] > 0)
        time.sleep(max(0.0, deaf_s + 0.4 - time.monotonic()))
        self.robot.server.deaf = False
        self.robot.server.wake()
        self.check_stop(deaf_s, HOST_DEAD_S, time.monotonic() + 1.0)
        self.settle()

    def disk_full(self) -> None:
        """A recording goes to a full disk: the robot is driven on."""
        self.drive()
        self.struck(28)
        self.worker.ask("record /dev/full")
        time.sleep(1.0)
        self.check_drives_on()
        self.worker.ask("unrecord")
        self.settle()

    def second_program(self) -> None:
        """Another program opens the port: it is refused, and the robot is driven on."""
        self.drive()
        self.struck(17)
        refused = ""
        try:
            with Driver(self.robot.link):
                pass
        except MrlError as error:
            refused = type(error).__name__
        self.check("refused", refused == "PortBusy", got=refused)
        self.check_drives_on()
        self.settle()

    def reopened(self) -> None:
        """The driver is closed while it reads, and opened again."""
        self.drive_once()
        self.struck(27, 27, 27)
        begun_s = time.monotonic()
        closed = self.worker.ask("reopen 3")
        self.check_figure("close_s", closed["close_s"], 1.0)
        self.check_stop(begun_s, HOST_DEAD_S)
        self.settle()


class DeathRig(DriverRig):
    """The program is killed and begun again."""

    name = "death"

    def deck(self) -> List[Fault]:
        return [self.killed_recording]

    def killed_recording(self) -> None:
        """kill -9 while it records: what was recorded until a second before is readable."""
        self.drive()
        self.struck(1, 28)
        path = str(self.folder / "drive.mrl")
        begun_s = self.worker.ask("record " + path)["at_s"]
        time.sleep(self.rng.uniform(1.2, 2.5))
        killed_s = self.worker.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, HOST_DEAD_S)
        times = [entry.time_s for entry in Recording(path)]
        lost_s = (killed_s - begun_s) - (times[-1] - times[0])
        self.check_figure("recording_lost_s", lost_s, RECORDING_LOST_S)
        os.unlink(path)
        self.recover()


class RosRig(Rig):
    """The node of the robot, a program that drives it with cmd_vel, and one that listens, on an own master."""

    name = "ros"

    def begin(self) -> None:
        from rosgraph.masterapi import is_online

        from ros1_bridge.node.processes import free_port

        self._programs: List[Program] = []
        for _ in range(5):
            port = free_port()
            uri = f"http://127.0.0.1:{port}"
            own = {"ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": str(self.folder)}
            self.env = {**os.environ, **own}
            self._master = master = self._program("rosmaster", "rosmaster", "--core", "-p", str(port))
            wait_until(lambda: is_online(uri) or master.process.poll() is not None, step_s=0.02)  # noqa: B023
            if master.process.poll() is None:
                break
            master.end()
        self._start_node()
        self._operator, self._listener = self._start_operator(), self._start_operator()
        self._ready()

    def _program(self, name: str, *command: str) -> Program:
        self._programs.append(Program(command, self.folder / f"{name}.log", self.env))
        return self._programs[-1]

    def _start_node(self) -> None:
        command = (
            str(ROOT / "ros1_bridge" / "nodes" / "robot_node"),
            "__ns:=/soak",
            f"_port:={self.robot.link}",
        )
        self._node = self._program("node", *command, f"_cmd_vel_timeout:={TIMEOUT_S}")
        self._node_before: Optional[Dict[str, int]] = None
        self._node_faults = 0

    def _start_operator(self) -> Program:
        name = f"operator_{len(self._programs)}"
        return self._program("operator", PYTHON, "-m", "tests.long.soak.operator", name, "/soak")

    def _ready(self) -> None:
        """Wait for odometry: the node hears before it who sends commands already, and lets them pause."""
        for program in (self._operator, self._listener):
            before = program.ask("state")["messages"]

            def heard() -> bool:
                state = program.ask("state")  # noqa: B023
                return state["connected"] > 0 and state["messages"] > before  # noqa: B023

            wait_until(heard, step_s=0.1, what="the node")
        self._drive()
        self._settle()

    def recover(self) -> None:
        self._stop_all()
        self.begin()

    def _stop_all(self) -> None:
        for program in reversed(self._programs):
            program.end()

    def end(self) -> None:
        self._judge_node()
        self._stop_all()
        super().end()

    def deck(self) -> List[Fault]:
        """All faults; those that end the node come once, so that it lives through many others."""
        few = self.rng.choice(([self.node_killed, self.node_ended], [self.node_killed, self.master_killed]))
        return [
            *(self.source_killed, self.listener_hangs, self.listener_hangs),
            *(self.two_sources, self.node_suspended, *few),
        ]

    def _drive(self) -> None:
        self._operator.ask("keep 0.2")
        wait_until(lambda: self.robot.driven, what="motion")
        time.sleep(self.rng.uniform(0.1, 0.4))

    def _settle(self) -> None:
        """The source falls silent, and the robot stops."""
        last_s = self._operator.ask("silent")["last_s"]
        self.check_stop(last_s, TIMEOUT_S + BEYOND_S)
        self.check_jump(self._operator.ask("state")["jump_m"])
        self._node_faults += 1
        if self._node_faults == 4:
            self._node_before = holds(self._node.process.pid)

    def _judge_node(self) -> None:
        """What the node holds at the end of its life, compared with its beginning."""
        if self._node_before is not None and self._node.process.poll() is None:
            most = {**GROWTH, "descriptors": CONNECTIONS, "threads": CONNECTIONS}
            self.tally.growth("node", self._node_before, holds(self._node.process.pid), most)

    def source_killed(self) -> None:
        """kill -9 of the program that publishes cmd_vel."""
        self._drive()
        self.struck(2)
        killed_s = self._operator.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, TIMEOUT_S + BEYOND_S)
        self._operator.end()
        self._operator = self._start_operator()
        self._ready()

    def listener_hangs(self) -> None:
        """A subscriber does not read: the robot is driven on, and others hear of it."""
        self._drive()
        self.struck()
        begun_s, before = time.monotonic(), self._operator.ask("state")["messages"]
        self._listener.send_signal(signal.SIGSTOP)
        time.sleep(self.rng.uniform(1.0, 3.0))
        self.check_drives_on()
        heard = self._operator.ask("state")["messages"] - before
        self.check_figure("others_hear_s", (time.monotonic() - begun_s) / max(1, heard), HEARD_S)
        self._listener.send_signal(signal.SIGCONT)
        self._settle()

    def two_sources(self) -> None:
        self._drive()
        self.struck(26)
        self._listener.ask("keep 0.1")
        time.sleep(1.0)
        self._listener.ask("silent")
        self.check_drives_on()
        self._settle()

    def node_suspended(self) -> None:
        """The node is suspended, and its source falls silent before it goes on."""
        self._drive()
        self.struck(19)
        stopped_s = self._node.send_signal(signal.SIGSTOP)
        time.sleep(self.rng.uniform(0.4, 1.5))
        last_s = self._operator.ask("silent")["last_s"]
        time.sleep(self.rng.uniform(0.0, 0.6))
        self._node.send_signal(signal.SIGCONT)
        self.check_stop(stopped_s, HOST_DEAD_S, max(last_s, time.monotonic()) + AFTER_S)
        self._drive()
        self._settle()

    def node_killed(self) -> None:
        """kill -9 of the node."""
        self._end_node(signal.SIGKILL, 1, HOST_DEAD_S)

    def node_ended(self) -> None:
        self._end_node(signal.SIGTERM, 21, SIGNAL_S)

    def _end_node(self, number: int, row: int, limit_s: float) -> None:
        self._drive()
        self.struck(row)
        self._judge_node()
        sent_s = time.monotonic()
        self.check_figure("exit_s", self._node.end(number), EXIT_S)
        self.check_stop(sent_s, limit_s)
        self._operator.ask("silent")
        self._start_node()
        self._ready()

    def master_killed(self) -> None:
        """The master dies: cmd_vel goes on, the source dies, the robot stops; then there is a new master."""
        self._drive()
        self.struck(29)
        self._master.end(signal.SIGKILL)
        time.sleep(1.0)
        self.check_drives_on()
        killed_s = self._operator.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, TIMEOUT_S + BEYOND_S)
        self._judge_node()
        self.recover()


RIGS = (LiveRig, DeathRig, RosRig)


def own_holds() -> Dict[str, int]:
    gc.collect()
    return {**holds(os.getpid()), "threads": threading.active_count()}


def run(seconds: float, seed: int, tally: Tally) -> None:
    """Strike so long; each robot has its thread.  Ctrl-C ends it after the faults that strike now.

    The folder of logs stays if a judge has reported something; its name is printed.
    """
    before = own_holds()
    folder = Path(tempfile.mkdtemp(prefix="soak-"))
    made: Tuple[Rig, ...] = tuple(kind(folder, tally, seed + number) for number, kind in enumerate(RIGS))
    until_s = time.monotonic() + seconds
    threads = [threading.Thread(target=_run_one, args=(rig, until_s)) for rig in made]
    for thread in threads:
        thread.start()
    try:
        for thread in threads:
            thread.join()
    except KeyboardInterrupt:
        for rig in made:
            rig.ended = True
        for thread in threads:
            thread.join()
    _judge_the_end(before, tally)
    if tally.kinds:
        click.echo(f"{folder}: what the programs have said")
    else:
        shutil.rmtree(folder)


def _run_one(rig: Rig, until_s: float) -> None:
    for part in (lambda: rig.run(until_s), rig.end):
        try:
            part()
        except Exception as error:  # noqa: BLE001 - the others go on, and the report says so
            rig.check("rig", False, error=repr(error)[:300])


def _judge_the_end(before: Dict[str, int], tally: Tally) -> None:
    left = left_behind()
    tally.check("processes_left", not left, processes=left[:10])
    with suppress(AssertionError):  # the kernel takes a moment to end a thread that was joined
        wait_until(lambda: own_holds()["threads"] <= before["threads"], timeout_s=5.0, step_s=0.1)
    after, names = own_holds(), [thread.name for thread in threading.enumerate()]
    for key in ("descriptors", "threads"):
        good = after[key] <= before[key]
        tally.check(f"{key}_left", good, before=before[key], after=after[key], threads=names)
