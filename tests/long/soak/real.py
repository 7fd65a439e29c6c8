"""The soak in real time: faults of process, disk, master, subscriber and port, on three robots at once."""

import gc
import os
import random
import signal
import subprocess
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Tuple

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError
from mrl_driver.recording.recording import Recording
from tests.waiting import wait_until

from .programs import PYTHON, ROOT, Program, holds, left_behind
from .robot import LATE_S, SoakRobot
from .tally import Tally

WATCHDOG_S, TIMEOUT_S, BEYOND_S = 0.25, 0.3, 0.05
HOST_DEAD_S, SIGNAL_S, EXIT_S, BACK_S, FROZEN_S = 0.3, 0.1, 2.0, 2.0, 0.35
AT_ONCE_S = 0.05
RECORDING_LOST_S = 1.0
WRITE_S = 0.1
HEARD_S = 0.04
"""Mean time between two messages that are published every 20 ms [s]."""
AFTER_S = 0.5
"""How long no motion is watched after a fault [s]."""
LOOK_S = 0.15
"""The emulator has run up to a time at the latest so long after it [s]."""
GROWTH_KB = 5000
CONNECTIONS = 4
"""Connections of a node that are made and ended while it is looked at."""
FIRST_ROUND = 20
"""Faults after which a program has all that it needs, so that it may not grow any more."""
Fault = Callable[[], None]


class Rig:
    """A robot and what drives it; `faults` are run in random order until the end."""

    name = "rig"

    def __init__(self, folder: Path, tally: Tally, seed: int) -> None:
        self.folder, self.tally, self.rng = folder / self.name, tally, random.Random(f"{self.name} {seed}")
        self.folder.mkdir()
        self.robot = SoakRobot(str(self.folder / "robot"), seed)
        self.fault = ""
        self.ended = False

    def deck(self) -> List[Fault]:
        """The faults of one round."""
        raise NotImplementedError

    def begin(self) -> None:
        """Start what drives the robot."""

    def end(self) -> None:
        """End it."""
        self.robot.close()

    def recover(self) -> None:
        """After a part that failed: begin anew."""

    def run(self, until_s: float, most: int) -> None:
        """Strike until a time or a number of faults."""
        count = 0
        self.begin()
        while True:
            deck = self.deck()
            self.rng.shuffle(deck)
            for fault in deck:
                if self.ended or time.monotonic() >= until_s or count >= most:
                    return
                count += 1
                self.fault = fault.__name__
                self.robot.server.latest_s = 0.0
                try:
                    fault()
                except (AssertionError, MrlError, OSError, subprocess.SubprocessError) as error:
                    self.tally.problem("rig", fault=self.fault, rig=self.name, error=str(error)[:300])
                    self.robot.mend()
                    self.recover()

    def struck(self, *rows: int) -> None:
        """Count the fault."""
        self.tally.struck(self.fault, *rows)

    def check_stop(self, from_s: float, limit_s: float, until_s: Optional[float] = None) -> None:
        """From a time on nobody asks the robot to move: it must stop in time, and stay so."""
        until_s = max(from_s + limit_s + AFTER_S, until_s or 0.0)
        time.sleep(max(0.0, until_s + LOOK_S - time.monotonic()))
        window = self.robot.judge(from_s, until_s)
        late_s = self.robot.server.latest_s
        told: Dict[str, Any] = {
            "fault": self.fault,
            "rig": self.name,
            "stopped_s": window.stopped_s,
            "limit_s": limit_s,
            "computer_late_s": round(late_s, 3),
        }
        if window.again and not self.robot.judge(from_s, until_s, late_s).again:
            # The last command waited for the computer, so that it is not one of after the end.
            self.tally.busy("forbidden_motion", again=window.again, **told)
        elif window.again:
            self.tally.problem("forbidden_motion", again=window.again, **told)
        else:
            self.tally.passed("forbidden_motion")
        self.tally.measured("pulses_in_a_window", window.pulses)
        if window.stopped_s is not None and window.stopped_s <= limit_s:
            self.tally.passed("time_to_stop")
            self.tally.measured(f"stop_s_{self.fault}", window.stopped_s)
        elif late_s > LATE_S and window.stopped_s is not None:
            self.tally.busy("time_to_stop", **told)
        else:
            self.tally.problem("time_to_stop", **told)

    def check(self, judge: str, good: bool, **what: Any) -> None:
        """Ask a judge."""
        if good:
            self.tally.passed(judge)
        else:
            self.tally.problem(judge, fault=self.fault, rig=self.name, **what)

    def check_drives_on(self) -> None:
        """The commands go on, and so does the robot; a busy computer may stop it for a moment."""
        with suppress(AssertionError):
            wait_until(lambda: self.robot.driven, timeout_s=1.0)
        self.check("drives_on", self.robot.driven)

    def check_figure(self, judge: str, value: float, limit: float) -> None:
        """Judge a time; not while the computer held up the emulator."""
        if value <= limit:
            self.tally.measured(f"{judge}_{self.fault}", value)
            self.tally.passed(judge)
        elif self.robot.server.latest_s > LATE_S:
            self.tally.busy(judge, fault=self.fault, value=round(value, 3), limit=limit)
        else:
            self.tally.problem(judge, fault=self.fault, rig=self.name, value=round(value, 4), limit=limit)


class DriverRig(Rig):
    """A user's program with a `Driver`."""

    worker: Program

    def begin(self) -> None:
        """Start the program."""
        self.timeout_s = self.rng.choice((0.25, 0.5, 0.0))
        self.start()

    def start(self) -> None:
        """Start the program again."""
        command = [PYTHON, "-m", "tests.long.soak.worker", self.robot.link, str(self.timeout_s)]
        self.worker = Program(command, self.folder / "worker.log")
        self.worker.await_word("ready", True)

    def recover(self) -> None:
        """Another program."""
        self.worker.end()
        self.start()

    def end(self) -> None:
        """End the program."""
        self.worker.send("end")
        with suppress(AssertionError):
            said = self.worker.await_word("closed", True)
            self.check("pose_jump", said["jump_m"] <= 0.0, jump_m=said["jump_m"])
            self.tally.measured("pose_jump_m", said["jump_m"])
        self.worker.end(signal.SIGTERM)
        super().end()

    def _speeds(self) -> str:
        return f"{self.rng.choice((0.1, 0.2, 0.3))} {self.rng.choice((0.0, 0.5, -0.5))}"

    def drive(self) -> None:
        """The user drives, with commands that go on."""
        self.worker.ask("keep " + self._speeds())
        wait_until(lambda: self.robot.driven, what="motion")
        time.sleep(self.rng.uniform(0.05, 0.4))

    def drive_once(self) -> float:
        """The user's last command of this fault; the robot moves.  When it was given."""
        for _ in range(50):
            self.worker.ask("silent")
            begun_s = time.monotonic()
            self.worker.ask("once " + self._speeds())
            with suppress(AssertionError):
                wait_until(lambda: self.robot.driven, timeout_s=0.2)
                return begun_s
        raise AssertionError("50 commands did not move the robot")

    def settle(self) -> None:
        """The user stops the robot, which must obey."""
        begun_s = time.monotonic()
        self.worker.ask("stop")
        wait_until(lambda: self.robot.judge(begun_s, time.monotonic()).stopped_s is not None, what="a stop")
        wait_until(lambda: self.worker.ask("state")["is_ready"], step_s=0.05, what="telemetry")


class LiveRig(DriverRig):
    """The program lives through all faults, so that what it keeps adds up."""

    name = "live"

    def begin(self) -> None:
        """Its commands stay in force until a stop, so that nothing else stops the robot."""
        self.timeout_s = 0.0
        self.start()
        self._settled = 0
        self._before: Optional[Dict[str, Any]] = None

    def settle(self) -> None:
        """As of any program; after the first round of faults, what it holds is noted."""
        super().settle()
        self._settled += 1
        if self._settled == FIRST_ROUND:
            self._before = self.worker.ask("state")

    def end(self) -> None:
        """Judge what the program holds."""
        with suppress(AssertionError):
            self.settle()
            after = self.worker.ask("state")
            if self._before is not None:
                self.tally.growth(
                    "driver", self._before, after, {"memory_kb": GROWTH_KB, "descriptors": 0, "threads": 0}
                )
            self.tally.measured("driver_frames", after["frames"])
        super().end()

    def recover(self) -> None:
        """Another program; what it holds counts from here."""
        super().recover()
        self._settled, self._before = 0, None

    def deck(self) -> List[Fault]:
        """All that a program survives."""
        return [
            *(self.unplugged, self.unplugged, self.suspended, self.suspended, self.board_silent),
            *(self.line_stalled, self.board_reset, self.write_blocked, self.disk_full, self.second_program),
            *(self.wall_clock, self.garbage_flood, self.reopened, self.user_hangs, self.bad_line),
        ]

    def unplugged(self) -> None:
        """The cable is pulled while the robot drives; the port comes back under another name."""
        self.drive_once()
        self.struck(7)
        before = os.path.realpath(self.robot.link)
        gone_s = self.robot.order("unplug")
        time.sleep(self.rng.uniform(0.05, 0.8))
        self.worker.await_word("event", "Lost", gone_s)
        back_s = self.robot.order("plug")
        self.worker.await_word("event", "Reconnected", back_s)
        self.check_figure("reconnect_s", time.monotonic() - back_s, BACK_S)
        self.check("other_name", os.path.realpath(self.robot.link) != before)
        self.check_stop(gone_s, HOST_DEAD_S, time.monotonic() + AFTER_S)
        self.settle()

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

    def board_silent(self) -> None:
        """The board stands still for longer than it accepts what has waited."""
        self.drive_once()
        self.struck(13, 14)
        lasts_s = self.rng.uniform(0.6, 1.5)
        frozen_s = self.robot.order("freeze", lasts_s)
        self.worker.await_word("event", "Stale", frozen_s)
        self.check_stop(frozen_s, FROZEN_S, frozen_s + lasts_s + AFTER_S)
        self.settle()

    def line_stalled(self) -> None:
        """The line holds everything back, then delivers it at once."""
        self.drive_once()
        self.struck(13)
        lasts_s = self.rng.uniform(0.6, 1.5)
        stalled_s = self.robot.order("stall", lasts_s)
        self.check_stop(stalled_s, HOST_DEAD_S, stalled_s + lasts_s + AFTER_S)
        self.settle()

    def board_reset(self) -> None:
        """Somebody presses the button of the board."""
        self.drive_once()
        self.struck(11)
        reset_s = self.robot.order("reset")
        self.check_stop(reset_s, AT_ONCE_S)
        self.settle()

    def write_blocked(self) -> None:
        """The board takes no bytes, and the program sends many."""
        self.drive_once()
        self.struck(15)
        self.robot.server.deaf = True
        deaf_s = time.monotonic()
        self.worker.ask("flood 2000")
        self.check("write_blocks", self.worker.ask("state")["blocked"] > 0)
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

    def wall_clock(self) -> None:
        """The wall clock jumps by an hour."""
        self.drive()
        self.struck(25)
        self.worker.ask(f"clock {self.rng.choice((3600, -3600))}")
        time.sleep(0.5)
        self.check_drives_on()
        self.settle()

    def garbage_flood(self) -> None:
        """Garbage at the rate of the line arrives at the program."""
        self.drive()
        self.struck(30)
        self.robot.inject("flood:at=0,lasts=1,direction=to_host")
        time.sleep(1.0)
        self.robot.mend()
        self.settle()

    def bad_line(self) -> None:
        """Lost, changed and repeated bytes, in both directions."""
        self.drive()
        kind, row = self.rng.choice((("loss", 4), ("flip", 6), ("change", 6), ("repeat", 6)))
        self.struck(row)
        self.robot.inject(f"{kind}:rate=0.01,at=0,lasts=1")
        time.sleep(1.0)
        self.robot.mend()
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

    def user_hangs(self) -> None:
        """The user's program does nothing for a while: without a command timeout the command stays in force."""
        self.drive_once()
        self.struck()
        self.worker.ask("hang 1")
        self.check("drives_on", self.robot.driven or self.worker.ask("state")["reason"] != "command_timeout")
        self.settle()


class DeathRig(DriverRig):
    """The program is killed, ended and begun again."""

    name = "death"

    def deck(self) -> List[Fault]:
        """All that ends the program, and a command source that falls silent."""
        return [
            *(self.killed, self.killed, self.killed, self.killed_recording, self.command_line_signalled),
            *(
                self.source_silent,
                self.source_silent,
                self.probed,
                self.junk_at_connect,
                self.reset_at_connect,
            ),
        ]

    def _again(self) -> None:
        self.worker.end()
        self.begin()

    def killed(self) -> None:
        """kill -9 while the robot drives."""
        (self.drive if self.rng.random() < 0.5 else self.drive_once)()
        self.struck(1)
        killed_s = self.worker.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, HOST_DEAD_S)
        self._again()

    def killed_recording(self) -> None:
        """kill -9 while it records: what was recorded until a second before is readable."""
        self.drive()
        self.struck(1, 28)
        path = str(self.folder / "drive.mrl")
        begun_s = self.worker.ask("record " + path)["at_s"]
        time.sleep(self.rng.uniform(1.2, 2.5))
        killed_s = self.worker.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, HOST_DEAD_S)
        self.worker.end()
        times = [entry.time_s for entry in Recording(path)]
        lost_s = (killed_s - begun_s) - (times[-1] - times[0])
        self.check_figure("recording_lost_s", lost_s, RECORDING_LOST_S)
        os.unlink(path)
        self.begin()

    def command_line_signalled(self) -> None:
        """Ctrl-C or SIGTERM at `mrl drive`."""
        self.worker.send("end")
        self.worker.await_word("closed", True)
        self.worker.end(signal.SIGTERM)
        wait_until(lambda: not self.robot.driven, what="a stop")
        words = ["drive", "--port", self.robot.link, "--linear", "0.2", "--for", "60"]
        program = Program([PYTHON, "-m", "mrl_driver", *words], self.folder / "drive.log")
        try:
            wait_until(lambda: self.robot.driven, what="motion")
            time.sleep(self.rng.uniform(0.0, 0.3))
            self.struck(21)
            number, code = self.rng.choice(((signal.SIGINT, 130), (signal.SIGTERM, 143)))
            sent_s = time.monotonic()
            took_s = program.end(number)
            self.check_figure("exit_s", took_s, EXIT_S)
            self.check("exit_code", program.process.returncode == code, code=program.process.returncode)
            self.check_stop(sent_s, SIGNAL_S)
        finally:
            program.end()
        self.begin()

    def source_silent(self) -> None:
        """The user gives no command any more."""
        if not self.timeout_s:
            self.timeout_s = 0.25
            self._end_and_start()
        self.drive()
        self.struck(2)
        self.worker.ask("silent")
        self.check_stop(self.worker.ask("state")["last_s"], self.timeout_s + BEYOND_S)

    def _end_and_start(self) -> None:
        self.worker.end()
        self.start()

    def probed(self) -> None:
        """ModemManager asks the port for a modem before the driver opens it."""
        self.worker.end()
        time.sleep(WATCHDOG_S)
        self.struck(23)
        begun_s = time.monotonic()
        port = os.open(self.robot.link, os.O_RDWR | os.O_NOCTTY)
        for probe in (b"AT\r", b"+++", b"ATI\r\n", b"\x7e\x00~"):
            os.write(port, probe)
            time.sleep(0.05)
        os.close(port)
        self.begin()
        self.check_stop(begun_s, HOST_DEAD_S, time.monotonic())

    def junk_at_connect(self) -> None:
        """Garbage in both directions while the driver connects."""
        self.worker.end()
        time.sleep(WATCHDOG_S)
        self.struck(22)
        begun_s = time.monotonic()
        self.robot.inject("flood:at=0,lasts=0.05")
        self.begin()
        self.robot.mend()
        self.check_stop(begun_s, HOST_DEAD_S, time.monotonic())

    def reset_at_connect(self) -> None:
        """Opening the port resets the board, which says nothing for a while."""
        self.worker.end()
        time.sleep(WATCHDOG_S)
        self.struck(16)
        begun_s = self.robot.order("reset")
        self.robot.order("stall", self.rng.uniform(0.5, 2.0))
        self.begin()
        self.check_figure("ready_s", time.monotonic() - begun_s, 5.0)
        self.check_stop(begun_s, HOST_DEAD_S, time.monotonic())


class RosRig(Rig):
    """The node of the robot, a program that drives it with cmd_vel, and one that listens, on an own master."""

    name = "ros"

    def begin(self) -> None:
        """Start all of it."""
        self._master: Optional[Program] = None
        self._node: Optional[Program] = None
        self._operator: Optional[Program] = None
        self._listener: Optional[Program] = None
        self._number = 0
        self._start_all()

    def _start_all(self) -> None:
        from ros1_bridge.demo.launcher import free_port, master_answers

        for _ in range(5):
            port = free_port()
            uri = f"http://127.0.0.1:{port}"
            self.env = {
                **os.environ,
                "ROS_MASTER_URI": uri,
                "ROS_IP": "127.0.0.1",
                "ROS_LOG_DIR": str(self.folder),
            }
            master = self._program("rosmaster", "rosmaster", "--core", "-p", str(port))
            wait_until(lambda: master_answers(uri) or master.process.poll() is not None, step_s=0.02)  # noqa: B023
            if master.process.poll() is None:
                break
            master.end()
        self._master = master
        self._start_node()
        self._operator, self._listener = self._start_operator(), self._start_operator()
        self._ready()

    def _program(self, name: str, *command: str) -> Program:
        return Program(command, self.folder / f"{name}.log", self.env)

    def _start_node(self) -> None:
        node = str(ROOT / "ros1_bridge" / "nodes" / "robot_node")
        self._node = self._program(
            "node", node, "__ns:=/soak", f"_port:={self.robot.link}", f"_cmd_vel_timeout:={TIMEOUT_S}"
        )
        self._node_before: Optional[Dict[str, int]] = None
        self._node_faults = 0

    def _start_operator(self) -> Program:
        self._number += 1
        return self._program(
            "operator", PYTHON, "-m", "tests.long.soak.operator", f"operator_{self._number}", "/soak"
        )

    def _ready(self) -> None:
        """Wait for odometry: the node hears before it who sends commands already, and lets them pause."""
        for program in (self._operator, self._listener):
            assert program is not None
            before = program.ask("state")["messages"]

            def heard() -> bool:
                state = program.ask("state")  # noqa: B023
                return state["connected"] > 0 and state["messages"] > before  # noqa: B023

            wait_until(heard, step_s=0.1, what="the node")
        self._drive()
        self._settle()

    def _stop_all(self) -> None:
        for program in (self._operator, self._listener, self._node, self._master):
            if program is not None:
                program.end(signal.SIGKILL)

    def recover(self) -> None:
        """All of it anew."""
        self._stop_all()
        self._start_all()

    def end(self) -> None:
        """End all of it."""
        self._judge_node()
        self._stop_all()
        super().end()

    def deck(self) -> List[Fault]:
        """All faults; those that end the node come once, so that it lives through many others."""
        few = self.rng.choice(([self.node_killed, self.node_ended], [self.node_killed, self.master_killed]))
        return [
            *(self.source_killed, self.source_suspended, self.source_silent, self.listener_hangs),
            *(self.listener_hangs, self.listener_killed, self.not_a_number, self.sideways, self.huge),
            *(self.two_sources, self.unplugged, self.node_suspended, *few),
        ]

    def _drive(self, what: str = "0.2") -> None:
        assert self._operator is not None
        self._operator.ask(f"keep {what}")
        wait_until(lambda: self.robot.driven, what="motion")
        time.sleep(self.rng.uniform(0.1, 0.4))

    def _settle(self) -> None:
        """The source falls silent, and the robot stops."""
        assert self._operator is not None
        last_s = self._operator.ask("silent")["last_s"]
        self.check_stop(last_s, TIMEOUT_S + BEYOND_S)
        state = self._operator.ask("state")
        self.check("pose_jump", state["jump_m"] <= 0.0, jump_m=state["jump_m"])
        self.tally.measured("pose_jump_m", state["jump_m"])
        self._node_faults += 1
        if self._node_faults == 4 and self._node is not None:
            self._node_before = holds(self._node.process.pid)

    def _judge_node(self) -> None:
        """What the node holds at the end of its life, compared with its beginning."""
        if self._node is not None and self._node_before is not None and self._node.process.poll() is None:
            most = {"memory_kb": GROWTH_KB, "descriptors": CONNECTIONS, "threads": CONNECTIONS}
            self.tally.growth("node", self._node_before, holds(self._node.process.pid), most)

    def source_silent(self) -> None:
        """The source lives, and publishes nothing."""
        self._drive()
        self.struck(2)
        self._settle()

    def source_killed(self) -> None:
        """kill -9 of the program that publishes cmd_vel."""
        assert self._operator is not None
        self._drive()
        self.struck(2)
        killed_s = self._operator.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, TIMEOUT_S + BEYOND_S)
        self._operator.end()
        self._operator = self._start_operator()
        self._ready()

    def source_suspended(self) -> None:
        """The program that publishes cmd_vel is suspended."""
        assert self._operator is not None
        self._drive()
        self.struck(2)
        stopped_s = self._operator.send_signal(signal.SIGSTOP)
        self.check_stop(stopped_s, TIMEOUT_S + BEYOND_S)
        self._operator.send_signal(signal.SIGCONT)
        self._settle()

    def listener_hangs(self) -> None:
        """A subscriber does not read: the robot is driven on, and others hear of it."""
        assert self._operator is not None and self._listener is not None
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

    def listener_killed(self) -> None:
        """kill -9 of a subscriber."""
        assert self._listener is not None
        self._drive()
        self.struck()
        self._listener.end()
        self.check_drives_on()
        self._settle()
        self._listener = self._start_operator()
        self._ready()

    def _bad_command(self, kind: str) -> None:
        assert self._operator is not None
        self._drive()
        self.struck(5)
        asked = self._operator.ask(f"keep {kind}")
        if kind == "huge":
            time.sleep(0.5)
            speed = max(abs(motor.speed) for motor in self.robot.plant.robot.motors)
            most = self.robot.plant.model.limits.linear_m_s / self.robot.plant.model.base.metres_per_count
            self.check("clamped", speed <= 1.1 * most, counts_s=speed)
        else:
            self.check_stop(asked["at_s"], TIMEOUT_S + BEYOND_S)
        self._settle()

    def not_a_number(self) -> None:
        """NaN in cmd_vel."""
        self._bad_command("nan")

    def huge(self) -> None:
        """The largest number in cmd_vel: it is clamped."""
        self._bad_command("huge")

    def sideways(self) -> None:
        """A sideways speed for a robot that has none."""
        self._bad_command("sideways")

    def two_sources(self) -> None:
        """Two publishers at once."""
        assert self._listener is not None
        self._drive()
        self.struck(26)
        self._listener.ask("keep 0.1")
        time.sleep(1.0)
        self._listener.ask("silent")
        self.check_drives_on()
        self._settle()

    def unplugged(self) -> None:
        """The cable is pulled while cmd_vel goes on and ends before the port is back."""
        assert self._operator is not None
        self._drive()
        self.struck(7)
        gone_s = self.robot.order("unplug")
        time.sleep(self.rng.uniform(0.1, 0.8))
        self._operator.ask("silent")
        self.robot.order("plug")
        self.check_stop(gone_s, HOST_DEAD_S, time.monotonic() + 1.0)
        self._again_ready()

    def _again_ready(self) -> None:
        """The node has found its robot again."""
        self._drive()
        self._settle()

    def node_suspended(self) -> None:
        """The node is suspended, and its source falls silent before it goes on."""
        assert self._node is not None and self._operator is not None
        self._drive()
        self.struck(19)
        stopped_s = self._node.send_signal(signal.SIGSTOP)
        time.sleep(self.rng.uniform(0.4, 1.5))
        last_s = self._operator.ask("silent")["last_s"]
        time.sleep(self.rng.uniform(0.0, 0.6))
        self._node.send_signal(signal.SIGCONT)
        self.check_stop(stopped_s, HOST_DEAD_S, max(last_s, time.monotonic()) + AFTER_S)
        self._again_ready()

    def node_killed(self) -> None:
        """kill -9 of the node."""
        assert self._node is not None and self._operator is not None
        self._drive()
        self.struck(1)
        self._judge_node()
        killed_s = self._node.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, HOST_DEAD_S)
        self._node.end()
        self._operator.ask("silent")
        self._start_node()
        self._ready()

    def node_ended(self) -> None:
        """SIGTERM at the node."""
        assert self._node is not None and self._operator is not None
        self._drive()
        self.struck(21)
        self._judge_node()
        sent_s = time.monotonic()
        self.check_figure("exit_s", self._node.end(signal.SIGTERM), EXIT_S)
        self.check_stop(sent_s, SIGNAL_S)
        self._operator.ask("silent")
        self._start_node()
        self._ready()

    def master_killed(self) -> None:
        """The master dies: cmd_vel goes on, the source dies, the robot stops; then there is a new master."""
        assert self._master is not None and self._operator is not None
        self._drive()
        self.struck(29)
        self._master.end(signal.SIGKILL)
        time.sleep(1.0)
        self.check_drives_on()
        killed_s = self._operator.send_signal(signal.SIGKILL)
        self.check_stop(killed_s, TIMEOUT_S + BEYOND_S)
        self._judge_node()
        self._stop_all()
        self._start_all()


RIGS = {kind.name: kind for kind in (LiveRig, DeathRig, RosRig)}


def own_holds() -> Dict[str, int]:
    """What this process holds."""
    gc.collect()
    return {**holds(os.getpid()), "threads": threading.active_count()}


def run(
    seconds: float, faults: int, seed: int, tally: Tally, rigs: Tuple[Any, ...] = tuple(RIGS.values())
) -> None:
    """Strike so long, or so often; each robot has its thread.  Ctrl-C ends it after the faults that strike now."""
    before = own_holds()
    folder = Path(tempfile.mkdtemp(prefix="soak-"))
    made = [kind(folder, tally, seed + number) for number, kind in enumerate(rigs)]
    until_s = time.monotonic() + seconds
    threads = [
        threading.Thread(target=_run_one, args=(rig, until_s, faults // len(made) + 1, tally)) for rig in made
    ]
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


def _run_one(rig: Rig, until_s: float, most: int, tally: Tally) -> None:
    try:
        rig.run(until_s, most)
    except Exception as error:  # noqa: BLE001 - the others go on, and the report says so
        tally.problem("rig", rig=rig.name, fault=rig.fault, error=repr(error)[:300])
    try:
        rig.end()
    except Exception as error:  # noqa: BLE001
        tally.problem("rig", rig=rig.name, fault="end", error=repr(error)[:300])


def _judge_the_end(before: Dict[str, int], tally: Tally) -> None:
    left = left_behind()
    if left:
        tally.problem("processes_left", processes=left[:10])
    else:
        tally.passed("processes_left")
    with suppress(AssertionError):  # the kernel takes a moment to end a thread that was joined
        wait_until(lambda: own_holds()["threads"] <= before["threads"], timeout_s=5.0, step_s=0.1)
    after = own_holds()
    for key in ("descriptors", "threads"):
        if after[key] > before[key]:
            names = [thread.name for thread in threading.enumerate()]
            tally.problem(f"{key}_left", before=before[key], after=after[key], threads=names)
        else:
            tally.passed(f"{key}_left")
