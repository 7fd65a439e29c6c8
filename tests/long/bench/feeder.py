"""Boards for `bench_ros`: ptys that answer the greeting and stream frames at a set rate, with the time of each.

`python -m tests.long.bench.feeder BOARDS [imu]`; with `imu`, each board has an IMU, which streams at the host's rate.

The wheels follow the latest movement command, straight ahead, so that no driver takes them for wheels that turn by
themselves.  At 0.3 m/s each frame up to 3 kHz has counts of its own, which tell which frame a pose came from.
Lines on stdin: `rate HZ` streams and forgets what was noted, `pause` ends the stream and prints what was noted as one
line of JSON.
"""

import json
import os
import pty
import select
import sys
import time
import tty
from typing import List, Tuple

from mrl_driver.protocol import REQUESTS, Frame, FrameDecoder, Stamp, encode_reply
from mrl_driver.protocol.table import BY_NAME, CAPABILITIES, TICK_S
from mrl_driver.robot.models import load

CODE = {name: row.code for name, row in BY_NAME.items()}
HAS = "check", "watchdog", "period", "sonars"  # Capabilities of each board
AT_REST = (12, -7, 3, 40, -60, 16384)
"""Gyro and accelerometer of a chip that lies flat [count]; the last number of each gets noise, as in a real one."""
METRES_PER_COUNT = load("traxbot").drive.metres_per_count
SONARS = (150, 200, 80)
LATEST_S = 0.05  # A frame that is this late is left out rather than sent in a burst


class Board:
    """One pty, its conversation, and notes of what came and went when."""

    def __init__(self, imu: bool = False) -> None:
        has = (*HAS, "imu") if imu else HAS
        self._capabilities = sum(1 << bit for bit, (name, _) in enumerate(CAPABILITIES) if name in has)
        self._imu_gap_s = self._imu_due_s = float("inf")
        self.master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._decoder = FrameDecoder(REQUESTS)
        self._stamps = 0
        self._way = self._speed = 0.0
        self.streams = False
        self.forget()

    def forget(self) -> None:
        """Forget the notes."""
        self.written: List[Tuple[float, int]] = []
        self.moves: List[Tuple[float, int, int]] = []

    def receive(self) -> None:
        data, now = os.read(self.master, 4096), time.monotonic()
        for event in self._decoder.feed(data):
            if isinstance(event, Frame):
                self._answer(event, now)

    def _answer(self, frame: Frame, now: float) -> None:
        code, args = frame.code, frame.args
        if code == CODE["move_differential"]:
            self.moves.append((now, args[0], args[1]))
            self._speed = args[0] / 1000 / METRES_PER_COUNT
        elif code == CODE["stop"]:
            self.moves.append((now, 0, 0))
            self._speed = 0.0
        elif code == CODE["robot_info"]:
            self._reply(code, 2500, 172, 1250, 2, 1)
        elif code == CODE["read_protocol"]:
            self._reply(code, 2, self._capabilities)
        elif code == CODE["set_check"]:
            self._decoder.checked = bool(args[0])
            self._reply(code, args[0])
        elif code == CODE["set_watchdog"]:
            self._reply(code, args[0])
        elif code == CODE["read_status"]:
            self._reply(code, 0, int(now) % 32768, 1, 0, 0, 0)
        elif code in (CODE["start_stream"], CODE["stop_stream"]):
            self.streams = code == CODE["start_stream"]
        elif code == CODE["start_imu_stream"]:
            self._imu_gap_s, self._imu_due_s = args[0] / 1000, now
        elif code == CODE["stop_imu_stream"]:
            self._imu_due_s = float("inf")

    def _reply(self, code: int, *args: int) -> None:
        os.write(self.master, encode_reply(code, *args, checked=self._decoder.checked))

    def stream(self, gap_s: float) -> None:
        """One more frame, this long after the one before, and when it went with which count."""
        if not self.streams:
            return
        now = time.monotonic()
        self._way += self._speed * gap_s
        count = int(self._way)
        frame = self._stamped(CODE["read_encoders_and_sonars"], (_int16(count), _int16(count), *SONARS), now)
        self.written.append((time.monotonic(), count))
        os.write(self.master, frame)
        if now >= self._imu_due_s:
            self._imu_due_s += self._imu_gap_s
            noise = self._stamps % 5
            values = tuple(value + (noise if at % 3 == 2 else 0) for at, value in enumerate(AT_REST))
            os.write(self.master, self._stamped(CODE["read_imu"], values, now))

    def _stamped(self, code: int, values: Tuple[int, ...], now: float) -> bytes:
        """A reply, with sequence number and board time if frames carry them."""
        checked, stamp = self._decoder.checked, None
        if checked:
            self._stamps += 1
            ticks = round(now / TICK_S)
            stamp = Stamp(_int16(self._stamps), _int16(ticks))
        return encode_reply(code, *values, stamp=stamp, checked=checked)


def _int16(value: int) -> int:
    return (value + 0x8000 & 0xFFFF) - 0x8000


def serve(boards: List[Board]) -> None:
    masters = {board.master: board for board in boards}
    gap_s, turn, due_s = float("inf"), 0, float("inf")
    while True:
        wait_s = max(0.0, min(1.0, due_s - time.monotonic()))
        ready, _, _ = select.select([sys.stdin.fileno(), *masters], [], [], wait_s)
        if sys.stdin.fileno() in ready:
            line = sys.stdin.readline().split()
            if not line:
                return
            if line[0] == "rate":
                for board in boards:
                    board.forget()
                gap_s, due_s = 1 / float(line[1]) / len(boards), time.monotonic()
                print(json.dumps({"done": "rate"}), flush=True)
            else:
                gap_s = due_s = float("inf")
                notes = [[board.written, board.moves] for board in boards]
                print(json.dumps({"done": "pause", "notes": notes}), flush=True)
        now = time.monotonic()
        while due_s <= now:
            boards[turn].stream(gap_s * len(boards))
            turn = (turn + 1) % len(boards)
            due_s = due_s + gap_s if now - due_s < LATEST_S else now + gap_s
        for fd in ready:
            if fd in masters:
                masters[fd].receive()


def main() -> None:
    boards = [Board(imu="imu" in sys.argv[2:]) for _ in range(int(sys.argv[1]))]
    print(json.dumps({"ready": True, "ports": [board.port for board in boards]}), flush=True)
    serve(boards)


if __name__ == "__main__":
    main()
