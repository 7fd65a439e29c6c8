"""The firmware image on the simulated chip with a motor board and sonars that the benchmark controls."""

import random
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Set, Tuple

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME, FAULTS, PARAMETER_BY_NAME, REASONS
from mrl_driver.robot.chips import ATMEGA328P, Chip
from sim_arduino.avr.machine import AvrMachine, SentByte, Transfer
from tests.firmware.imu_chip import ImuChip

MOTOR_BOARD, IMU = 0x18, 0x68
IMU_FRAME = b"@46,"
RIGHT, LEFT = 1234, -567  # counts
TEMPERATURE, BATTERY = 250, 120  # tenths of degC and V, as on the I2C bus
VOLTS = (1.5, 2.0, 0.8, 3.6)  # sonars front, left, right; divided battery
ENCODERS, VERSION, VERSION_DECIMALS, CONTROL_RATE = 0xD8, 0xFE, 0xFD, 0xD3
FIRST_READABLE = 0xD8  # D8 D7 D6 encoders, D5 battery, D4 temperature: two bytes each
IMU_FOUND_S = 0.1
ENDLESS_LOOP = b"\xff\xcf"  # rjmp to itself
SETTLED_S = 1.5  # boot, motor board's configuration and the first sonar chain are over


class Reply(NamedTuple):
    """A line from the board with the cycles of its first and last edge."""

    line: bytes
    start_cycle: int
    end_cycle: int


def request(name: str, *args: int, checked: bool = False) -> bytes:
    return encode_request(BY_NAME[name].code, *args, checked=checked)


def word(value: int) -> bytes:
    """Two bytes, high byte first."""
    return (value & 0xFFFF).to_bytes(2, "big")


class MotorBoard:
    """The OMNI-3MD's registers; remembers commands and when counts were read [s].

    While `changing`, the last digits of both counts differ from read to read, so that a frame tells its read.
    """

    def __init__(self) -> None:
        self.present, self.changing = True, False
        self.commands: List[Tuple[float, bytes]] = []
        self.count_reads: Dict[Tuple[int, int], float] = {}
        self._register, self._reads = 0, 0

    def write(self, data: bytes, time_s: float) -> bool:
        """A register address, or a command with its data."""
        self._register = data[0]
        if len(data) > 1:
            self.commands.append((time_s, data))
        return True

    def read(self, count: int, time_s: float) -> bytes:
        if self._register == ENCODERS:
            self._note_read(time_s)
        single = {VERSION: b"\x01", VERSION_DECIMALS: b"\x48", CONTROL_RATE: b"\x14"}
        if self._register in single:
            return single[self._register]
        right, left = self._counts()
        block = word(left) + word(0) + word(right) + word(BATTERY) + word(TEMPERATURE)
        return block[2 * (FIRST_READABLE - self._register) :][:count]

    def _counts(self) -> Tuple[int, int]:
        if not self.changing:
            return RIGHT, LEFT
        return RIGHT - RIGHT % 10 + self._reads % 10, -(560 + self._reads // 10 % 10)

    def _note_read(self, time_s: float) -> None:
        self._reads += 1
        self.count_reads[self._counts()] = time_s


def hang(machine: AvrMachine, code: bytes = ENDLESS_LOOP) -> None:
    """Makes the program loop where it can be interrupted next."""
    while not machine.interrupts_on:
        machine.run(1e-6)
    machine.patch(machine.pc, code)


def mend(machine: AvrMachine) -> None:
    for address, data in machine.image_flash:
        machine.patch(address, data)


def lock_up(machine: AvrMachine, longest_s: float = 2.0) -> float:
    """Hangs the program; the time until it was mended or reset [s]."""
    begun, resets = machine.time_s, machine.resets
    hang(machine)
    while machine.resets == resets and machine.time_s < begun + longest_s:
        machine.run(1e-3)
    mend(machine)
    return machine.time_s - begun


class Rig:
    """One board on the bench, its line and its bus under observation.

    Attributes:
        imu_frames: Frames of the IMU's stream since the last call of `forget`; `replies` leaves them out.
    """

    FAULTS: Tuple[str, ...] = ("sda", "scl", "absent")  # Faults of `break_part` that the board must bear

    def __init__(self, elf: Path, seed: int = 1, chip: Chip = ATMEGA328P) -> None:
        self.random = random.Random(seed)
        self.machine = self._powered(elf, seed, chip)
        self.machine.adc_volts = lambda channel, time_s: VOLTS[channel] if channel < len(VOLTS) else 0.0
        self.transfers: List[Transfer] = []
        self.machine.on_transfer = self.transfers.append
        self._partial: List[SentByte] = []
        self.imu_frames: List[Reply] = []
        self._imu_period_ms = 0

    def fit_imu(self, period_ms: int = 0) -> "Rig":
        """Connects an IMU; with a period, `settle` starts its stream.  Returns the rig."""
        self.machine.i2c[IMU] = ImuChip()
        self._imu_period_ms = period_ms
        return self

    def _powered(self, elf: Path, seed: int, chip: Chip) -> AvrMachine:
        machine = AvrMachine(elf, seed=seed, chip=chip)
        self.motors = MotorBoard()
        machine.i2c[MOTOR_BOARD] = self.motors
        return machine

    def break_part(self, fault: str) -> None:
        """Breaks the bus in one of four ways ("sda", "scl", "absent", "stretch"), or mends it ("")."""
        self.machine.hang_bus(fault if fault in ("sda", "scl") else None)
        self.motors.present = fault != "absent"
        self.machine.stretch_clock(160000 if fault == "stretch" else 0)

    def hold_counts(self) -> None:
        """Gives the counts as many digits as in the table's frames; here they always have them."""

    def settle(self, **parameters: int) -> "Rig":
        """Waits for the end of boot and sets board parameters, robot id 1 among them; returns the rig."""
        self.run(SETTLED_S)
        for name, value in {"robot_id": 1, **parameters}.items():
            self.ask(request("write_config", PARAMETER_BY_NAME[name].number, value))
        if self._imu_period_ms:
            self.run(IMU_FOUND_S)  # an H-bridge board looks for it when its wiring is accepted
            self.machine.send(request("start_imu_stream", self._imu_period_ms))
        self.run(0.1)
        self.replies()
        return self

    def close(self) -> None:
        self.machine.close()

    def run(self, seconds: float) -> None:
        self.machine.run(seconds)

    def microseconds(self, cycles: int) -> float:
        """Cycles as time [us]."""
        return cycles * 1e6 / self.machine.frequency_hz

    def send_somewhen(self, request: bytes, within_s: float) -> int:
        """Puts a request on the line at a random phase; returns the cycle at which its last stop bit ends."""
        wait = self.random.randrange(int(within_s * self.machine.frequency_hz))
        return self.machine.send(request, self.machine.cycle + wait)

    def replies(self) -> List[Reply]:
        lines: List[Reply] = []
        for byte in self.machine.sent():
            self._partial.append(byte)
            if byte.data == 0x0A:
                text = bytes(one.data for one in self._partial)
                kept = self.imu_frames if text.startswith(IMU_FRAME) else lines
                kept.append(Reply(text, self._partial[0].start_cycle, byte.end_cycle))
                self._partial = []
        return lines

    def ask(self, request: bytes, timeout_s: float = 0.1) -> Reply:
        """Sends a request now and returns the first line that comes back.

        Raises:
            TimeoutError: nothing came.
        """
        self.replies()
        end = self.machine.send(request)
        reply = self.await_value(lambda: next(iter(self.replies()), None), end, timeout_s)
        if reply is None:
            raise TimeoutError(f"no answer to {request!r} within {timeout_s} s of simulated time")
        return reply

    def await_value(self, poll: Callable, from_cycle: int, timeout_s: float) -> Optional[Reply]:
        """Runs on until `poll` returns something, at most `timeout_s` behind a cycle."""
        last = from_cycle + int(timeout_s * self.machine.frequency_hz)
        while self.machine.cycle < last:
            self.run(200e-6)
            found = poll()
            if found is not None:
                return found
        return None

    def writes(self, command: int) -> List[Transfer]:
        """Completed I2C writes that begin with this byte since the last call of `forget`."""
        return [one for one in self.transfers if one.kind == "write" and one.data[0] == command]

    def say(self, data: bytes, wait_s: float = 0.01) -> List[Frame]:
        """Sends bytes; the frames that come until `wait_s` after the last one."""
        self.replies()
        self.machine.run_until(self.machine.send(data))
        self.run(wait_s)
        received = b"".join(reply.line for reply in self.replies())
        return [event for event in FrameDecoder(REPLIES).feed(received) if isinstance(event, Frame)]

    def _told(self, name: str) -> Tuple[int, ...]:
        (frame,) = self.say(request(name))
        return frame.args

    def status(self) -> Dict[str, int]:
        return dict(zip((field.name for field in BY_NAME["read_status"].reply), self._told("read_status")))

    @property
    def stop_reason(self) -> str:
        return STOP_REASONS[self.status()["stop_reason"]]

    @property
    def faults(self) -> Set[str]:
        present = self.status()["faults"]
        return {name for bit, (name, _) in enumerate(FAULTS) if present >> bit & 1}

    def refused(self) -> Dict[str, int]:
        """How much was refused so far, by reason."""
        return {row.name: count for row, count in zip(REASONS, self._told("read_counters"))}

    def forget(self) -> None:
        """Drops what was observed so far."""
        self.transfers.clear()
        self.replies()
        self.imu_frames.clear()
