"""The firmware's PC build with a motor board in C++; its whole state is saved and restored by copying its memory."""

import ctypes
import fnmatch
import os
import subprocess
from pathlib import Path
from typing import Dict, List, Optional, Sequence, Tuple

from mrl_driver.robot import models
from tests.conformance.bench import ready_eeprom
from tests.firmware.pc_board import load

ROOT = Path(__file__).resolve().parents[4]
BUILD = ROOT / "build" / "verify"
LIBRARY = BUILD / "libboard.so"
FLAGS = ("-std=gnu++11", "-O2", "-Wall", "-shared", "-fPIC", "-Wl,-z,now,-z,relro")
NEW_BATTERY_V = 12.0

_TURNING = ("status::(anonymous namespace)::moving", "motor::(anonymous namespace)::turning")
"""Whether the firmware has got a move since the last stop."""
AS_IT_IS, TICKS, EIGHTHS, MICROSECONDS = range(4)
TIMES = {
    TICKS: """
        baud::*::quiet_since failsafe::*::last_valid motor::*::absent_since motor::*::last_poll
        motor::*::paused_at motor::*::present_since hold::*::heard
    """,
    MICROSECONDS: "*::eeprom_until_us",
}
"""Times in the firmware's memory: in the key they are ages in steps of 20 ms, up to 0.8 s."""
IGNORED = {
    "the clock itself": """
        board_clock::* *::now_us *::start_us *::kicked_us *::sample_us *::first_tick
    """,
    "what is measured, not what is done": """
        sonar::* sensors::* imu::* *::dust* *::latched motor::*::last_counts hal::transfer *::adc*
        motor::*::battery motor::*::temperature motor::*::poll_temperature streams::imu *::radio_*
        *::longest_gap_us
    """,
    "contents of frames to the host, and their numbers": """
        writer::* *::sending *::sent *::line_free_us *::out_free_us answers::*::last_turn
    """,
    "counters of what was refused": """
        status::*::counters status::*::clamped *::overruns
    """,
    "a transfer on the bus, which ends within 1.2 ms; `bus` says whether one is under way": """
        bus::*::started bus::*::rest_from *::bus_until_us motor::*::kind
    """,
    "the sleep of the loop, which it ends by itself": """
        *::asleep *::news
    """,
    "rings and queues with old contents; ex_key adds what waits in them": """
        *::received *::arriving commands::decoder decoder motor::*::queue
    """,
    "the harness": """
        *::motors *::truth *::intact_us completed.0 guard?variable* *::found pristine*
    """,
    "H-bridge and encoders, which this build does not have": """
        *::edges_left *::impossible *::masked *::states *::counts *::edge_ticks *::duties *::newest
        *::planned *::is_new *::single *::acted *::missed
    """,
    "constants": """
        *::world *::flags *::host_baud *::eeprom DW.ref* vtable* _* *::TAKES *::VALUES*
    """,
}
"""Static variables that are not in the key, with the reason.  All others are, byte by byte, and so is a new one."""


class Truth(ctypes.Structure):
    """What the motors have done; times are the board's [us]."""

    _fields_ = [
        ("turned_us", ctypes.c_double),
        ("moved_us", ctypes.c_double),
        ("stopped_us", ctypes.c_double),
        ("quiet_us", ctypes.c_double),
        ("late_us", ctypes.c_double),
        ("turning", ctypes.c_int32),
        ("slept_too_long", ctypes.c_int32),
    ]


class _Field(ctypes.Structure):
    _fields_ = [("offset", ctypes.c_int32), ("size", ctypes.c_int32), ("kind", ctypes.c_int32)]


def build(library: Path = LIBRARY, firmware: Optional[Path] = None, optimise: str = "-O2") -> Path:
    """Compile the library from the firmware in this folder; return its path."""
    source = firmware or ROOT / "firmware" / "mrl_firmware"
    library.parent.mkdir(parents=True, exist_ok=True)
    parts = [str(part) for part in sorted(source.glob("src/*/*.cpp")) if not part.name.endswith("_avr.cpp")]
    tests = ROOT / "tests" / "firmware"
    own = [str(tests / "hal_bridge_pc.cpp"), str(Path(__file__).parent / "board.cpp")]
    new = library.with_suffix(f".{os.getpid()}")
    flags = [optimise if flag == "-O2" else flag for flag in FLAGS]
    subprocess.run(["g++", *flags, f"-I{source}", f"-I{tests}", *parts, *own, "-o", str(new)], check=True)
    new.replace(library)
    return library


def symbols(library: Path) -> Dict[str, Tuple[int, int]]:
    text = subprocess.run(["nm", "-SC", str(library)], check=True, stdout=subprocess.PIPE, text=True).stdout
    found: Dict[str, Tuple[int, int]] = {}
    for line in text.splitlines():
        parts = line.split(maxsplit=3)
        if len(parts) == 4 and parts[2] in "bBdD":
            name = parts[3].replace("mrl::", "")
            while name in found:
                name += "'"
            found[name] = (int(parts[0], 16), int(parts[1], 16))
    return found


def _matches(name: str, patterns: Sequence[str]) -> bool:
    plain = name.rstrip("'")
    return any(fnmatch.fnmatchcase(plain, pattern) for pattern in patterns)


def fields_of(found: Dict[str, Tuple[int, int]], first: int, size: int) -> List[Tuple[str, int, int, int]]:
    """Return name, offset, size and kind of each variable in the key."""
    ignored = " ".join(IGNORED.values()).split()
    fields = []
    for name, (address, length) in sorted(found.items(), key=lambda each: each[1]):
        if not first <= address < first + size:
            continue
        kind = next((kind for kind, patterns in TIMES.items() if _matches(name, patterns.split())), AS_IT_IS)
        if name == "streams::main":
            fields += [(name, address - first, 4, AS_IT_IS), (name, address - first + 4, 4, EIGHTHS)]
            fields.append((name, address - first + 8, 1, AS_IT_IS))
        elif kind or not _matches(name, ignored):
            fields.append((name, address - first, length, kind))
    return fields


class ExploredBoard:
    """One board; each instance loads a copy of the library of its own."""

    def __init__(self, library: Path = LIBRARY) -> None:
        self._native = native = load(library)
        native.ex_begin.argtypes, native.ex_battery.argtypes = (
            (ctypes.c_double, ctypes.c_char_p),
            (ctypes.c_double,),
        )
        native.ex_memory.restype = ctypes.c_void_p
        native.ex_truth.restype = ctypes.POINTER(Truth)
        native.ex_intact_us.restype = ctypes.c_double
        native.ex_run.argtypes = (ctypes.c_double, ctypes.c_char_p, ctypes.c_int)
        native.ex_receive.argtypes = (ctypes.c_char_p, ctypes.c_int, ctypes.c_int)
        native.ex_save.argtypes = native.ex_restore.argtypes = (ctypes.c_char_p,)
        native.ex_exchange.argtypes = (ctypes.c_char_p, ctypes.c_int)
        native.ex_key.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_uint32, ctypes.c_char_p)
        native.ex_begin(NEW_BATTERY_V, ready_eeprom(models.load("traxbot"), {}))
        self.size = native.ex_size()
        self.truth: Truth = native.ex_truth().contents
        self._buffer = ctypes.create_string_buffer(1 << 16)
        self._image = ctypes.create_string_buffer(self.size)
        self._key = ctypes.create_string_buffer(1 << 14)
        found = symbols(library)
        offset = ctypes.addressof(self.truth) - found["(anonymous namespace)::truth"][0]
        self.fields = fields_of(found, native.ex_memory() - offset, native.ex_static_size())
        self._fields = (_Field * len(self.fields))(*(field[1:] for field in self.fields))
        self._ticks = ctypes.c_uint32.from_address(
            offset + found["board_clock::(anonymous namespace)::now_ticks"][0]
        )
        self._reason = ctypes.c_uint8.from_address(
            offset + found["status::(anonymous namespace)::stop_reason"][0]
        )
        turning = next(found[name] for name in _TURNING if name in found)
        self._turning = ctypes.c_uint8.from_address(offset + turning[0])

    @property
    def now_s(self) -> float:
        """The board's time [s]."""
        return round(self._native.pc_now_us()) / 1e6

    @property
    def stop_reason(self) -> int:
        return self._reason.value

    @property
    def expects_motion(self) -> bool:
        return bool(self._turning.value)

    def receive(self, data: bytes, intact: bool = True) -> None:
        self._native.ex_receive(data, len(data), intact)

    def run(self, to_s: float) -> bytes:
        """Run until a time, or until a frame has left; return the bytes that have left."""
        count = self._native.ex_run(to_s * 1e6, self._buffer, 1 << 16)
        return self._buffer[:count]

    def save(self) -> bytes:
        self._native.ex_save(self._image)
        return self._image.raw

    def restore(self, state: bytes) -> None:
        self._native.ex_restore(state)

    def key(self) -> bytes:
        count = self._native.ex_key(self._fields, len(self._fields), self._ticks.value, self._key)
        return self._key[:count]

    def reset(self) -> None:
        self._native.ex_reset()

    def exchange(self, other: bytes, counts: int) -> None:
        """Another board, saved before, is on the port; its counters are ahead by `counts`."""
        self._native.ex_exchange(other, counts)

    def refuse_stops(self, count: int) -> None:
        self._native.ex_refuse_stops(count)

    def set_absent(self, on: bool) -> None:
        """Take the motor board off the bus, and its power."""
        self._native.ex_absent(on)

    def set_blocked(self, on: bool) -> None:
        """The wheels do not turn, whatever the motors do."""
        self._native.ex_block(on)

    def set_battery(self, volts: float) -> None:
        """Set the battery's voltage [V]."""
        self._native.ex_battery(volts)
