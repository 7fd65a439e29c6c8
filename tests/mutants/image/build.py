"""Images with one changed hal_*_avr.cpp: make builds the usual ones, then one object is compiled and linked."""

import subprocess
from pathlib import Path
from typing import Dict, List, Sequence, Tuple

from sim_arduino.avr.elf import read_image
from tests.mutants.cpp.build import FIRMWARE, ROOT

BUILD = ROOT / "build" / "mutants-image"
BASE = BUILD / "base"
EVERY = ("mrl_firmware", "mrl_firmware_hbridge", "mrl_firmware_xbee", "mrl_firmware_environment")
IMAGES: Dict[str, Sequence[str]] = {
    "hal_avr.cpp": EVERY,
    "hal_bridge_avr.cpp": ("mrl_firmware_hbridge",),
    "hal_bus_avr.cpp": EVERY,
    "hal_dust_avr.cpp": ("mrl_firmware_environment",),
    "hal_radio_avr.cpp": ("mrl_firmware_xbee",),
}
"""The images that each source is in, the one whose tests come first in front."""

Flash = List[Tuple[int, bytes]]


class DoesNotCompile(Exception):
    """The compiler or the linker refuses a mutant."""


class Images:
    """The usual images, and the commands with which make has built them."""

    def __init__(self) -> None:
        """Builds what has changed.

        Raises:
            RuntimeError: make fails, or the same source does not give the same image.
        """
        make = ["nice", "-n", "10", "make", "-s", "firmware", f"FW_BUILD={BASE.relative_to(ROOT)}"]
        _run(make)
        listed = _run([*make, "-n", "-B"]).splitlines()
        self._commands = [line for line in listed if line.startswith(("avr-g++ ", "avr-gcc "))]
        self.flash = {name: flash_of(self.path(name)) for name in EVERY}
        same = FIRMWARE / "hal_dust_avr.cpp"
        image = self.with_source("mrl_firmware_environment", same.name, same.read_text(), BUILD / "same")
        if flash_of(image) != self.flash["mrl_firmware_environment"]:
            raise RuntimeError(f"{image} differs from the image that make has built")

    def path(self, name: str) -> Path:
        """A usual image."""
        return BASE / f"{name}.elf"

    def with_source(self, name: str, source: str, text: str, folder: Path) -> Path:
        """Builds an image with another text of one source in a folder; its path.

        Raises:
            DoesNotCompile: the compiler or the linker refuses it.
        """
        folder.mkdir(parents=True, exist_ok=True)
        changed, made, image = folder / source, folder / f"{name}.o", folder / f"{name}.elf"
        changed.write_text(text)
        usual = f"{BASE.relative_to(ROOT)}/{name}.o/{source}.o"
        compiled = self._command(f"-o {usual}").replace(usual, str(made))
        compiled = compiled.replace(f"firmware/mrl_firmware/{source}", f"-iquote {FIRMWARE} {changed}")
        linked = self._command(f"-o {BASE.relative_to(ROOT)}/{name}.elf.new").replace(usual, str(made))
        linked = linked.replace(f"{BASE.relative_to(ROOT)}/{name}.elf.new", str(image))
        for command in (compiled.replace("-Werror", "-w"), linked):
            done = subprocess.run(command.split(), cwd=str(ROOT), capture_output=True, text=True)
            if done.returncode:
                raise DoesNotCompile(done.stderr)
        return image

    def _command(self, end: str) -> str:
        (command,) = (each for each in self._commands if each.endswith(end))
        return command


def flash_of(image: Path) -> Flash:
    """What an image writes to the chip's flash."""
    return list(read_image(image).flash)


def _run(command: List[str]) -> str:
    done = subprocess.run(command, cwd=str(ROOT), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout
