"""The firmware's C++ compiled for the PC, as an engine on a Plant: the same interface as the emulator's boards.

Each board loads a copy of the library of its own, for all of the firmware's state is static, as on the chip.
"""

import ctypes
import math
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any, Callable, List, Optional, Tuple

BUILD = Path(__file__).resolve().parent.parent.parent / "build" / "pc"
SONARS, ENVIRONMENT, XBEE, BRIDGE, MEGA, VIRTUAL = (
    BUILD / f"libmrl_firmware{suffix}.so"
    for suffix in ("", "_environment", "_xbee", "_hbridge", "_hbridge_mega", "_virtual")
)
EEPROM_SIZE = 1024
VOLTS_PER_COUNT = 5.0 / 1024.0
POWER_ON, EXTERNAL, BROWN_OUT, WATCHDOG, MARKED, KEPT = 1, 2, 4, 8, 16, 32
"""What a reset leaves behind: the chip's flags, the mark of the watchdog's interrupt, RAM that kept its contents."""

_SYSTEM = ctypes.CDLL(None)
_SYSTEM.dlopen.restype, _SYSTEM.dlclose.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
_BYTES = ctypes.POINTER(ctypes.c_uint8)
_WRITE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_uint8, _BYTES, ctypes.c_int, ctypes.c_double)
_READ = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_uint8, _BYTES, ctypes.c_int, ctypes.c_double)
_ADC = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_double)
_PIN = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_int, ctypes.c_double)
_BRIDGE = ctypes.CFUNCTYPE(None, *5 * [ctypes.c_int], ctypes.c_double)
_LEVEL = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int)
_RELEASE = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_double)
_DOUBLE = ctypes.POINTER(ctypes.c_double)
_ECHO = ctypes.CFUNCTYPE(None, ctypes.c_int, _DOUBLE, _DOUBLE)
FULL_DUTY = 255
EDGE_DELAY_S = 1e-3
"""The board runs in slices of this length [s]; the edges of a slice reach it in the next one."""


class _World(ctypes.Structure):
    _fields_ = [
        ("i2c_write", _WRITE),
        ("i2c_read", _READ),
        ("adc", _ADC),
        ("pin", _PIN),
        ("bridge", _BRIDGE),
        ("level", _LEVEL),
        ("release", _RELEASE),
        ("echo", _ECHO),
    ]


def load(library: Path) -> Any:
    """A copy of the library with state of its own.

    Raises:
        FileNotFoundError: it has not been built.
    """
    if not library.exists():
        raise FileNotFoundError(f"{library} is missing: run `make pc-firmware`")
    descriptor, copy = tempfile.mkstemp(suffix=".so")
    os.close(descriptor)
    try:
        shutil.copyfile(library, copy)
        handle = _SYSTEM.dlopen(os.fsencode(copy), os.RTLD_NOW)
    finally:
        os.unlink(copy)
    if not handle:
        raise OSError(f"{library} cannot be loaded: run `make pc-firmware`")
    native = ctypes.CDLL(str(library), handle=handle)
    native.handle = handle
    native.pc_start.argtypes = (
        ctypes.POINTER(_World),
        ctypes.c_double,
        ctypes.c_uint16,
        ctypes.c_int,
        ctypes.c_char_p,
    )
    for name in ("pc_advance", "pc_stall", "pc_set_host_baud"):
        getattr(native, name).argtypes = (ctypes.c_double,)
    native.pc_now_us.restype = native.pc_advance.restype = native.pc_longest_kick_gap_us.restype = (
        ctypes.c_double
    )
    native.pc_eeprom.restype = _BYTES
    native.pc_decoder_arguments.restype = ctypes.POINTER(ctypes.c_int16)
    native.pc_edge.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_double)
    native.pc_dust.argtypes = (ctypes.c_uint32,)
    native.pc_dust_per_litre.argtypes = (ctypes.c_uint32, ctypes.c_uint32)
    return native


def _guarded(call: Callable[..., int]) -> Callable[..., int]:
    """An exception cannot cross C: it is raised by `advance`."""

    def guarded(self: "PcBoard", *args: Any) -> int:
        try:
            return call(self, *args)
        except Exception as failure:  # noqa: BLE001 - raised again by advance
            self._failure = self._failure or failure
            return 0

    return guarded


class PcBoard:
    """A board on a Plant.

    Args:
        plant: What is wired to it.
        eeprom: 1024 bytes; blank if absent.
        library: Which build.
        first_tick: Where the 16-bit clock starts, to test its wrap.
        reset_flags: What the first start finds of the reset.

    Attributes:
        transfers: I2C writes and reads: time [s], "write" or "read", address, bytes.
        nack: Called with address and bytes of each transfer; True refuses it.
    """

    def __init__(
        self,
        plant: Any,
        eeprom: Optional[bytes] = None,
        library: Path = SONARS,
        first_tick: int = 0,
        reset_flags: int = POWER_ON,
    ) -> None:
        self.plant = plant
        self.transfers: List[Tuple[float, str, int, bytes]] = []
        self.nack: Callable[[int, bytes], bool] = lambda address, data: False
        self._library, self._first_tick = library, first_tick
        self._world = _World(
            _WRITE(self._write),
            _READ(self._read),
            _ADC(self._adc),
            _PIN(self._pin),
            _BRIDGE(self._bridge),
            _LEVEL(self._level),
            _RELEASE(self._release),
            _ECHO(self._echo),
        )
        self._failure: Optional[BaseException] = None
        self._wheels = getattr(plant, "bridge", None)
        self._sent = (ctypes.c_uint8 * 65536)()
        self.native: Any = None
        self._start(0.0, reset_flags, b"\xff" * EEPROM_SIZE if eeprom is None else bytes(eeprom))

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        """Bytes from the host, the first of them on the line from now on."""
        for byte in data:
            self.native.pc_receive(byte)

    def advance(self, to_s: float) -> bytes:
        """Runs to `to_s` [s]; the bytes that left the board until then."""
        if self._library == VIRTUAL or self._wheels is None:
            self._advance_slice(to_s)
        else:
            self._advance_with_encoders(to_s)
        assert not self.native.pc_slept_too_long(), "the loop slept although something was due"
        return ctypes.string_at(self._sent, self.native.pc_sent(self._sent, len(self._sent)))

    def _advance_with_encoders(self, to_s: float) -> None:
        now_us = self.native.pc_now_us()
        while now_us < to_s * 1e6:
            now_us = self._advance_slice(min(to_s, now_us * 1e-6 + EDGE_DELAY_S))
            for edge in self._wheels.take_edges():
                self.native.pc_edge(edge.pin, edge.level, (edge.time_s + EDGE_DELAY_S) * 1e6)

    def _advance_slice(self, to_s: float) -> float:
        """The board's time after it [us]."""
        now_us = float(self.native.pc_advance(to_s * 1e6))
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        self.plant.advance(max(to_s, now_us * 1e-6))
        return now_us

    def set_host_baud(self, baud: float) -> None:
        """The host's speed, both ways; at another speed than the board's the bytes turn into others."""
        self.native.pc_set_host_baud(baud)

    @property
    def now_s(self) -> float:
        return self.native.pc_now_us() * 1e-6

    @property
    def next_event_s(self) -> float:
        """The loop never rests."""
        return self.now_s + 1e-3

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`; `waiting` is what the host sent meanwhile."""
        self.receive(waiting)
        self.native.pc_stall(to_s * 1e6)
        self.plant.advance(to_s)

    def reset(self, flags: int = EXTERNAL | KEPT) -> None:
        """The reset line; RAM of the firmware starts anew, EEPROM stays."""
        now_s, eeprom = self.now_s, self.eeprom
        self.close()
        self._start(now_s, flags, eeprom)

    def close(self) -> None:
        if self.native is not None:
            handle, self.native = self.native.handle, None
            _SYSTEM.dlclose(handle)

    # ---- faults and memory

    @property
    def eeprom(self) -> bytes:
        return bytes(self.native.pc_eeprom()[:EEPROM_SIZE])

    def radio_sent(self) -> bytes:
        """What the board has sent to its radio since the last call; only in the radio build."""
        buffer = (ctypes.c_uint8 * 256)()
        return bytes(buffer[: self.native.pc_radio_sent(buffer, 256)])

    def hang_bus(self, on: bool, recoveries: int = 0) -> None:
        """Transfers do not end any more, for ever or until so many attempts to free the bus."""
        self.native.pc_hang_bus(int(on), recoveries)

    @property
    def longest_pass_s(self) -> float:
        """Longest time between two passes of the loop so far [s]."""
        return self.native.pc_longest_kick_gap_us() * 1e-6

    # ---- what the board asks

    def _start(self, now_s: float, flags: int, eeprom: bytes) -> None:
        self.native = load(self._library)
        self.native.pc_start(ctypes.byref(self._world), now_s * 1e6, self._first_tick, flags, eeprom)

    @_guarded
    def _write(self, address: int, data: Any, count: int, time_us: float) -> int:
        sent, time_s = ctypes.string_at(data, count), time_us * 1e-6
        slave = self.plant.i2c.get(address)
        if slave is None or not getattr(slave, "present", True) or self.nack(address, sent):
            return 0
        self.transfers.append((time_s, "write", address, sent))
        return int(slave.write(sent, time_s) is not False)

    @_guarded
    def _read(self, address: int, data: Any, count: int, time_us: float) -> int:
        answer = self.plant.i2c[address].read(count, time_us * 1e-6)[:count].ljust(count, b"\xff")
        self.transfers.append((time_us * 1e-6, "read", address, answer))
        ctypes.memmove(data, answer, count)
        return 1

    @_guarded
    def _adc(self, channel: int, time_us: float) -> int:
        return max(0, min(1023, math.floor(self.plant.adc_volts(channel, time_us * 1e-6) / VOLTS_PER_COUNT)))

    @_guarded
    def _pin(self, pin: int, level: int, time_us: float) -> int:
        self.plant.pin_changed(pin, level, time_us * 1e-6)
        return 0

    def _release(self, pin: int, time_us: float) -> None:
        """Resistors of the sonars hold an input low."""
        self._pin(pin, 0, time_us)

    @_guarded
    def _echo(self, pin: int, begin_us: Any, end_us: Any) -> int:
        echo = self.plant.ranges.echo(pin)
        begin_us[0], end_us[0] = (at_s * 1e6 for at_s in echo or (0.0, 0.0))
        return 0

    @_guarded
    def _bridge(self, motor: int, pwm_a: int, pwm_b: int, logic: int, enable: int, time_us: float) -> int:
        if self._wheels is not None:
            shares = (pwm_a / FULL_DUTY, pwm_b / FULL_DUTY, logic / FULL_DUTY, enable / FULL_DUTY)
            self._wheels.write(time_us * 1e-6, motor, *shares)
        return 0

    @_guarded
    def _level(self, pin: int) -> int:
        """Lines that nothing drives are pulled up."""
        return 1 if self._wheels is None else int(self._wheels.levels.get(pin, 1))
