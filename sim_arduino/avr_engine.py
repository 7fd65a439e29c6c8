"""The engine that runs the real firmware image: a simulated Uno wired to a Plant.

The plant is the Python engine's own, so physics is one; the wire's timing is the chip's.
"""

import struct
from pathlib import Path
from typing import Any, Optional, Union

from sim_arduino.avr.line import heard
from sim_arduino.avr.machine import HOST_BAUD, AvrMachine

FAN, SONAR_TRIGGER, SONAR_POWER, HEATER = 7, 12, 13, 15
WATCHED_PINS = (FAN, SONAR_TRIGGER, SONAR_POWER, HEATER)
SLICE_S = 1e-3  # the longest a byte waits before a server hears of it

FIRMWARE = Path(__file__).resolve().parent.parent / "build" / "firmware" / "mrl_firmware.elf"
"""The sonar build's image in a checkout, after `make firmware`."""


class AvrEngine:
    """A board that executes `elf`; time is simulated seconds since power-up.

    Args:
        plant: what is wired to the board: `i2c` (slaves by address), `adc_volts(channel, time_s)`,
            `pin_changed(pin, level, time_s)` and `advance(time_s)`.
        robot_id: what the EEPROM says where boards have kept it since 2013 (a float at address 0); None leaves it
            blank, so that the board answers 0.
        bootloader: the Uno's clears the chip's reset flags before the sketch starts; False shows them.

    Raises:
        SimulatorError: no such image.  SimulatorMissing: no compiler or libsimavr.
    """

    def __init__(
        self,
        plant: Any,
        elf: Union[str, Path] = FIRMWARE,
        robot_id: Optional[int] = None,
        bootloader: bool = True,
        seed: int = 0,
    ) -> None:
        """Powers the board and wires the plant to it."""
        self.plant = plant
        self.machine = AvrMachine(elf, seed=seed)
        self._host_baud: float = HOST_BAUD
        if robot_id is not None:
            self.machine.write_eeprom(0, struct.pack("<f", robot_id))
        if bootloader:
            self.machine.set_reset_flags(0)
            self.machine.reset()
        self.machine.i2c = plant.i2c
        self.machine.adc_volts = plant.adc_volts
        self.machine.on_pin = plant.pin_changed
        self.machine.watch_pins(WATCHED_PINS)

    def receive(self, data: bytes) -> None:
        """Bytes from the host, the first of them on the wire from now on."""
        self.machine.send(data)

    def advance(self, to_s: float) -> bytes:
        """Runs to a time [s since power-up]; returns the bytes whose stop bit has left the board until then.

        Raises:
            MachineCrashed: the program touched an address that is no memory.
        """
        self.machine.run_until(self._cycle_at(to_s))
        self.plant.advance(self.machine.time_s)
        return heard(self.machine.sent(), self.machine.frequency_hz / self._host_baud)

    def set_host_baud(self, baud: float) -> None:
        """The host's speed, both ways; at another speed than the board's the bytes turn into others."""
        self._host_baud = baud
        self.machine.set_host_baud(baud)

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The board did not run from the last `advance` to `to_s`; `waiting` is what the host sent meanwhile.

        The chip sees a CPU that hung: timers and watchdog went on, and the receiver kept its last three bytes.
        """
        self.receive(waiting)
        self.machine.stall_until(self._cycle_at(to_s))

    @property
    def next_event_s(self) -> float:
        """When to call `advance` again if no bytes come [s]: the chip never rests."""
        return self.machine.time_s + SLICE_S

    def _cycle_at(self, time_s: float) -> int:
        return int(round(time_s * self.machine.frequency_hz))

    def reset(self) -> None:
        """The reset button, or DTR when a host opens the port."""
        self.machine.reset()

    def close(self) -> None:
        """Frees the simulated chip."""
        self.machine.close()
