"""A board without physics, on the project's own decoder and encoder: wheels follow commands at once.  Sans I/O, time
injected.
"""

import math
from typing import Callable, Iterable, List, Optional, Set, Tuple

from mrl_driver.protocol import REQUESTS, REQUESTS_TO_ANY, Frame, FrameDecoder, Stamp, encode_reply
from mrl_driver.protocol.table import CAPABILITIES, TICK_S
from mrl_driver.session.events import ACCEL_M_S2, GYRO_RAD_S
from sim_arduino.board.parameter_store import defaults

SEPARATION_M, METRES = 0.180, 0.000087512033
UPWARD = round(9.81 / ACCEL_M_S2)


def _next(due_s: float, period_s: float, now: float) -> float:
    """The time after `due_s`; after a pause, one at most a period ago with the same phase, as two streams must have."""
    return due_s + period_s * max(1, math.floor((now - due_s) / period_s))


class FakeBoard:
    """A TraxBot's board; `version` 1 is 2013 with a stream of `stream_code` 8 or 6."""

    watches = True  # Its watchdog stops the motors if the host falls silent

    def __init__(
        self,
        robot_id: int = 1,
        version: int = 2,
        stream_code: int = 8,
        boot_s: float = 0.0,
        unknown: Iterable[int] = (),
    ) -> None:
        self.robot_id, self.version, self.stream_code = robot_id, version, stream_code
        self.boot_s = boot_s
        self.battery, self.temperature = 1200, 2500
        self.faults = 0
        self.parameters = defaults(robot_id)  # By number
        self.capabilities = {name for name, _ in CAPABILITIES[:5]}
        self.sonars = (120, 45, 645)
        self.right = self.left = 0.0
        self.moves: List[tuple] = []
        self.heard: List[Frame] = []
        self.stops = 0
        self.started_s = 0.0
        self.time_s = 0.0
        self.mute = False
        self.counting = True  # The motor board answers, so that there are counters to send
        self.imu: Callable[[float], Optional[Tuple[int, ...]]] = self._measured
        """Fields of `read_imu` at a time [s]; None for a chip that does not answer.  For the capability `imu`."""
        self.noise = 0  # Another number in each reading of the chip, 0 or 1
        self.slip = 0.0  # Share of the turn by the wheels that the body does not make
        self.dead: Set[str] = set()  # Wheels (`right`, `left`) whose counter stands still
        self.unknown: Set[int] = set(unknown)  # Requests that this firmware does not have
        self.of_2013 = version < 2 or 29 in self.unknown
        self.reset(0.0)

    def reset(self, now: float) -> None:
        self.decoder = FrameDecoder(REQUESTS_TO_ANY if self.of_2013 else REQUESTS)
        self.period_s: Optional[float] = None
        self.imu_s, self.imu_period_s = math.inf, math.inf
        self.speeds = (0, 0)
        self.stop_reason = 0
        self.watchdog_s = 0.0
        self.sequence = 0
        self.started_s = self.time_s = now
        self.ready_s = now + self.boot_s
        self.fed_s = now
        self.right = self.left = 0.0
        self.due_s = 0.0
        self.out = bytearray()

    def receive(self, data: bytes, now: float) -> None:
        if now < self.ready_s:
            return
        for event in self.decoder.feed(data):
            if isinstance(event, Frame):
                self.fed_s = now
                self.heard.append(event)
                self._do(event, now)

    def advance(self, now: float) -> bytes:
        dt = now - self.time_s
        self.time_s = now
        linear, angular = (each / 1000 for each in self.speeds)
        if "right" not in self.dead:
            self.right += (linear + angular * SEPARATION_M / 2) * dt / METRES
        if "left" not in self.dead:
            self.left += (linear - angular * SEPARATION_M / 2) * dt / METRES
        if self.watches and self.watchdog_s and any(self.speeds) and now - self.fed_s > self.watchdog_s:
            self.speeds = (0, 0)
            self.stop_reason = 2
        while self.period_s is not None and now >= self.due_s:
            self.due_s = _next(self.due_s, self.period_s, now)
            if self.counting:
                self._reply(self.stream_code, now)
        while now >= self.imu_s:
            self.imu_s = _next(self.imu_s, self.imu_period_s, now)
            self._send_imu(now)
        out, self.out = bytes(self.out), bytearray()
        return b"" if self.mute else out

    def counts(self) -> tuple:
        return tuple(((int(each) + 0x8000) & 0xFFFF) - 0x8000 for each in (self.right, self.left))

    def _reply(self, code: int, now: float) -> None:
        self._stamped(code, self.counts() + (self.sonars if code == 8 else ()), now)

    def _stamped(self, code: int, args: tuple, now: float) -> None:
        self.sequence = ((self.sequence + 0x8001) & 0xFFFF) - 0x8000
        ticks = ((int((now - self.started_s) / TICK_S) + 0x8000) & 0xFFFF) - 0x8000
        self.out += encode_reply(code, *args, stamp=Stamp(self.sequence, ticks), checked=self.decoder.checked)

    def _send_imu(self, now: float) -> None:
        self.noise ^= 1
        values = self.imu(now)
        if values is not None:
            self._stamped(46, values, now)

    def _measured(self, now: float) -> Tuple[int, ...]:
        """A level chip without errors."""
        turning = self.speeds[1] / 1000 * (1 - self.slip)
        return (0, 0, round(turning / GYRO_RAD_S), 0, 0, UPWARD + self.noise)

    def _say(self, code: int, *args: int) -> None:
        self.out += encode_reply(code, *args, checked=self.decoder.checked)

    def _do(self, frame: Frame, now: float) -> None:
        code, args = frame.code, frame.args
        if code in self.unknown:
            return
        if code == 5:
            self._say(5, self.temperature, 172, self.battery, self.version, self.robot_id)
        elif code in (6, 8):
            self._reply(code, now)
        elif code == 7:
            self._say(7, *self.sonars)
        elif code == 11:
            if not any(self.speeds):
                self.stop_reason = 0
            self.speeds = args
            self.moves.append(args)
        elif code == 13:
            self.speeds = (0, 0)
            self.stops += 1
            self.stop_reason = 1
        elif code == 15:
            if self.version < 2:
                self.out += b"[INFO] Debug mode is OFF...\r\n"
            self._say(15, 0)
        elif code == 17:
            self._say(17, int(self.period_s is not None))
        elif code == 18:
            self.period_s, self.due_s = max(0.004, (args or (0,))[0] / 1000), now
        elif code == 19:
            self.period_s = None
        elif self.version >= 2:
            self._modern(code, args, now)

    def _modern(self, code: int, args: tuple, now: float) -> None:
        if code == 29:
            names = [name for name, _ in CAPABILITIES]
            self._say(29, 2, sum(1 << names.index(name) for name in self.capabilities))
        elif code == 30:
            uptime_s = int(now - self.started_s)
            self._say(30, uptime_s >> 15, uptime_s & 0x7FFF, 1, self.stop_reason, self.faults, 0)
        elif code == 31:
            self._say(31, *[0] * 11)
        elif code == 34:
            self._say(34, args[0], self.parameters[args[0]])
        elif code == 47 and "imu" in self.capabilities:
            self.imu_period_s = args[0] / 1000
            self.imu_s = self.due_s + self.imu_period_s / 2  # between the frames of the counters
        elif code == 48:
            self.imu_s = math.inf
        elif code == 32:
            self._say(32, *args)
            self.decoder.checked = bool(args[0])
        elif code == 33:
            self.watchdog_s = args[0] / 1000
            self._say(33, *args)
