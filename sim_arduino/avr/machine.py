"""An Arduino that runs a real firmware image in simulated time; one AvrMachine per board.

Time is the CPU's cycle count since power-up.  The same image and inputs give the same cycles on every computer.
"""

import random
from ctypes import byref, c_size_t, c_uint64
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple, Union

from mrl_driver.errors import SimulatorError
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip

from . import native
from .elf import Image, Symbol, read_image
from .records import PinChange, SentByte, Transfer

UNO_HZ = 16000000
MOST_UARTS = 4  # of all chips
ARCHITECTURES = {ATMEGA328P.name: 5, ATMEGA2560.name: 6}  # see `Image`
HANGS = {None: 0, "sda": 1, "scl": 2}


class MachineCrashed(SimulatorError):
    """The program accessed an address outside its memory; a real chip would run on with wrong results."""


class AvrMachine:
    """A powered board with `elf` in its flash.

    Raises:
        SimulatorError: the image does not exist, or does not fit into the chip.
        SimulatorMissing: there is no compiler or no libsimavr.
    """

    def __init__(
        self,
        elf: Union[str, Path],
        frequency_hz: int = UNO_HZ,
        seed: int = 0,
        chip: Chip = ATMEGA328P,
    ) -> None:
        """Powers the board; `seed` draws the noise in the SRAM at the start."""
        image = read_image(Path(elf))
        self._native = native.load(chip.name)
        _require_fit(elf, image, chip)
        self.chip = chip
        letters = sorted({pin.port for pin in chip.pins})
        self._places = [(letters.index(pin.port), pin.bit) for pin in chip.pins]
        self._pin_at = {place: pin for pin, place in enumerate(self._places)}
        self.frequency_hz = frequency_hz
        self.symbols = image.symbols  # symbols of the image by name, with address and size
        self.image_flash = image.flash  # the image's `(address, bytes)` pieces
        self.i2c: Dict[int, Any] = {}
        """Slaves by 7-bit address; each has `write(data, time_s)`, `read(count, time_s) -> bytes` and optionally
        `present`."""
        self.adc_volts: Callable[[int, float], float] = lambda channel, time_s: 0.0
        """Called at each conversion as `adc_volts(channel, time_s)`; returns volts at the pin."""
        self.on_pin: Optional[Callable[[int, int, float], None]] = None
        """Called as `on_pin(pin, level, time_s)` when a watched pin changes."""
        self.on_transfer: Optional[Callable[[Transfer], None]] = None
        """Called with a Transfer for each transfer on the I2C bus."""
        self._failure: Optional[BaseException] = None
        self._hooks = self._make_hooks()
        self._board = self._native.mrl_create(frequency_hz, self._hooks)
        if not self._board:
            raise SimulatorError(f"libsimavr knows no {chip.name}: on Debian, apt-get install libsimavr-dev")
        for address, data in image.flash:
            self._native.mrl_load(self._board, data, len(data), address)
        for address, data in image.eeprom:
            self.write_eeprom(address, data)
        uarts = (self._native.mrl_uart(self._board, number) for number in range(MOST_UARTS))
        self._uarts = [uart for uart in uarts if uart]
        self._ram_end = self._native.mrl_ram_end(self._board)
        self.set_host_baud(BAUD)
        self.power_cycle(seed)

    def close(self) -> None:
        """Frees the simulated chip; the machine must not be used afterwards."""
        board, self._board = self._board, None
        if board:
            self._native.mrl_destroy(board)

    def __enter__(self) -> "AvrMachine":
        """Returns the machine itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Frees the simulated chip."""
        self.close()

    # ---- time and resets

    @property
    def cycle(self) -> int:
        """CPU cycles since the first power-up; resets do not clear the count."""
        return self._native.mrl_cycle(self._board)

    @property
    def time_s(self) -> float:
        """Simulated seconds since the first power-up."""
        return self.cycle / self.frequency_hz

    @property
    def awake_cycles(self) -> int:
        """CPU cycles since the first power-up in which the CPU did not sleep."""
        return self.cycle - self._native.mrl_slept(self._board)

    @property
    def next_event_cycle(self) -> int:
        """The first cycle at which the chip can do something if nothing comes from outside; now while it is awake."""
        return self._native.mrl_next_event(self._board)

    @property
    def resets(self) -> int:
        """Number of program starts so far, including the first."""
        return self._native.mrl_resets(self._board)

    def run_until(self, cycle: int) -> None:
        """Runs to the first instruction boundary at or after `cycle` (at most 4 cycles later).

        Raises:
            MachineCrashed: the program accessed an address outside its memory.
            Exception: any error raised by a slave or another callback; the machine stops at that point.
        """
        status = self._native.mrl_run_until(self._board, max(0, int(cycle)))
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        if status == native.RUN_CRASHED:
            raise MachineCrashed(self._crash_report())

    def run(self, seconds: float) -> None:
        """Runs for a simulated duration [s]."""
        self.run_until(self.cycle + int(round(seconds * self.frequency_hz)))

    def stall_until(self, cycle: int) -> None:
        """Stops only the CPU until `cycle`; timers, watchdog and serial line run on, and the CPU notices afterwards."""
        self._native.mrl_stall_until(self._board, cycle)

    def reset(self) -> None:
        """Pull the reset line, as opening the port does through DTR.  SRAM keeps its contents."""
        self._native.mrl_reset(self._board)

    def power_cycle(self, seed: int = 0) -> None:
        """Switch power off and on: SRAM and registers then hold noise drawn from `seed`."""
        noise = random.Random(seed)
        self._noise = bytes(noise.getrandbits(8) for _ in range(self._ram_end + 1))
        self._native.mrl_power_cycle(self._board, self._noise)

    def brown_out(self, seconds: float = 0.0) -> None:
        """Resets the chip with BORF set, as a dip of its supply does; it stays in reset for this long [s].

        SRAM keeps its contents.
        """
        self._native.mrl_brown_out(self._board, self.cycle + int(round(seconds * self.frequency_hz)))

    def set_reset_flags(self, flags: Optional[int]) -> None:
        """Set MCUSR as the program reads it after each future reset.

        0 is right for a bootloader that clears MCUSR; None keeps the chip's own value.
        """
        self._native.mrl_set_reset_flags(self._board, -1 if flags is None else flags)

    # ---- serial line

    def set_host_baud(self, baud: float, gap_s: float = 0.0) -> None:
        """Speed of the transmitters on the serial lines [bit/s] and their pause between bytes [s]."""
        for uart in self._uarts:
            self._native.mrl_uart_set_host(uart, self.frequency_hz / baud, gap_s * self.frequency_hz)

    def send(self, data: bytes, at_cycle: Optional[int] = None, uart: int = 0) -> int:
        """Puts bytes on the line to a USART at `at_cycle` (default: now), after those still on it.

        Returns the cycle at which the last stop bit ends.
        """
        start = self.cycle if at_cycle is None else at_cycle
        self._native.mrl_uart_send(self._uarts[uart], bytes(data), len(data), start)
        return int(self._native.mrl_uart_line_free(self._uarts[uart]))

    def sent(self, uart: int = 0) -> List[SentByte]:
        """The bytes that have left a USART, with their stop bit, since the last call."""
        taken = self._taken(self._native.mrl_uart_sent, self._uarts[uart])
        return [SentByte(one.data, one.start, one.end) for one in taken]

    def _taken(self, take: Callable[..., Any], source: Any) -> Iterator[Any]:
        """The records that a function of the harness hands over."""
        count = c_size_t()
        records = take(source, byref(count))
        return (records[index] for index in range(count.value))

    @property
    def bytes_lost(self) -> int:
        """Number of bytes from the host lost by data overruns so far."""
        return self._native.mrl_uart_lost(self._uarts[0])

    @property
    def baud(self) -> float:
        """Baud rate of the serial link, as set in the board's registers [bit/s]."""
        return self.frequency_hz / self._native.mrl_uart_bit(self._uarts[0])

    # ---- I2C faults

    def hang_bus(self, line: Optional[str], release_clocks: int = 0) -> None:
        """Holds "sda" or "scl" low, or frees the bus (None).

        A held SDA is released after `release_clocks` clock pulses made by port writes; 0 means never.
        """
        if line not in HANGS:
            raise ValueError(f"bus line {line!r} is not one of 'sda', 'scl', None")
        self._native.mrl_twi_set_hang(self._board, HANGS[line], release_clocks)

    def stretch_clock(self, cycles: int) -> None:
        """Makes every byte on the bus take `cycles` CPU cycles longer."""
        self._native.mrl_twi_set_stretch(self._board, cycles)

    def nack_after(self, count: Optional[int]) -> None:
        """Makes slaves acknowledge at most `count` data bytes of a write; None means all."""
        self._native.mrl_twi_set_nack_after(self._board, -1 if count is None else count)

    # ---- pins

    def _place_of(self, pin: int) -> Tuple[int, int]:
        """Port and bit of an Arduino pin; raises ValueError if the board has no such pin."""
        if not 0 <= pin < len(self._places):
            raise ValueError(f"pin {pin} is not one of the {self.chip.board}'s 0..{len(self._places) - 1}")
        return self._places[pin]

    def pin(self, pin: int) -> int:
        """Level of a pin (Arduino number), driven by the chip or from outside."""
        return self._native.mrl_pin_level(self._board, *self._place_of(pin))

    def set_pin(self, pin: int, level: int, at_cycle: Optional[int] = None) -> None:
        """Sets the level of an input now or at a later cycle; undriven pins are high."""
        port, bit = self._place_of(pin)
        if at_cycle is None:
            self._native.mrl_pin_set(self._board, port, bit, int(level))
        else:
            self._native.mrl_pin_plan(self._board, port, bit, int(level), at_cycle)

    def plan_edges(self, pin: int, cycles: Sequence[int]) -> None:
        """Changes the level of an input at each of these cycles, which must rise.

        The first edge leaves the level that earlier plans for the pin end with.  An edge in the past comes at once.
        """
        planned = (c_uint64 * len(cycles))(*cycles)
        self._native.mrl_plan_edges(self._board, *self._place_of(pin), planned, len(planned))

    def high_cycles(self, pin: int) -> int:
        """CPU cycles since the first power-up in which the chip drove the pin high, by its port or by PWM.

        An input and a low output add none.
        """
        return self._native.mrl_pin_high_cycles(self._board, *self._place_of(pin))

    def watch_pins(self, pins: Iterable[int]) -> None:
        """Selects the pins that `pin_changes` and `on_pin` report: new levels, and when the chip starts to drive."""
        masks = dict.fromkeys((port for port, _ in self._places), 0)
        for port, bit in map(self._place_of, pins):
            masks[port] |= 1 << bit
        for port, mask in masks.items():
            self._native.mrl_pin_watch(self._board, port, mask)

    def pin_changes(self) -> List[PinChange]:
        """Changes of the watched pins since the last call."""
        changes = self._taken(self._native.mrl_pin_changes, self._board)
        return [PinChange(self._pin_at[one.port, one.bit], one.level, one.cycle) for one in changes]

    # ---- memory

    def symbol(self, name: str) -> Symbol:
        """A symbol of the image; raises KeyError if the image has no such symbol."""
        return self.symbols[name]

    def peek(self, address: int, count: int = 1) -> bytes:
        """Bytes of the data space (registers, I/O, SRAM), without the side effects of a read."""
        return bytes(self._native.mrl_data(self._board)[address : address + count])

    def poke(self, address: int, data: bytes) -> None:
        """Overwrites bytes of the data space, without the side effects of a write."""
        _copy(data, self._native.mrl_data(self._board), address)

    @property
    def pc(self) -> int:
        """Program counter [byte address]."""
        return self._native.mrl_pc(self._board)

    @property
    def interrupts_on(self) -> bool:
        """Interrupts are enabled."""
        return bool(self._native.mrl_interrupts_on(self._board))

    def patch(self, address: int, code: bytes) -> None:
        """Overwrites flash from a byte address on."""
        self._native.mrl_load(self._board, bytes(code), len(code), address)

    def sram_untouched(self) -> int:
        """Number of bytes above the variables that neither heap nor stack has written since power-up."""
        start = self.symbol("_end").address
        now = self.peek(start, self._ram_end + 1 - start)
        before = self._noise[start:]
        return next((index for index, value in enumerate(now) if value != before[index]), len(now))

    def read_eeprom(self, address: int = 0, count: Optional[int] = None) -> bytes:
        """Bytes of the EEPROM: `count` from `address` on, or all up to its end."""
        end = self.chip.eeprom_bytes if count is None else address + count
        return bytes(self._native.mrl_eeprom(self._board)[address:end])

    def write_eeprom(self, address: int, data: bytes) -> None:
        """Overwrites bytes of the EEPROM from outside; raises ValueError if the bytes do not fit into the EEPROM."""
        size = self.chip.eeprom_bytes
        if not 0 <= address <= size - len(data):
            raise ValueError(f"{len(data)} bytes at {address} are beyond an EEPROM of {size}")
        _copy(data, self._native.mrl_eeprom(self._board), address)

    # ---- callbacks of the simulated chip

    def _make_hooks(self) -> native.Hooks:
        return native.Hooks(
            native.PRESENT(self._guarded(self._present, 0)),
            native.WRITE(self._guarded(self._write, None)),
            native.READ(self._guarded(self._read, 0)),
            native.ADC(self._guarded(self._convert, 0.0)),
            native.PIN(self._guarded(self._pin_changed, None)),
        )

    def _guarded(self, function: Callable, fallback: Any) -> Callable:
        """Wraps a callback: an exception cannot pass through C, so it stops the run, and `run_until` raises it."""

        def call(*arguments: Any) -> Any:
            try:
                return function(*arguments)
            except BaseException as failure:  # noqa: BLE001 - raised again by run_until
                self._failure = self._failure or failure
                self._native.mrl_stop(self._board)
                return fallback

        return call

    def _report(self, kind: str, address: int, data: bytes, cycle: int) -> None:
        if self.on_transfer is not None:
            self.on_transfer(Transfer(kind, address, data, cycle))

    def _present(self, address: int, cycle: int) -> int:
        slave = self.i2c.get(address)
        there = slave is not None and getattr(slave, "present", True)
        if not there:
            self._report("nack", address, b"", cycle)
        return int(there)

    def _write(self, address: int, data: Any, length: int, cycle: int) -> None:
        written = bytes(data[:length])
        self.i2c[address].write(written, cycle / self.frequency_hz)
        self._report("write", address, written, cycle)

    def _read(self, address: int, out: Any, limit: int, cycle: int) -> int:
        data = bytes(self.i2c[address].read(limit, cycle / self.frequency_hz))[:limit]
        for index, value in enumerate(data):
            out[index] = value
        self._report("read", address, data, cycle)
        return len(data)

    def _convert(self, channel: int, cycle: int) -> float:
        return float(self.adc_volts(channel, cycle / self.frequency_hz))

    def _pin_changed(self, port: int, bit: int, level: int, cycle: int) -> None:
        if self.on_pin is not None:
            self.on_pin(self._pin_at[port, bit], level, cycle / self.frequency_hz)

    def _crash_report(self) -> str:
        where = self._native.mrl_crash_pc(self._board)
        message = self._native.mrl_message().decode("ascii", "replace").strip()
        return f"the program crashed at pc 0x{where:04x}, cycle {self.cycle}: {message}"


def _copy(data: bytes, memory: Any, address: int) -> None:
    for offset, value in enumerate(data, address):
        memory[offset] = value


def _require_fit(path: Union[str, Path], image: Image, chip: Chip) -> None:
    """Refuses an image for another chip."""
    if image.architecture not in (0, ARCHITECTURES[chip.name]):
        raise SimulatorError(
            f"firmware image {path} is for chips of avr{image.architecture}, but the {chip.name} is one of "
            f"avr{ARCHITECTURES[chip.name]}; build the image for an Arduino {chip.board}"
        )
    memories = (("flash", image.flash, chip.flash_bytes), ("EEPROM", image.eeprom, chip.eeprom_bytes))
    for name, pieces, size in memories:
        end = max((address + len(data) for address, data in pieces), default=0)
        if end > size:
            raise SimulatorError(
                f"firmware image {path} needs {end} bytes of {name}, but the {chip.name} has {size}; "
                f"build the image for an Arduino {chip.board}"
            )
