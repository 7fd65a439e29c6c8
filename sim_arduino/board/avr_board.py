"""The engine that runs the firmware binary: a simulated Uno wired to a `Plant`.

Both engines use the same Plant, so there is one physics model.  The simulated chip sets the timing of the serial link.
"""

from pathlib import Path
from typing import Callable, List, Optional, Sequence, Tuple, Union

from mrl_driver.errors import SimulatorError
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, BY_NAME, PARAMETER_BY_NAME
from sim_arduino.avr.bit_serial import received
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.hardware.wiring import DUST, FAN, HEATER, SONAR_POWER, SONAR_TRIGGER, Plant
from sim_arduino.hardware.xbee import XBee

from . import parameter_store
from .wires import OUT, SLICE_S, BridgeWires, RadioWires

WATCHED_PINS = (FAN, SONAR_TRIGGER, SONAR_POWER, HEATER)
BOOT_S, WRITE_S, SAVE_S = 0.3, 0.05, 0.4  # saving takes 64 bytes of EEPROM at 3.4 ms each
LONGEST_SLEEP_S = 1.0
BROWN_OUT = 1 << 2  # BORF in MCUSR

FIRMWARE = Path(__file__).resolve().parent.parent.parent / "build" / "firmware" / "mrl_firmware.elf"
"""Image of the sonar build in a checkout, after `make firmware`."""


def configured_eeprom(
    elf: Union[str, Path], robot_id: int, parameters: Sequence[Tuple[int, int]] = ()
) -> bytes:
    """The EEPROM of a board with this id and these parameters (number, value); all others are defaults.

    A separate simulated chip gets the values over its serial port and saves them.

    Raises:
        SimulatorError: the image does not confirm that it has saved the values.
    """
    number = PARAMETER_BY_NAME["robot_id"].number
    orders: List[Tuple[str, float, Tuple[int, ...]]] = [
        ("write_config", WRITE_S, (number, robot_id)),
        ("default_config", WRITE_S, ()),
        *(("write_config", WRITE_S, each) for each in parameters),
        ("save_config", SAVE_S, ()),
    ]
    with AvrMachine(elf) as chip:
        chip.run(BOOT_S)
        for name, wait_s, values in orders:
            chip.send(encode_request(BY_NAME[name].code, *values))
            chip.run(wait_s)
        answer = bytes(byte.data for byte in chip.sent())
        if Frame(BY_NAME["save_config"].code, (1,)) not in FrameDecoder(REPLIES).feed(answer):
            raise SimulatorError(
                f"image {elf} did not save its robot id, it answered {answer!r}; use an image of this version"
            )
        return chip.read_eeprom()


def _parameters_of(plant: Plant, robot_id: int) -> List[Tuple[int, int]]:
    """Parameters (number, value) that a new board needs if the firmware does not know its robot model."""
    wanted, known = parameter_store.first(robot_id, plant.model), parameter_store.defaults(robot_id)
    return [(number, value) for number, value in enumerate(wanted) if value != known[number]]


class AvrEngine:
    """A board that executes `elf`; time is simulated seconds since power-up.

    Args:
        plant: the hardware wired to the board.
        elf: firmware image.
        robot_id: this id and the model's defaults are saved in the EEPROM; None leaves the EEPROM blank, as on a
            new chip.
        bootloader: True clears the chip's reset flags before the sketch starts, as the Uno's bootloader does.
        seed: draws the noise in the SRAM.

    Raises:
        SimulatorError: the image does not exist.
        SimulatorMissing: there is no compiler or no libsimavr.
    """

    def __init__(
        self,
        plant: Plant,
        elf: Union[str, Path] = FIRMWARE,
        robot_id: Optional[int] = None,
        bootloader: bool = True,
        seed: int = 0,
    ) -> None:
        self.plant = plant
        self.machine = AvrMachine(elf, seed=seed)
        self._host_baud: float = BAUD
        if robot_id is not None:
            self.machine.write_eeprom(0, configured_eeprom(elf, robot_id, _parameters_of(plant, robot_id)))
        self._reset_flags = 0 if bootloader else None
        if bootloader:
            self.machine.set_reset_flags(self._reset_flags)
            self.machine.reset()
        self.machine.i2c = plant.i2c
        self.machine.adc_volts = plant.adc_volts
        self.machine.on_pin = plant.pin_changed
        self.machine.watch_pins(WATCHED_PINS)
        self._wires: Union[BridgeWires, RadioWires, None] = None
        if plant.bridge:
            self._wires = BridgeWires(self.machine, plant.bridge)
        elif plant.xbee:
            self._fit_radio(plant.xbee)

    def receive(self, data: bytes) -> None:
        self.machine.send(data)

    def advance(self, to_s: float) -> bytes:
        """Runs to a time [s since power-up]; returns the bytes that the board has sent completely until then.

        Raises:
            MachineCrashed: the program accessed an address outside its memory.
        """
        for time_s, level in self.plant.dust_edges(to_s):
            self.machine.set_pin(DUST, level, self._cycle_at(max(time_s, self.machine.time_s)))
        self._run(self._cycle_at(to_s), self.machine.run_until)
        self.plant.advance(self.machine.time_s)
        return received(self.machine.sent(), self.machine.frequency_hz / self._host_baud)

    def _run(self, to_cycle: int, run_to: Callable[[int], None]) -> None:
        """Runs the chip with `run_to`, and an H-bridge board's motors or a radio with it."""
        if self._wires:
            self._wires.run(to_cycle, run_to)
        else:
            run_to(to_cycle)

    def _fit_radio(self, xbee: XBee) -> None:
        radio = self._wires = RadioWires(self.machine, xbee)

        def pin_changed(pin: int, level: int, time_s: float) -> None:
            if pin == OUT:
                radio.changed(level, time_s)
            else:
                self.plant.pin_changed(pin, level, time_s)

        self.machine.on_pin = pin_changed
        self.machine.watch_pins((*WATCHED_PINS, OUT))

    def set_host_baud(self, baud: float) -> None:
        """Set the host's baud rate in both directions; if it differs from the board's, bytes arrive corrupted."""
        self._host_baud = baud
        self.machine.set_host_baud(baud)

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The board did not run from the last `advance` to `to_s`; `waiting` holds the bytes sent meanwhile.

        For the chip this is a CPU that hung: timers and watchdog ran on, and the receiver kept its last three bytes.
        """
        self.receive(waiting)
        self._run(self._cycle_at(to_s), self.machine.stall_until)

    @property
    def next_event_s(self) -> float:
        """Time of the next call of `advance` if no bytes arrive [s].

        While the chip sleeps, this is its next event, and at most LONGEST_SLEEP_S from now.  It is at least one slice
        from now, so that a chip that is awake or sends bytes does not need a call for each of them.  Wheels that turn
        need a call for each slice.
        """
        now_s = self.machine.time_s
        event_s = self.machine.next_event_cycle / self.machine.frequency_hz
        if self._wires:
            event_s = min(event_s, self._wires.next_s)
        return min(max(event_s, now_s + SLICE_S), now_s + LONGEST_SLEEP_S)

    def _cycle_at(self, time_s: float) -> int:
        return int(round(time_s * self.machine.frequency_hz))

    def reset(self) -> None:
        self.machine.reset()

    def brown_out(self) -> None:
        """The supply voltage dropped: a reset that the program sees as a brown-out, whatever the bootloader does."""
        self.machine.set_reset_flags(BROWN_OUT)
        self.machine.reset()
        self.machine.set_reset_flags(self._reset_flags)

    def close(self) -> None:
        self.machine.close()
