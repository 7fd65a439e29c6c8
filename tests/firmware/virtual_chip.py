"""What the image of a bare board does with its motors, as its memory on the simulated chip says."""

import struct
from typing import List

from sim_arduino.avr.machine import AvrMachine

_WHEEL_BYTES, _DRIVE_AT = 18, 8  # of a wheel in the memory; the share of the voltage in it


def driven(machine: AvrMachine) -> List[bool]:
    """Whether each of the two motors is driven."""
    names = machine.symbols
    wheels = next(names[name] for name in names if "virtual_robot" in name and "6wheelsE" in name)
    places = (wheels.address + _WHEEL_BYTES * wheel + _DRIVE_AT for wheel in range(2))
    return [struct.unpack("<i", machine.peek(place, 4)) != (0,) for place in places]


def run_to_sample(machine: AvrMachine) -> None:
    """Runs until the next period of the control begins."""
    names = machine.symbols
    place = next(names[name].address for name in names if "N_13dueE" in name)
    before = machine.peek(place, 2)
    while machine.peek(place, 2) == before:
        machine.run(1e-4)
