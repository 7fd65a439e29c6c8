"""Small programs for the simulated chip, compiled once per test process."""

import subprocess
from pathlib import Path
from typing import Any, Callable, Dict, List

import pytest

from sim_arduino.avr.machine import AvrMachine

SKETCHES = Path(__file__).parent / "sketches"
COMPILE = ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000UL", "-Os", "-Wall", "-Werror"]


@pytest.fixture(scope="session")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Path of a compiled program of tests/avr/sketches, by file name."""
    folder = tmp_path_factory.mktemp("sketches")
    built: Dict[str, Path] = {}

    def compile_once(name: str) -> Path:
        if name not in built:
            built[name] = folder / (name + ".elf")
            subprocess.run(COMPILE + [str(SKETCHES / name), "-o", str(built[name])], check=True)
        return built[name]

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
def bench(sketch: Callable[[str], Path], close_later: Callable[..., Any]) -> Callable[[str], Bench]:
    """Makes a Bench that runs a program, its variables initialised (200 us after power-up)."""

    def start(name: str) -> Bench:
        machine = close_later(AvrMachine(sketch(name)))
        machine.run(200e-6)
        return Bench(machine)

    return start
