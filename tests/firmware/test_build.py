"""The sketch as the Arduino IDE builds it, builds that must fail, and what `make` says."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
SKETCH = ROOT / "firmware" / "mrl_firmware"
OBJECTS = ROOT / "build" / "firmware" / "mrl_firmware.o"
CORE_OBJECTS = ROOT / "build" / "firmware" / "core"
ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")
CHIP = ["-mmcu=atmega328p", "-DF_CPU=16000000L", "-DARDUINO=10819", "-DARDUINO_AVR_UNO", "-DARDUINO_ARCH_AVR"]
INCLUDE = [f"-I{ARDUINO}/cores/arduino", f"-I{ARDUINO}/variants/standard"]
IDE = [*CHIP, *INCLUDE, "-g", "-Os", "-w", "-std=gnu++11", "-fpermissive", "-fno-exceptions", "-ffunction-sections",
       "-fdata-sections", "-fno-threadsafe-statics", "-flto", "-fuse-linker-plugin", "-Wl,--gc-sections"]  # fmt: skip
FLASH_BYTES = 32256


def run(*command, **options):
    return subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, cwd=ROOT, check=False, **options
    )


def flash_bytes(elf: Path) -> int:
    text, data = run("avr-size", elf).stdout.splitlines()[1].split()[:2]
    return int(text) + int(data)


@pytest.mark.parametrize("build", ["-DMRL_BRIDGE=0", "-DMRL_BRIDGE=1"])
def test_arduino_ide_builds_it(tmp_path, build):
    """Flat folder, no Python, -Os, the core's own serial port and I2C within the linker's reach."""
    sketch = tmp_path / "mrl_firmware.ino.cpp"
    sketch.write_text("#include <Arduino.h>\n" + (SKETCH / "mrl_firmware.ino").read_text())
    core = [ARDUINO / "cores/arduino" / name for name in ("main.cpp", "HardwareSerial.cpp", "Print.cpp")]
    image = tmp_path / "sketch.elf"
    built = run("avr-g++", *IDE, build, f"-I{SKETCH}", sketch, *sorted(SKETCH.glob("*.cpp")), *core,
                *(CORE_OBJECTS / name for name in ("hooks.c.o", "wiring.c.o")),
                "-o", image)  # fmt: skip
    assert built.returncode == 0, built.stderr
    assert flash_bytes(image) < FLASH_BYTES


def test_forgotten_handler_fails_to_link(tmp_path):
    """Without motion.cpp nobody carries out command 11."""
    objects = [path for path in OBJECTS.glob("*.o") if path.name != "motion.cpp.o"]
    built = run(
        "avr-gcc",
        "-mmcu=atmega328p",
        "-flto",
        "-O1",
        *objects,
        *CORE_OBJECTS.glob("*.o"),
        "-o",
        tmp_path / "x",
    )
    assert built.returncode != 0 and "move_differential" in built.stderr


WRONG_PINS = [
    ("-DMRL_ENVIRONMENT=0", "SONAR_TRIGGER = 12", "SONAR_TRIGGER = 13", "two functions share a pin"),
    ("-DMRL_ENVIRONMENT=1", "FAN = 7", "FAN = 8", "two functions share a pin"),
    ("-DMRL_BRIDGE=1", "BATTERY = 17", "BATTERY = 16", "two functions share a pin"),
    ("-DMRL_BRIDGE=1", "LEFT_PWM_A = 5", "LEFT_PWM_A = 19", "a pin without PWM of timer 0 or 2"),
    ("-DMRL_BRIDGE=1", "RIGHT_LOGIC = 9", "RIGHT_LOGIC = 13", "no input of a bridge may be there"),
    (
        "-DMRL_BRIDGE=1",
        "LEFT_ENCODER_B = 4",
        "LEFT_ENCODER_B = 7",
        "the left encoder's channels are on port D",
    ),
    (
        "-DMRL_BRIDGE=1",
        "RIGHT_ENCODER_A = 8",
        "RIGHT_ENCODER_A = 9",
        "the right encoder's channels are D8 and",
    ),
    ("-DMRL_BRIDGE=1", "Unit::timer0, ", "Unit::timer1, ", "two functions share a timer or an interrupt"),
]
"""Build, what pins.h says, what it says instead, the compiler's message."""


@pytest.mark.parametrize("define, right, wrong, message", WRONG_PINS)
def test_impossible_pins_fail_to_compile(tmp_path, define, right, wrong, message):
    """The conflict of 2013 is one: two functions on one pin."""
    text = (SKETCH / "pins.h").read_text()
    assert right in text
    (tmp_path / "pins.h").write_text(text.replace(right, wrong))
    command = ["g++", "-std=gnu++11", "-fsyntax-only", define, f"-I{SKETCH}", "-x", "c++"]
    assert run(*command, SKETCH / "pins.h").returncode == 0
    failed = run(*command, tmp_path / "pins.h")
    assert failed.returncode != 0 and message in failed.stderr


@pytest.mark.parametrize("other", ["-DMRL_XBEE=1", "-DMRL_ENVIRONMENT=1"])
def test_builds_that_exclude_each_other_fail_with_one_error(other):
    """An H-bridge needs the pins of the radio and of the dust sensor."""
    failed = run(
        "g++", "-std=gnu++11", "-fsyntax-only", "-DMRL_BRIDGE=1", other, "-x", "c++", SKETCH / "pins.h"
    )
    errors = [line for line in failed.stderr.splitlines() if "error:" in line]
    assert len(errors) == 1 and "set only one of the three to 1" in errors[0]


@pytest.mark.parametrize("port", ["", "/dev/nothing", "/dev/null/x"])
def test_flash_without_a_board_says_so_in_one_line(port):
    done = run("make", "-s", "flash", f"PORT={port}")
    assert done.returncode != 0
    lines = [line for line in done.stderr.splitlines() if not re.match(r"make(\[\d+\])?: \*\*\*", line)]
    assert len(lines) == 1 and lines[0].startswith("make flash:")


def test_nothing_is_built_twice():
    done = run("make", "-q", "firmware", "build/pc/libmrl_firmware.so", "build/pc/libmrl_firmware_hbridge.so")
    assert done.returncode == 0, done.stderr
