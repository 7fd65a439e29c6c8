"""Compiling the harness and reading images: what a user without the parts is told."""

import os
import subprocess

import pytest

from mrl_driver.errors import SimulatorError
from mrl_driver.robot.chips import ATMEGA2560
from sim_arduino.avr import intel_hex
from sim_arduino.avr.build import SimulatorMissing, build
from sim_arduino.avr.elf import read_image
from sim_arduino.avr.machine import AvrMachine

CHIP = "atmega328p"


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """Makes the compiler a shell script of these lines, which finds the name of its output in $2."""

    def make(script):
        path = tmp_path / "cc"
        path.write_text(f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\n{script}\n')
        path.chmod(0o755)
        monkeypatch.setenv("CC", str(path))
        return path

    return make


@pytest.mark.parametrize(
    ("script", "text"),
    [
        ("echo 'ld: cannot find -lsimavr' ; exit 1", "cannot find -lsimavr.*apt-get install"),
        ("exit 1", "the compiler gave no reason"),
        ('echo half > "$2"; exit 1', "apt-get install"),
    ],
)
def test_a_failed_build_names_reason_and_packages_and_leaves_nothing(tmp_path, compiler, script, text):
    path = compiler(script)
    with pytest.raises(SimulatorMissing, match=text):
        build(tmp_path / "board.so", CHIP)
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_compiler_is_named_without_an_error_number(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", str(tmp_path / "none"))
    with pytest.raises(
        SimulatorMissing, match=r"compiled \(/.*/none: No such file or directory\): .*apt-get install"
    ):
        build(tmp_path / "board.so", CHIP)


@pytest.mark.parametrize("contents", [b"", b"\x7fELF", b"#!/bin/sh\n" * 20, b"\x7fELF\x02" + bytes(100)])
def test_another_file_is_no_image(tmp_path, contents):
    path = tmp_path / "firmware.elf"
    path.write_bytes(contents)
    with pytest.raises(SimulatorError, match="not an AVR ELF or Intel HEX file"):
        read_image(path)


def test_an_image_for_a_larger_chip_is_refused(tmp_path):
    path = tmp_path / "firmware.hex"
    path.write_text(":020000040010EA\n:02000000FFCF30\n:00000001FF\n")
    with pytest.raises(
        SimulatorError, match="firmware.hex needs 1048578 bytes of flash, .* has 32768; build"
    ):
        AvrMachine(path)


@pytest.mark.parametrize(("size", "fits"), [(1024, True), (1025, False)])
def test_an_image_may_fill_the_eeprom(tmp_path, size, fits):
    source, elf = tmp_path / "program.c", tmp_path / "program.elf"
    source.write_text(
        f'__attribute__((section(".eeprom"), used)) char saved[{size}] = {{[0] = 7}};\nint main() {{}}\n'
    )
    subprocess.run(["avr-gcc", "-mmcu=atmega644p", str(source), "-o", str(elf)], check=True)
    if fits:
        with AvrMachine(elf) as machine:
            assert machine.read_eeprom(0, 2) == b"\x07\x00"
    else:
        with pytest.raises(
            SimulatorError, match="program.elf needs 1025 bytes of EEPROM, .* has 1024; build"
        ):
            AvrMachine(elf)


def test_an_image_for_another_instruction_set_is_refused(sketch):
    with pytest.raises(
        SimulatorError, match="is for chips of avr5, but the atmega2560 is one of avr6; build the"
    ):
        AvrMachine(sketch("uart.c"), chip=ATMEGA2560)


def test_a_library_older_than_its_sources_is_compiled_again(tmp_path, compiler):
    compiler('printf new > "$2"')
    library = tmp_path / "board.so"
    library.write_bytes(b"old")
    os.utime(library, (0, 0))
    assert build(library, CHIP).read_bytes() == b"new"


END = ":00000001FF"


def test_records_are_pieces_at_their_addresses():
    """Data at 0x0010, then at 0x10000 through a segment and through a linear base."""
    text = f":0200100001F0FD\n:020000021000EC\n:0100000055AA\n:020000040001F9\n:0100020066 97\n{END}\n"
    pieces = [(0x10, b"\x01\xf0"), (0x10000, b"\x55"), (0x10002, b"\x66")]
    assert intel_hex.read(text.replace(" ", "")) == pieces


@pytest.mark.parametrize(
    "text, reason",
    [
        (f":0200100001F0FE\n{END}", "line 1 is ':0200100001F0FE', expected a record"),
        (f":0300100001F0FC\n{END}", "line 1"),
        (f"0200100001F0FD\n{END}", "line 1"),
        (f":zz\n{END}", "non-hexadecimal"),
        (":0200100001F0FD\n", "ends the file is missing"),
    ],
)
def test_what_is_damaged_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        intel_hex.read(text)
