"""Builds the firmware for the PC with all of its mutants in it."""

import hashlib
import json
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Dict, List, Sequence

from tests.mutants.cpp.schemata import Finder, Mutant, syntax_tree

ROOT = Path(__file__).resolve().parents[3]
FIRMWARE = ROOT / "firmware" / "mrl_firmware"
HAL = [ROOT / "tests" / "firmware" / name for name in ("hal_pc.cpp", "hal_bridge_pc.cpp", "wheel_pc.cpp")]
HAL_HEADERS = [ROOT / "tests" / "firmware" / name for name in ("hal_pc.h", "hal_bridge_pc.h")]
HERE = Path(__file__).resolve().parent
BUILD = ROOT / "build" / "mutants" / "cpp"
BUILDS = {
    "": (),
    "_environment": ("-DMRL_ENVIRONMENT=1",),
    "_xbee": ("-DMRL_XBEE=1",),
    "_hbridge": ("-DMRL_BRIDGE=1",),
}
"""What is behind the name of the library, and its defines."""
COMPILE = ("g++", "-std=gnu++11", "-O1", "-w", "-fPIC")

SAFETY = (
    "failsafe.cpp",
    "hold.cpp",
    "motion.cpp",
    "motor_omni3md.cpp",
    "omni3md_message.h",
    "omni3md_queue.h",
    "omni3md_set_up.cpp",
    "motor_bridge.cpp",
    "bridge.cpp",
    "wheel.cpp",
    "wheel.h",
    "wheel_watch.cpp",
    "wheel_settings.cpp",
    "speed_estimate.cpp",
    "speed_estimate.h",
    "encoder_counter.cpp",
    "encoder_counter.h",
    "ceiling.cpp",
)
OTHERS = (
    "frame_decoder.cpp",
    "frame_decoder.h",
    "frame_writer.cpp",
    "config.cpp",
    "commands.cpp",
    "bus.cpp",
    "status.cpp",
)


def fingerprint(paths: Sequence[Path]) -> str:
    """Changes when one of the files does."""
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def made_of() -> str:
    """The fingerprint of everything that the libraries are made of."""
    firmware = [*FIRMWARE.glob("*.cpp"), *FIRMWARE.glob("*.h")]
    return fingerprint([*firmware, *HAL, *HAL_HEADERS, *HERE.glob("mutant.*"), HERE / "schemata.py"])


def build() -> List[Mutant]:
    """Builds the libraries if something has changed; all mutants.

    Raises:
        RuntimeError: a compiler does not accept a source.
    """
    made, listed = made_of(), BUILD / "mutants.json"
    if listed.exists():
        known = json.loads(listed.read_text())
        if known["made_of"] == made:
            return [_mutant(each) for each in known["mutants"]]
    BUILD.mkdir(parents=True, exist_ok=True)
    if listed.exists():
        listed.unlink()
    mutants = _write_sources()
    with ThreadPoolExecutor(2) as pool:
        for done in [pool.submit(_library, name, defines) for name, defines in BUILDS.items()]:
            done.result()
    listed.write_text(json.dumps({"made_of": made, "mutants": [asdict(each) for each in mutants]}))
    return mutants


def _mutant(fields: Dict) -> Mutant:
    return Mutant(**{**fields, "numbers": tuple(fields["numbers"])})


def _write_sources() -> List[Mutant]:
    source = BUILD / "source"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    for path in [*FIRMWARE.glob("*.cpp"), *FIRMWARE.glob("*.h")]:
        if not path.name.endswith("_avr.cpp"):
            shutil.copy(path, source)
    shutil.copy(HERE / "mutant.h", source)
    mutants: List[Mutant] = []
    for name in SAFETY + OTHERS:
        finder = Finder(f"firmware/mrl_firmware/{name}", FIRMWARE / name)
        for defines in BUILDS.values():
            finder.look(syntax_tree(FIRMWARE / name, defines))
        text, found = finder.source(len(mutants))
        (source / name).write_text('#include "mutant.h"\n' + text)
        mutants += found
    return mutants


def _library(suffix: str, defines: Sequence[str]) -> None:
    objects = BUILD / f"objects{suffix}"
    objects.mkdir(exist_ok=True)
    made = []
    source = BUILD / "source"
    for path in [*sorted(source.glob("*.cpp")), *HAL, HERE / "mutant.cpp"]:
        made.append(objects / f"{path.stem}.o")
        _run([*COMPILE, *defines, f"-I{source}", "-c", str(path), "-o", str(made[-1])])
    _run(["g++", "-shared", "-o", str(BUILD / f"libmrl_firmware{suffix}.so"), *map(str, made)])


def _run(command: List[str]) -> None:
    done = subprocess.run(["nice", "-n", "10", *command], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
