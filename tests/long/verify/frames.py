"""`python -m tests.long.verify.frames` visits all states of the firmware's decoder and writer of frames.

The figures go to build/verify/frames.json and build/bench/verify.json.  If cbmc is there, it proves the decoder, too.
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import time
from typing import Dict, List, Optional, Sequence, Tuple

from tests.long.bench import report
from tests.long.bench.figures import ROOT

BUILD = ROOT / "build" / "verify"
SOURCE = ROOT / "firmware" / "mrl_firmware"
HERE = ROOT / "tests" / "long" / "verify"
SANITIZERS = ("-O2", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
QUICK = ("-O2", "-fsanitize=undefined", "-fno-sanitize-recover=all")
"""For the defects: the address sanitizer takes most of the time."""
SHORT = "10"
"""Longest frame of the short form [byte]."""

Edit = Tuple[str, str, str]
"""A file of the firmware, what stands there, and what takes its place."""

DEFECTS: Tuple[Edit, ...] = (
    ("frame_decoder.cpp", "length_ >= MAX_FRAME", "length_ > MAX_FRAME"),
    ("frame_decoder.cpp", "length_ >= MAX_NOISE", "length_ > MAX_NOISE"),
    ("frame_decoder.cpp", "tokens_ <= MAX_ARGUMENTS", "tokens_ <= MAX_ARGUMENTS + 2"),
    ("frame_decoder.cpp", "tokens_ > MAX_ARGUMENTS + 1", "tokens_ > MAX_ARGUMENTS + 2"),
    ("frame_decoder.cpp", "  refused_ = false;\n", ""),
    ("frame_decoder.cpp", "'@');\n  begin_token();", "'@');"),
    ("frame_decoder.cpp", "magnitude_ == 3276 && digit > 8", "magnitude_ == 3276 && digit > 9"),
    ("frame_decoder.cpp", "magnitude_ > 32767 && !negative_", "magnitude_ > 32768"),
    ("frame_decoder.cpp", "(digits_ > 1 || negative_)", "digits_ > 1"),
    ("frame_decoder.cpp", "'-' && !digits_ && !negative_", "'-' && !digits_"),
    ("frame_decoder.cpp", "    crc_at_comma_ = crc_;\n", ""),
    ("frame_decoder.cpp", "code == STOP_CODE || ", ""),
    ("frame_decoder.cpp", "args[i] > flash_int16(&range->high)", "args[i] > flash_int16(&range->high) + 1"),
    ("frame_decoder.cpp", " && plain_calibrate", ""),
    ("frame_decoder.cpp", "plain_calibrate && !asked", "plain_calibrate"),
    ("frame_decoder.cpp", "guarded == ONCE_ASKED && asked", "guarded == ONCE_ASKED && checked"),
    ("frame_writer.cpp", "hal::serial_room() >= NUMBER_BYTES", "hal::serial_room() >= NUMBER_BYTES - 2"),
    ("frame_writer.cpp", "sent < count || hal::serial_room() < END_BYTES", "sent < count"),
    ("frame_writer.cpp", "  comma_out = false;\n  step = Step::open;", "  step = Step::open;"),
    ("frame_writer.cpp", "  frame_checked = check_on;\n", "  frame_checked = frame_checked || check_on;\n"),
    ("frame_writer.cpp", "if (step != Step::idle || hal::serial_room()", "if (hal::serial_room()"),
    ("frame_writer.cpp", "    if (hal::serial_received()) return;\n", ""),
    ("frame_writer.cpp", "  crc = CRC_START;\n", ""),
)
"""Each is noticed by the search."""

FOUND_BY_CBMC = (0, 1, 4, 5, 11)
"""Defects that break what cbmc proves.  It does not notice an index beyond an array in a class; the sanitizers do."""
FOR_CBMC = (
    (
        r"constexpr uint\d+_t (\w+) = (\w+);",
        r"enum { \1 = \2 };",
    ),  # it takes no constexpr for the size of an array
    (r"\nnamespace \{\n", "\n"),  # "unique namespace not supported yet"
    (r"\n\}  // namespace\n", "\n"),
)
PROOF = "cbmc --cpp11 --unwind 20 --unwinding-assertions"


def compile_search(name: str, edit: Optional[Edit] = None, flags: Sequence[str] = SANITIZERS) -> pathlib.Path:
    """Compile the search with the firmware's sources, or with one of them edited; return the program."""
    folder = BUILD / name
    folder.mkdir(parents=True, exist_ok=True)
    places = [f"-I{SOURCE}"]
    if edit:
        file, old, new = edit
        text = (SOURCE / file).read_text()
        if text.count(old) != 1:
            raise ValueError(f"{file} has {text.count(old)} times {old!r}, expected once")
        (folder / file).write_text(text.replace(old, new))
        places.insert(0, f"-I{folder}")
    program = folder / "frames"
    command = ["g++", "-std=gnu++14", "-Wall", "-Wextra", *flags, *places, str(HERE / "frames.cpp")]
    subprocess.run([*command, "-o", str(program)], check=True, timeout=300)
    return program


def search(program: pathlib.Path, part: str = "") -> Tuple[bool, str]:
    """Run the search, or the part that its argument names; return whether nothing is wrong, and its output."""
    command = [str(program), *([part] if part else [])]
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, timeout=3600
    )
    return done.returncode == 0, done.stdout.decode("utf-8", "replace")


def prove(edit: Optional[Edit] = None) -> Tuple[bool, str]:
    """Let cbmc prove the decoder, whose sources it gets in a form that it reads."""
    folder = BUILD / "cbmc"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("protocol.h", "crc.h", "flash.h", "frame_decoder.h", "frame_decoder.cpp"):
        text = (SOURCE / name).read_text()
        if edit and edit[0] == name:
            text = text.replace(edit[1], edit[2])
        for old, new in FOR_CBMC:
            text = re.sub(old, new, text)
        (folder / name).write_text(text)
    command = [*PROOF.split(), f"-I{folder}", str(HERE / "frames_cbmc.cpp")]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, timeout=600)
    return done.returncode == 0, done.stdout.decode("utf-8", "replace")


def main() -> int:
    """Run the search and the defects; the exit code is 0 if nothing is wrong and each defect is noticed."""
    rows: List[Dict[str, object]] = []

    def note(what: str, good: bool, text: str, start: float) -> bool:
        seconds = time.monotonic() - start
        print(f"{what}: {'as expected' if good else 'NOT AS EXPECTED'}, {seconds:.1f} s\n{text}", flush=True)
        rows.append({"what": what, "good": good, "output": text, "seconds": round(seconds, 1)})
        return good

    start = time.monotonic()
    flags, longest = report.either((SANITIZERS, ""), (("-O0",), SHORT))
    right, text = search(compile_search("frames", flags=flags), longest)
    good = note("all states, with sanitizers", right, text, start)
    for number, edit in enumerate(report.either(DEFECTS, DEFECTS[-1:])):
        start = time.monotonic()
        part = "writer" if edit[0] == "frame_writer.cpp" else ""
        right, text = search(
            compile_search(f"frames_defect{number}", edit, report.either(QUICK, flags)), part
        )
        lines = [
            line for line in text.splitlines() if "wrong:" in line or "error:" in line or "Error" in line
        ]
        good = (
            note(
                f"defect {edit[1].strip()!r} -> {edit[2].strip()!r}",
                not right,
                "  " + lines[0] if lines else text,
                start,
            )
            and good
        )
    if report.FAST:
        print("FAST=1: short frames, one defect, and no proof")
    elif shutil.which("cbmc"):
        start = time.monotonic()
        right, text = prove()
        good = note("cbmc", right, text[-60:], start) and good
        for edit in (DEFECTS[i] for i in FOUND_BY_CBMC):
            start = time.monotonic()
            right, text = prove(edit)
            good = note(f"cbmc, defect {edit[1]!r}", not right, text[-60:], start) and good
    else:
        print("cbmc is not installed (Debian 13 has it); the proof is left out")
    (BUILD / "frames.json").write_text(json.dumps(rows, indent=1) + "\n")
    report.conclude(
        "verify", {"frames_runs": len(rows), "frames_not_expected": sum(not row["good"] for row in rows)}
    )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
