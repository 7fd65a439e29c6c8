"""Small programs for the simulated chip, compiled once per test process."""

import subprocess
from pathlib import Path
from typing import Any, Callable, Dict, List, Tuple

import pytest

from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip
from sim_arduino.avr.machine import AvrMachine

SKETCHES = Path(__file__).parent / "sketches"
COMPILE = ["avr-gcc", "-DF_CPU=16000000UL", "-Os", "-Wall", "-Werror"]
FAR = ["-Wl,--section-start=.far=0x21000,--section-start=.table=0x30000"]


@pytest.fixture(scope="session")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Path of a program of tests/avr/sketches compiled for a chip, by file name."""
    folder = tmp_path_factory.mktemp("sketches")
    built: Dict[Tuple[str, str], Path] = {}

    def compile_once(name: str, chip: Chip = ATMEGA328P) -> Path:
        key = (name, chip.name)
        if key not in built:
            built[key] = folder / f"{name}.{chip.name}.elf"
            options = [f"-mmcu={chip.name}", *(FAR if chip == ATMEGA2560 else [])]
            subprocess.run([*COMPILE, *options, str(SKETCHES / name), "-o", str(built[key])], check=True)
        return built[key]

    return compile_once


class Bench:
    """A machine whose program's variables are read and set by name."""

    def __init__(self, machine: AvrMachine) -> None:
        self.machine = machine

    def set(self, name: str, value: int) -> None:
        symbol = self.machine.symbol(name)
        self.machine.poke(symbol.address, value.to_bytes(symbol.size, "little"))

    def get(self, name: str) -> int:
        """Value of an unsigned integer variable."""
        return int.from_bytes(self.bytes(name), "little")

    def bytes(self, name: str) -> bytes:
        symbol = self.machine.symbol(name)
        return self.machine.peek(symbol.address, symbol.size)

    def words(self, name: str) -> List[int]:
        raw = self.bytes(name)
        return [int.from_bytes(raw[at : at + 2], "little") for at in range(0, len(raw), 2)]


@pytest.fixture
def bench(sketch: Callable[..., Path], close_later: Callable[..., Any]) -> Callable[..., Bench]:
    """Makes a Bench that runs a program, its variables initialised (200 us after power-up)."""

    def start(name: str, chip: Chip = ATMEGA328P) -> Bench:
        machine = close_later(AvrMachine(sketch(name, chip), chip=chip))
        machine.run(200e-6)
        return Bench(machine)

    return start
