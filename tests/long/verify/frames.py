"""`python -m tests.long.verify.frames` visits all states of the firmware's decoder and writer of frames.

The results are in build/verify/frames.json, the figures in build/bench/verify.json.
"""

import json
import pathlib
import re
import subprocess
import sys
from typing import Dict, List, Optional, Sequence, Tuple

from tests.long.bench import report
from tests.long.bench.figures import ROOT
from tests.long.verify.edits import Edit, sketch

BUILD = ROOT / "build" / "verify"
HERE = ROOT / "tests" / "long" / "verify"
SANITIZERS = ("-O2", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
QUICK = ("-O2", "-fsanitize=undefined", "-fno-sanitize-recover=all")
"""For the defects: the address sanitizer takes most of the time."""
SHORT = "10"  # Longest frame of the short form [byte]

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


def compile_search(name: str, edit: Optional[Edit] = None, flags: Sequence[str] = SANITIZERS) -> pathlib.Path:
    """Compile the search with the firmware's sources, or with one of them edited; return the program."""
    folder = BUILD / name
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / "frames"
    include = f"-I{sketch(folder, edit)}"
    command = ["g++", "-std=gnu++14", "-Wall", "-Wextra", *flags, include, str(HERE / "frames.cpp")]
    subprocess.run([*command, "-o", str(program)], check=True, timeout=300)
    return program


def search(program: pathlib.Path, part: str = "") -> Tuple[bool, str]:
    """Run the search, or the part that its argument names; return whether nothing is wrong, and its output."""
    command = [str(program), *([part] if part else [])]
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, timeout=3600
    )
    return done.returncode == 0, done.stdout.decode("utf-8", "replace")


def main() -> int:
    """Run the search and the defects; the exit code is 0 if nothing is wrong and each defect is noticed."""
    rows: List[Dict[str, object]] = []

    def note(what: str, found: Tuple[bool, str], expected: bool) -> None:
        right, text = found
        lines = [line for line in text.splitlines() if expected or re.search("wrong:|[eE]rror", line)]
        good = right == expected
        print(f"{what}: {'as expected' if good else 'NOT AS EXPECTED'}", *lines[:3], sep="\n  ", flush=True)
        rows.append({"what": what, "good": good, "output": text})

    flags, longest = report.either((SANITIZERS, ""), (("-O0",), SHORT))
    note("all states, with sanitizers", search(compile_search("frames", flags=flags), longest), True)
    for number, edit in enumerate(report.either(DEFECTS, DEFECTS[-1:])):
        program = compile_search(f"frames_defect{number}", edit, report.either(QUICK, flags))
        part = "writer" if edit[0] == "frame_writer.cpp" else ""
        note(f"defect {edit[1].strip()!r} -> {edit[2].strip()!r}", search(program, part), False)
    (BUILD / "frames.json").write_text(json.dumps(rows, indent=1) + "\n")
    wrong = sum(not row["good"] for row in rows)
    report.conclude("verify", {"frames_runs": len(rows), "frames_not_expected": wrong})
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
