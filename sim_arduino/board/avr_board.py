"""The engine that runs the firmware binary: a simulated chip wired to a `Plant`.

Both engines use the same Plant, so there is one physics model.  The simulated chip sets the timing of the serial link.
"""

import math
from pathlib import Path
from typing import Callable, Dict, List, Optional, Tuple, Union

from mrl_driver.errors import SimulatorError
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, BY_NAME, NOT_CONNECTED, PARAMETER_BY_NAME
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import CHIPS
from mrl_driver.robot.models import RobotModel
from sim_arduino.avr.bit_serial import FRAME_BITS, BitReceiver, edges, received
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.hardware.bridge_plant import BridgePlant
from sim_arduino.hardware.wiring import DUST, FAN, HEATER, Plant
from sim_arduino.hardware.xbee import BAUD as RADIO_BAUD
from sim_arduino.hardware.xbee import XBee

from . import parameter_store

IN, OUT = 2, 3  # pins of a radio (Arduino numbers): from the module's DOUT, and to its DIN
SLICE_S = 1e-3  # the wires to bridges or a radio are served in slices of this length [s]
BOOT_S, WRITE_S, SAVE_S = 0.3, 0.05, 0.4  # saving takes 64 bytes of EEPROM at 3.4 ms each
LONGEST_SLEEP_S = 1.0
BROWN_OUT = 1 << 2  # BORF in MCUSR

FIRMWARE = Path(__file__).resolve().parent.parent.parent / "build" / "firmware" / "mrl_firmware.elf"
"""Image of the sonar build in a checkout, after `make firmware`."""


def watched_pins(plant: Plant) -> List[int]:
    """The outputs of the chip that the plant follows, besides those to bridges."""
    triggers = (each.trigger for each in plant.ranges.wires.values())
    pins = (plant.sonar_pins.trigger, plant.sonar_pins.power, *plant.servo_pins, *triggers)
    return [pin for pin in (pins if plant.bridge else (FAN, HEATER, *pins)) if pin != NOT_CONNECTED]


def configured_eeprom(elf: Union[str, Path], robot_id: int, model: RobotModel) -> bytes:
    """The EEPROM of a board with this id that is configured for a robot of this model.

    A separate simulated chip gets over its serial port what the firmware does not know of the model, and saves it;
    SimulatorError if it does not confirm that.
    """
    wanted, known = parameter_store.first(robot_id, model), parameter_store.defaults(robot_id)
    known += wiring.EMPTY.values()
    orders: List[Tuple[str, float, Tuple[int, ...]]] = [
        ("write_config", WRITE_S, (PARAMETER_BY_NAME["robot_id"].number, robot_id)),
        ("default_config", WRITE_S, ()),
        *(("write_config", WRITE_S, row) for row in enumerate(wanted) if row[1] != known[row[0]]),
        ("save_config", SAVE_S, ()),
    ]
    with AvrMachine(elf, chip=CHIPS[model.chip]) as chip:
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


class AvrEngine:
    """A board that executes the image `elf`; time is simulated seconds since power-up.

    The id and the model's defaults are saved in the EEPROM; without an id it is blank, as on a new chip.  `seed` draws
    the noise in the SRAM.  Nothing is connected to a `bare` board.  SimulatorError without the image, SimulatorMissing
    without a compiler or libsimavr.
    """

    def __init__(
        self,
        plant: Plant,
        elf: Union[str, Path] = FIRMWARE,
        robot_id: Optional[int] = None,
        seed: int = 0,
        bare: bool = False,
    ) -> None:
        self.plant = plant
        self.machine = AvrMachine(elf, seed=seed, chip=CHIPS[plant.model.chip])
        self._host_baud: float = BAUD
        if robot_id is not None:
            self.machine.write_eeprom(0, configured_eeprom(elf, robot_id, plant.model))
        self.machine.set_reset_flags(0)  # the Uno's bootloader clears them before the sketch starts
        self.machine.reset()
        self._wires: Union[BridgeWires, RadioWires, None] = None
        self._echoes: Optional[EchoWires] = None
        if bare:
            return
        self.machine.i2c = plant.i2c
        self.machine.adc_volts = plant.adc_volts
        self.machine.on_pin = plant.pin_changed
        self.machine.watch_pins(watched_pins(plant))
        if plant.bridge:
            self._wires = BridgeWires(self.machine, plant.bridge)
            self._echoes = EchoWires(self.machine, plant)
        elif plant.xbee:
            self._wires = RadioWires(self.machine, plant, plant.xbee)

    def receive(self, data: bytes) -> None:
        self.machine.send(data)

    def advance(self, to_s: float) -> bytes:
        """Runs to a time [s since power-up]; returns the bytes that the board has sent completely until then.

        MachineCrashed if the program accessed an address outside its memory.
        """
        for time_s, level in self.plant.dust_edges(to_s):
            self.machine.set_pin(DUST, level, self._cycle_at(max(time_s, self.machine.time_s)))
        self._run(self._cycle_at(to_s), self.machine.run_until)
        self.plant.advance(self.machine.time_s)
        return received(self.machine.sent(), self.machine.frequency_hz / self._host_baud)

    def _run(self, to_cycle: int, run_to: Callable[[int], None]) -> None:
        """Runs the chip with `run_to`, and an H-bridge board's motors or a radio with it."""
        if self._echoes:
            self._echoes.hold()
        if self._wires:
            self._wires.run(to_cycle, run_to)
        else:
            run_to(to_cycle)

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
        if self.plant.bridge:
            self.plant.bridge.boot(self.plant.bridge.time_s)

    def brown_out(self) -> None:
        """The supply voltage dropped: a reset that the program sees as a brown-out, whatever the bootloader does."""
        self.machine.set_reset_flags(BROWN_OUT)
        self.machine.reset()
        self.machine.set_reset_flags(0)

    def close(self) -> None:
        self.machine.close()


class BridgeWires:
    """The wires between a simulated chip and bridges with encoders; the chip's time is that of the plant.

    At the end of a slice the shares of time for which the chip's outputs were high in it drive the motors for the next
    slice, and the encoder edges of the next slice are planned at their cycles.  So the motors answer 1 ms late, and the
    plant's motors are up to 1 ms ahead of the chip.
    """

    def __init__(self, machine: AvrMachine, bridge: BridgePlant) -> None:
        self._machine, self._bridge = machine, bridge
        self._slice = int(round(SLICE_S * machine.frequency_hz))
        self._since = self._end = machine.cycle
        pins = {pin for wires in bridge.outputs for pin in wires if pin != NOT_CONNECTED}
        self._high: Dict[int, int] = {pin: machine.high_cycles(pin) for pin in pins}
        for pin, level in bridge.levels.items():
            machine.set_pin(pin, level)
        self._plan()

    @property
    def next_s(self) -> float:
        """Time of the next call of `run` if the chip does nothing [s]: now while a wheel turns or is driven."""
        return math.inf if all(motor.at_rest for motor in self._bridge.robot.motors) else -math.inf

    def run(self, to_cycle: int, run_to: Callable[[int], None]) -> None:
        """Runs the chip with `run_to` (`run_until` or `stall_until`), and the motors with it.

        While the bootloader moves a motor's wire, the chip stands still.
        """
        while self._machine.cycle < to_cycle:
            run = self._machine.stall_until if self._bridge.is_booting else run_to
            run(min(self._end, to_cycle))
            if self._machine.cycle >= self._end:
                self._drive()
                self._plan()

    def _drive(self) -> None:
        """Writes the shares of the last slice to the bridges."""
        cycles = self._machine.cycle - self._since
        self._since += cycles
        shares = {NOT_CONNECTED: 0.0}
        for pin, before in self._high.items():
            self._high[pin] = self._machine.high_cycles(pin)
            shares[pin] = (self._high[pin] - before) / cycles
        for motor, wires in enumerate(self._bridge.outputs):
            self._bridge.write(self._bridge.time_s, motor, *(shares[pin] for pin in wires))

    def _plan(self) -> None:
        """Moves the motors to the end of the next slice, and plans the edges until then."""
        self._end += self._slice
        self._bridge.advance(self._end / self._machine.frequency_hz)
        planned: Dict[int, List[int]] = {}
        for edge in self._bridge.take_edges():
            cycles = planned.setdefault(edge.pin, [self._machine.cycle - 1])
            cycles.append(max(cycles[-1] + 1, int(round(edge.time_s * self._machine.frequency_hz))))
        for pin, cycles in planned.items():
            self._machine.plan_edges(pin, cycles[1:])


class EchoWires:
    """The wires between a simulated chip and HC-SR04: each trigger plans the edges of its echo."""

    def __init__(self, machine: AvrMachine, plant: Plant) -> None:
        self._machine, self._plant = machine, plant
        self._held = dict.fromkeys(plant.ranges.wires, False)
        for wires in plant.ranges.wires.values():
            machine.set_pin(wires.echo, 0)
        machine.on_pin = self._pin_changed

    def hold(self) -> None:
        """Holds the echoes that a fault holds, and lets the others go."""
        for found, wires in self._plant.ranges.wires.items():
            held = self._plant.ranges.is_held(found)
            if held != self._held[found]:
                self._held[found] = held
                self._machine.set_pin(wires.echo, int(held))

    def _pin_changed(self, pin: int, level: int, time_s: float) -> None:
        ranges = self._plant.ranges
        before = ranges.echo(pin)
        self._plant.pin_changed(pin, level, time_s)
        found, echo = ranges.input_of(pin), ranges.echo(pin)
        if echo is None or echo == before or self._held[found]:
            return
        for edge_s, edge in zip(echo, (1, 0)):
            cycle = int(round(edge_s * self._machine.frequency_hz))
            self._machine.set_pin(ranges.wires[found].echo, edge, cycle)


class RadioWires:
    """The wires between a simulated chip and a radio module; the chip's time is that of the plant.

    At the end of a slice it gets the bytes that the chip has sent in it, and its own bytes begin.  So it answers up to
    1 ms late.
    """

    def __init__(self, machine: AvrMachine, plant: Plant, xbee: XBee) -> None:
        self._machine, self._plant, self._xbee = machine, plant, xbee
        self._receiver = BitReceiver(1.0 / RADIO_BAUD)
        self._slice = int(round(SLICE_S * machine.frequency_hz))
        self._free_s = 0.0
        machine.set_pin(IN, 1)
        machine.on_pin = self._pin_changed
        machine.watch_pins((*watched_pins(plant), OUT))

    @property
    def next_s(self) -> float:
        """Time at which the next packet to the chip begins [s]; may be infinite."""
        return self._xbee.next_s

    def _pin_changed(self, pin: int, level: int, time_s: float) -> None:
        if pin == OUT:
            self._receiver.changed(level, time_s)
        else:
            self._plant.pin_changed(pin, level, time_s)

    def run(self, to_cycle: int, run_to: Callable[[int], None]) -> None:
        """Runs the chip with `run_to` (`run_until` or `stall_until`), and the module with it."""
        while self._machine.cycle < to_cycle:
            run_to(min(self._machine.cycle + self._slice, to_cycle))
            self._exchange(self._machine.time_s)

    def _exchange(self, now_s: float) -> None:
        for byte in self._receiver.take(now_s):
            self._xbee.receive(bytes([byte]), now_s)
        data = b"".join(self._xbee.take(now_s))
        if not data:
            return
        start_s = max(self._free_s, now_s)
        for at_s, level in edges(data, start_s, 1.0 / RADIO_BAUD):
            self._machine.set_pin(IN, level, int(round(at_s * self._machine.frequency_hz)))
        self._free_s = start_s + len(data) * FRAME_BITS / RADIO_BAUD
