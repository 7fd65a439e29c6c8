"""The soak in simulated time: faults of link, board, motor, battery and clock; the same seed gives the same run."""

import hashlib
import math
import os
import random
import time
from contextlib import suppress
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import FrameError, MrlError
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.robot.models import load
from mrl_driver.session.events import Ready
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.board.parameter_store import BLOCK_AT
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.long.jumps import Jumps
from tests.long.programs import ROOT, holds

from .tally import Tally
from .truth import Truth

WATCHDOG_S, BEYOND_S, BOARD_S = 0.25, 0.05, 0.015
HOST_DEAD_S = WATCHDOG_S + BOARD_S
I2C_S = 0.3  # The motor board stops by itself so long after the last word of a board that stands still [s]
WHEEL_S = 0.5
HOST_STOP_S = 0.15
"""A stop that the host sent reaches the motors in this time; a newer command may overtake it [s]."""
TIMEOUTS_S = (0.1, 0.25, 0.5, 1.0, None)
FAULT_S = 2.88  # One fault in this time: 10 000 in 8 hours [s]
IMAGE = str(ROOT / "build" / "firmware" / "mrl_firmware.elf")
ENDLESS_LOOP = b"\xff\xcf"  # The instruction that jumps to itself
BAD_LINES = {
    4: ("loss:{rate},burst=1", "loss:{rate},burst=16", "loss:{rate},burst=64"),
    6: ("flip:{rate}", "change:{rate}", "swap:{rate}", "repeat:rate=0.1", "delay:delay=0.002,jitter=0.016"),
    24: ("text:period=0.03,direction=to_host", "text:period=0.01,direction=to_host"),
    30: ("flood:direction=to_host", "flood:direction=to_board", "flood:direction=both"),
}
"""Faults of the line by their row; lost bytes merge frames."""
OUTAGES = {
    "unplug:": ((7,), HOST_DEAD_S, HOST_DEAD_S),
    "stall:": ((13,), HOST_DEAD_S, HOST_DEAD_S),
    "freeze:": ((13, 14), HOST_DEAD_S + I2C_S, I2C_S + 0.02),
    "loss:rate=1,burst=1024,direction=to_host,": ((14,), HOST_DEAD_S + 0.28, math.inf),
    "loss:rate=1,burst=1024,direction=to_board,": ((14,), HOST_DEAD_S + 0.28, HOST_DEAD_S + 0.28),
}
"""What is away for a while: rows, the time in which commands may still act, and that in which the motion ends [s].  A
line that holds all back delivers it at once; the motor board of a frozen board stops by itself."""
REST_S = 0.6  # The motors run down from full speed [s]


class SoakDriver(SteppedDriver):
    """A stepped driver whose cable can be unplugged, as `Driver` with the option `reconnect`.

    Its time begins with that of the board, which may have run before.
    """

    def __init__(self, engine: FaultyEngine, options: Options) -> None:
        super().__init__(engine, options=options)
        self._engine, self._plugged = engine, engine.plugged
        self._connection.stepped.now_s = engine.now_s
        self._process, self._connection.process = self._connection.process, self.process  # type: ignore
        self.core = self._core

    def process(self, data: bytes) -> None:
        """Lose the link, or take it again, as the cable does, and process the bytes."""
        session = self._core.session
        if self._plugged and not self._engine.plugged:
            session.lose(self.now_s)
        elif self._engine.plugged and not self._plugged:
            session.relink(self.now_s)
            self._core.due_s = -math.inf
        self._plugged = self._engine.plugged
        self._process(data)

    def die(self, seconds: float) -> None:
        """The program is killed: the board runs on."""
        self._connection.stepped.skip(seconds)

    def watch_pose(self, jumps: Jumps, note: Callable[[Any, float], None]) -> None:
        """Calls `note` with each event that has counts, and with the step of the pose beyond the reach [m]."""
        core = self.core
        on_counts, digest = core.state.on_counts, core._digest

        def see(event: Any, events: List[Any]) -> Any:
            told = on_counts(event, events)
            odometry = core.state.odometry
            assert odometry is not None
            note(event, jumps.see(odometry.pose, event.time_s, odometry.baseline.refused))
            return told

        def look(event: Any, now: float) -> Any:
            told = digest(event, now)
            if isinstance(event, Ready) and event.restarted:
                jumps.restart()
            return told

        core.state.on_counts, core._digest = see, look  # type: ignore[method-assign]


class Simulation:
    """One robot, its driver and its user, for a quarter of an hour or so.

    Attributes:
        stale_s: how much later than the command's time-out the motion may end, while the present fault lasts [s].
    """

    watchdog_ms = 250

    def __init__(self, seed: int, tally: Tally) -> None:
        self.rng = random.Random(f"soak {seed}")
        self.tally = tally
        self.model = load("traxbot")
        self.plant = Plant(self.model, World(), (0.0, 0.0, 0.0), seed=seed)
        self.board = self._board()
        self.truth = Truth(self.plant, self._reason)
        self.engine = FaultyEngine(self.board, (), seed)
        self.period_ms = self.rng.choice((10, 20, 20, 50))
        self.fault = ""
        self.digest = hashlib.sha256()
        self.stale_s = BEYOND_S
        self._judged_s = -1.0
        self._fall_s, self._fall_reason = -math.inf, "boot"
        self._commands: List[Tuple[float, bool]] = []
        self.connect()

    def _board(self) -> Any:
        return PythonBoard(self.plant)

    def _reason(self) -> str:
        return STOP_REASONS[self.board.health.stop_reason]

    # ---- the driver

    def connect(self) -> None:
        self.timeout_s: Optional[float] = self.rng.choice(TIMEOUTS_S)
        options = Options(
            period_ms=self.period_ms, command_timeout_s=self.timeout_s, watchdog_ms=self.watchdog_ms
        )
        self.driver = SoakDriver(self.engine, options)
        self._watch_pose()
        self.driver.connect()

    def _watch_pose(self) -> None:
        def note(_: Any, jump_m: float) -> None:
            self.tally.measured("pose_jump_m", jump_m)
            if jump_m > 0.0:
                self.tally.problem("pose_jump", fault=self.fault, jump_m=jump_m)

        self.driver.watch_pose(Jumps.of(self.model), note)

    @property
    def now_s(self) -> float:
        """Time of board and driver [s]."""
        return self.driver.now_s

    # ---- the user

    def command(self, linear_m_s: float, angular_rad_s: float) -> bool:
        """The user's command; whether the driver took it."""
        taken = self.driver.drive(linear_m_s, angular_rad_s)
        if taken:
            self._commands.append((self.now_s, bool(linear_m_s or angular_rad_s)))
        return taken

    def speeds(self) -> Tuple[float, float]:
        return self.rng.choice((-0.3, -0.2, 0.1, 0.2, 0.3)), self.rng.choice((0.0, 0.0, 0.4, -0.8))

    def wait(self, seconds: float) -> None:
        """Time passes, without a command."""
        self.driver.wait(seconds)
        self._look()

    def keep(self, seconds: float, speeds: Optional[Tuple[float, float]] = None) -> None:
        speeds = speeds or self.speeds()
        end_s, period_s = self.now_s + seconds, self.rng.choice((0.02, 0.05, 0.08))
        while self.now_s < end_s:
            self.command(*speeds)
            self.driver.wait(period_s)
        self._look()

    def once(self, speeds: Optional[Tuple[float, float]] = None) -> None:
        """The user's last command of this fault; the robot is driven."""
        speeds = speeds or self.speeds()
        for _ in range(200):
            self.command(*speeds)
            self.driver.wait(0.05)
            if self.truth.driven:
                break
        self._look()
        self.check("drives", self.truth.driven)

    def stop(self) -> None:
        """The user stops the robot, and all faults end."""
        self._stop_asked()
        self.engine.clear()
        self.wait(REST_S)
        self.check("stops", not self.truth.driven)
        self.stale_s = BEYOND_S

    def _stop_asked(self) -> None:
        self._commands.append((self.now_s, False))
        self.driver.stop()

    def until_ready(self, longest_s: float = 8.0) -> None:
        end_s = self.now_s + longest_s
        while not self.driver.ready and self.now_s < end_s:
            self.wait(0.05)
        self.check("ready_again", self.driver.ready)

    # ---- the judges

    def check(self, judge: str, good: bool, **what: Any) -> None:
        self.tally.check(judge, good, fault=self.fault, at_sim_s=round(self.now_s, 3), **what)

    def _look(self) -> None:
        for edge in self.truth.since(self._judged_s):
            self._judged_s = edge.time_s
            self.digest.update(repr((round(edge.time_s, 9), edge.driven)).encode())
            if edge.driven:
                self._judge_rise(edge.time_s)
            else:
                self._judge_fall(edge.time_s)
                self._fall_s, self._fall_reason = edge.time_s, edge.reason
        if self.truth.driven:
            self._judge_fall(self.plant.motor_board.time_s)  # a frozen board is behind
        del self._commands[:-400]

    def _last_move_s(self, before_s: float) -> float:
        return max((at_s for at_s, moves in self._commands if moves and at_s <= before_s), default=-math.inf)

    def _judge_rise(self, time_s: float) -> None:
        """Motion begins only by a command that is newer than the last stop."""
        host = self._fall_reason in ("host", "")
        since_s = self._fall_s - (HOST_STOP_S if host else 0.0)
        stopped_s = max(
            (at_s for at_s, moves in self._commands if not moves and at_s <= time_s), default=-math.inf
        )
        asked_s = self._last_move_s(time_s)
        self.check(
            "forbidden_motion",
            asked_s > max(since_s, stopped_s),
            rise_s=time_s,
            stop_s=self._fall_s,
            reason=self._fall_reason,
            asked_s=asked_s,
        )

    def _judge_fall(self, time_s: float) -> None:
        if self.timeout_s is None:
            return
        beyond_s = time_s - self._last_move_s(time_s) - self.timeout_s
        self.tally.measured(f"beyond_timeout_s_{self.stale_s:.3f}", beyond_s)
        self.check("time_to_stop", beyond_s <= self.stale_s, beyond_s=beyond_s, limit_s=self.stale_s)

    def ends_within(self, since_s: float, limit_s: float) -> None:
        falls = [edge.time_s for edge in self.truth.since(since_s) if not edge.driven]
        took_s = falls[0] - since_s if falls else math.inf
        if not falls and not self.truth.driven:
            took_s = 0.0
        self.tally.measured(f"stop_s_{self.fault}", took_s)
        self.check("time_to_stop", took_s <= limit_s, took_s=took_s, limit_s=limit_s)

    # ---- faults of the link

    def _inject(self, *specs: str) -> float:
        for spec in specs:
            self.engine.inject(spec)
        return self.now_s

    def bad_line(self) -> None:
        """The user drives over a line that is bad for a while, and falls silent some time."""
        row, name = self.rng.choice([(row, name) for row, names in BAD_LINES.items() for name in names])
        rate = f"rate={10 ** self.rng.uniform(-3, -1.5):.5f}"
        self.struck(row)
        self.stale_s = HOST_DEAD_S
        lasts_s = self.rng.uniform(0.3, 1.2)
        self.keep(self.rng.uniform(0.1, 0.3))
        self._inject(f"{name.format(rate=rate)},at=0,lasts={lasts_s:.3f}")
        if self.rng.random() < 0.5:
            self.keep(lasts_s)
        else:
            self.keep(lasts_s / 2)
            self.wait(lasts_s / 2)
        self._maybe_recover()

    def _maybe_recover(self) -> None:
        self.until_ready()
        if self.rng.random() < 0.3:
            self.once()
        self.stop()

    def probes(self) -> None:
        self.struck(23)
        self.keep(0.3)
        for probe in (b"AT\r", b"+++", b"ATI\r\n", b"\x7e\x00~"):
            self.engine.receive(probe)
            self.keep(0.1)
        self.stop()

    def stop_behind_a_cut_frame(self) -> None:
        """The first stop works, though half a frame came before it."""
        self.struck(3)
        self.once((0.2, 0.0))
        self.wait(0.04)
        self.engine.receive(self.rng.choice((b"@11,50", b"@11,", b"@", b"@9,1,5", b"@11,50@11,7")))
        since_s = self.now_s
        self._stop_asked()
        self.wait(0.3)
        self.ends_within(since_s, BEYOND_S)
        self.stop()

    def outage(self, kind: str = "") -> None:
        """Cable, line or board are away for a while; commands may go on meanwhile."""
        kind = kind or self.rng.choice(list(OUTAGES))
        rows, stale_s, limit_s = OUTAGES[kind]
        self.fault = kind.partition(":")[0]
        self.struck(*rows)
        self.once()
        self.stale_s = stale_s
        lasts_s = self.rng.uniform(0.05, 2.0)
        since_s = self._inject(f"{kind}at=0,lasts={lasts_s:.3f}")
        if kind in ("stall:", "freeze:") and self.rng.random() < 0.4:
            self.keep(lasts_s / 2)
        else:
            self.wait(lasts_s / 2)
        self.wait(lasts_s / 2 + 0.5)
        if lasts_s > limit_s or kind == "unplug:":  # a port that is back waits for a new command
            self.until_ready()
            self.ends_within(since_s, limit_s)
        self._maybe_recover()

    # ---- faults of the host

    def host_dies(self) -> None:
        """The program is killed, and another one connects."""
        self.struck(1)
        self.once()
        self.stale_s = HOST_DEAD_S
        since_s = self.now_s
        self.driver.die(self.rng.uniform(0.3, 1.5))
        self._look()
        self.ends_within(since_s, HOST_DEAD_S)
        if self.rng.random() < 0.5:
            self.struck_too("junk_at_connect", 22)
            self._inject("flood:at=0,lasts=0.3")
        self.connect()
        self.stop()

    def host_pauses(self) -> None:
        """The program is suspended, and goes on later."""
        self.struck(19)
        self.once()
        self.stale_s = HOST_DEAD_S
        since_s, lasts_s = self.now_s, self.rng.uniform(0.05, 3.0)
        self.driver.pause(lasts_s)
        self._look()
        self.wait(0.3)
        if lasts_s > HOST_DEAD_S:
            self.ends_within(since_s, HOST_DEAD_S)
            telemetry = self.driver.telemetry
            self.check("age", telemetry is not None and self.now_s - telemetry.stamp_s <= 0.05)
        self._maybe_recover()

    def source_silent(self) -> None:
        self.struck(2)
        self.keep(0.4)
        self.wait((self.timeout_s or 0.2) + 0.2)
        if self.timeout_s is not None:
            self.check("stops", not self.truth.driven)
        self.stop()

    def not_a_number(self) -> None:
        """A command that is not finite stops the robot; a huge one is clamped."""
        self.struck(5)
        self.once((0.2, 0.0))
        since_s = self.now_s
        with suppress(FrameError):
            self.driver.drive(self.rng.choice((math.nan, math.inf, -math.inf)), 0.0)
        self._commands.append((self.now_s, False))
        self.wait(0.2)
        self.ends_within(since_s, BEYOND_S)
        self.command(1e308, 0.0)
        self.wait(0.2)
        self.stop()

    def wall_clock(self) -> None:
        """The time of day jumps; nothing may depend on it."""
        self.struck(25)
        real, ahead_s = time.time, self.rng.choice((3600.0, -3600.0))
        self.keep(0.3)
        time.time = lambda: real() + ahead_s
        try:
            self.keep(0.5)
            self.check("drives_on", self.truth.driven)
        finally:
            time.time = real
        self.stop()

    # ---- faults of the board

    def board_reset(self) -> None:
        """The button, or the supply voltage."""
        self.struck(11)
        self.once()
        since_s = self._inject(self.rng.choice(("reset:at=0", "brown_out:at=0")))
        self.wait(0.5)
        self.ends_within(since_s, BEYOND_S)
        self._maybe_recover()

    def reset_at_connect(self) -> None:
        """Opening the port resets the board, which is deaf for a while."""
        self.struck(16)
        self.driver.die(self.rng.uniform(0.3, 0.6))
        self._look()
        self._inject("reset:at=0", f"stall:at=0,lasts={self.rng.uniform(0.5, 2.0):.3f}")
        since_s = self.now_s
        self.connect()
        self.check("ready_in_5_s", self.now_s - since_s <= 5.0, took_s=self.now_s - since_s)
        self.stop()

    # ---- faults of motors, encoders, battery, sonars

    def motor_board_away(self) -> None:
        """The motor board does not answer: for one reading, or for longer."""
        lasts_s = self.rng.choice((0.02, 0.08, 0.5, 1.0))
        self.struck(12 if lasts_s < 0.1 else 8)
        self.once()
        self.stale_s = HOST_DEAD_S + I2C_S
        since_s = self._inject(f"motor_board_absent:at=0,lasts={lasts_s}")
        self.wait(lasts_s + 0.5)
        if lasts_s > I2C_S:
            self.ends_within(since_s, I2C_S + 0.02)
        self._maybe_recover()

    def counter_wraps(self) -> None:
        self.struck(10)
        self.wait(0.1)
        for encoder in (1, 3):
            count = self.rng.choice((32767, -32768)) - self.rng.randint(-40, 40)
            self.plant.motor_board.preset_encoder(
                self.plant.motor_board.time_s, encoder, max(-32768, min(32767, count))
            )
        self.wait(0.2)
        self.keep(0.6)
        self.stop()

    def wheel_fails(self) -> None:
        self.struck(34)
        wheel = self.rng.choice(("left", "right"))
        self.keep(1.2, (0.25, 0.0))
        spec = self.rng.choice(("encoder_open", "encoder_swapped", "wheel_blocked", "motor_reversed"))
        since_s = self._inject(f"{spec}:wheel={wheel},at=0,lasts=1.2")
        self.keep(1.0, (0.25, 0.0))
        self.ends_within(since_s, WHEEL_S)
        self.stop()

    def battery_fails(self) -> None:
        """Motor power is lost, and returns: the robot stays where it is."""
        self.struck(34)
        self.keep(0.8, (0.25, 0.0))
        since_s = self._inject("battery_sag:volts=15,at=0,lasts=2.5")
        self.keep(1.5, (0.25, 0.0))
        self.ends_within(since_s, 1.0)
        self.stop()
        self.wait(2.5)
        self.until_ready()

    def sonar_fails(self) -> None:
        self.struck(31)
        name = self.rng.choice(("front", "left", "right"))
        self._inject(f"sonar_failed:sonar={name},state=dead,at=0,lasts=1.0")
        self.keep(0.9)
        value = self.driver.ranges.get(name, math.nan)
        self.check("sonar_invalid", math.isnan(value) or math.isinf(value), value=value)
        self.stop()

    # ---- other boards, of their own

    def another_board(self) -> None:
        """The port has another robot: refused, and it does not move."""
        self.struck(18)
        plant = Plant(load("stingbot"), World(), (0.0, 0.0, 0.0))
        truth, refused = Truth(plant), ""
        driver = SteppedDriver(PythonBoard(plant), "traxbot")
        try:
            driver.connect()
        except MrlError as error:
            refused = type(error).__name__
        self.check("refused", refused == "WrongRobot", got=refused)
        self.check("forbidden_motion", not truth.edges)
        self.wait(0.1)

    # ---- the run

    def struck(self, *rows: int) -> None:
        self.tally.struck(self.fault, *rows)

    def struck_too(self, name: str, *rows: int) -> None:
        self.tally.struck(name, *rows)

    def deck(self) -> List[Callable[[], None]]:
        twice = (self.board_reset, self.motor_board_away, self.wheel_fails)
        return [
            *twice * 2,
            *(self.bad_line, self.outage) * 7,
            *(self.probes, self.stop_behind_a_cut_frame, self.host_dies),
            *(
                self.host_pauses,
                self.source_silent,
                self.not_a_number,
                self.wall_clock,
                self.reset_at_connect,
            ),
            *(self.counter_wraps, self.battery_fails, self.sonar_fails, self.another_board),
        ]

    def run(self, faults: int) -> None:
        """Strike so often, one fault in `FAULT_S` or slower."""
        begun_s = self.now_s
        for number, fault in enumerate(self._many(faults)):
            self.fault = fault.__name__
            try:
                fault()
            except (MrlError, AssertionError) as error:
                self.tally.problem(
                    "simulation", fault=self.fault, error=f"{type(error).__name__}: {error}"[:300]
                )
                self.engine.clear()
                self.driver.die(1.0)
                self.connect()
            left_s = begun_s + (number + 1) * FAULT_S - self.now_s
            self.fault = "between"
            if left_s > 0.2:
                self.keep(min(left_s, 1.0) - 0.1)
            self.stop()
            if begun_s + (number + 1) * FAULT_S > self.now_s:
                self.wait(begun_s + (number + 1) * FAULT_S - self.now_s)
        self.tally.struck("soak", 33)

    def _many(self, count: int) -> Iterator[Callable[[], None]]:
        while count > 0:
            deck = self.deck()
            self.rng.shuffle(deck)
            yield from deck[:count]
            count -= len(deck)


class ChipSimulation(Simulation):
    """The same with the firmware's image on a simulated chip, and the faults that only hardware has."""

    def _board(self) -> Any:
        return AvrEngine(self.plant, IMAGE, self.model.ids[0], seed=self.rng.randrange(1000))

    def _reason(self) -> str:
        return ""

    def bus_hangs(self) -> None:
        self.struck(8)
        self.once()
        self.stale_s = HOST_DEAD_S + I2C_S
        since_s, lasts_s = self.now_s, self.rng.uniform(0.1, 1.0)
        self.board.machine.hang_bus(self.rng.choice(("sda", "scl")))
        self.wait(lasts_s)
        self.board.machine.hang_bus(None)
        self.wait(0.4)
        self.ends_within(since_s, I2C_S + 0.02)
        self._maybe_recover()

    def locks_up(self) -> None:
        """The program loops for ever: the chip's watchdog resets it."""
        self.struck(9)
        self.once()
        self.stale_s = WHEEL_S
        machine, since_s = self.board.machine, self.now_s
        while not machine.interrupts_on:
            self.driver.wait(1e-4)
        code, resets = dict(machine.image_flash), machine.resets
        machine.patch(machine.pc, ENDLESS_LOOP)
        while machine.resets == resets and self.now_s < since_s + 2.0:
            self.driver.wait(1e-3)
        for address, data in code.items():
            machine.patch(address, data)
        self.check("reset_in_500_ms", self.now_s - since_s <= 0.5, took_s=self.now_s - since_s)
        self.wait(0.3)
        self.ends_within(since_s, WHEEL_S)
        self._maybe_recover()

    def eeprom_damaged(self) -> None:
        """A bit of the stored parameters is flipped while the board is off: safe defaults, and it is told."""
        self.struck(20)
        machine = self.board.machine
        contents = machine.read_eeprom()
        at = BLOCK_AT + self.rng.randrange(39)
        machine.write_eeprom(at, bytes([contents[at] ^ 1 << self.rng.randrange(8)]))
        self.board.reset()
        self.wait(0.5)
        self.until_ready()
        self.driver.request(30)
        self.wait(0.2)
        status = self.driver.core.session.status
        self.check("eeprom_noticed", status is not None and "eeprom" in status.faults, at=at)
        machine.write_eeprom(0, contents)
        self.board.reset()
        self.wait(0.5)
        self.until_ready()
        self.stop()

    def deck(self) -> List[Callable[[], None]]:
        """Those of the hardware, and others whose answer is the firmware's."""
        return [
            *(self.bus_hangs, self.locks_up) * 2,
            *(self.eeprom_damaged, self.sonar_fails, self.stop_behind_a_cut_frame),
            *(self.bad_line, self.outage) * 4,
            *(self.host_dies, self.board_reset, self.motor_board_away, self.source_silent, self.probes),
            *(self.counter_wraps, self.wheel_fails, self.host_pauses),
        ]


class Job(NamedTuple):
    """One simulation: its seed, how many faults, and whether the chip is the board, or the one in Python."""

    seed: int
    faults: int
    chip: bool = False


def run_one(job: Job) -> Dict[str, Any]:
    """One simulation in this process: its tally, its simulated and CPU time, and the digest of its motion."""
    begun_s, tally = time.process_time(), Tally()
    simulation = (ChipSimulation if job.chip else Simulation)(job.seed, tally)
    simulation.run(job.faults)
    simulation.engine.close()
    return {
        "seed": job.seed,
        "chip": job.chip,
        "tally": tally,
        "simulated_s": simulation.now_s,
        "cpu_s": time.process_time() - begun_s,
        "digest": simulation.digest.hexdigest(),
        "pid": os.getpid(),
        **holds(os.getpid()),
    }
