"""Compiles the harness on the user's machine.

libsimavr is under the GPL, so the package ships no binary linked with it.
"""

import os
import subprocess
from pathlib import Path

from mrl_driver import folders
from mrl_driver.errors import SimulatorError

SOURCES = Path(__file__).resolve().parent
PACKAGES = "gcc libc6-dev libsimavr-dev"
OPTIONS = "-std=gnu11 -O2 -Wall -Wextra -Wno-unused-parameter -shared -fPIC -fvisibility=hidden"
LIBRARY = "libmrl_board_{}.so"  # with the name of the chip
LONGEST_REASON = 160  # characters of compiler output in a message


class SimulatorMissing(SimulatorError):
    """The compiler or libsimavr is missing, so that the simulated chip cannot be built."""


def library_path(chip: str) -> Path:
    """Path of the harness compiled for a chip: in `build/sim/` of a checkout, else in the user's cache folder."""
    checkout = SOURCES.parent.parent
    if (checkout / "Makefile").is_file() and (checkout / "firmware").is_dir():
        return checkout / "build" / "sim" / LIBRARY.format(chip)
    return Path(folders.cache()) / LIBRARY.format(chip)


def build(library: Path, chip: str) -> Path:
    """Compiles the harness for a chip to `library`, unless this is newer than every source; returns the path.

    Several processes may do this at the same time: each compiles to its own file name and renames the file.

    Raises:
        SimulatorError: the library's folder cannot be made.
        SimulatorMissing: there is no compiler or no libsimavr; the message names the Debian packages.
    """
    if not _is_current(library):
        try:
            library.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SimulatorError(
                f"cannot make the folder {library.parent} for the simulated chip ({error.strerror}); check its path "
                "and permissions"
            ) from error
        draft = library.with_name(f"{library.name}.{os.getpid()}")
        try:
            _compile(draft, chip)
            os.replace(str(draft), str(library))
        finally:
            if draft.exists():
                draft.unlink()
    return library


def _is_current(library: Path) -> bool:
    sources = list(SOURCES.glob("*.[ch]"))
    return library.exists() and all(library.stat().st_mtime >= source.stat().st_mtime for source in sources)


def _compile(target: Path, chip: str) -> None:
    sources = sorted(str(source) for source in SOURCES.glob("*.c"))
    compiler = f"{os.environ.get('CC', 'cc')} {OPTIONS}".split()
    command = [*compiler, f'-DCHIP_HEADER="{chip}.h"', *sources, "-o", str(target), "-lsimavr", "-lm"]
    try:
        result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    except OSError as error:
        raise _missing(f"{compiler[0]}: {error.strerror}") from error
    if result.returncode:
        lines = result.stdout.decode("utf-8", "replace").splitlines()
        errors = [line for line in lines if "error" in line or "cannot find" in line]
        reason = (errors or lines or ["the compiler gave no reason"])[0]
        raise _missing(reason.strip()[:LONGEST_REASON])


def _missing(reason: str) -> SimulatorMissing:
    return SimulatorMissing(
        f"the simulated chip cannot be compiled ({reason}): on Debian, apt-get install {PACKAGES}"
    )
