"""`python -m tests.documents.tutorials [NAME...]` carries tutorials out as they are written, on emulated robots.

In a tutorial, the blocks of one kind do the same thing each time:

- `sh`: run in the tutorial's own folder; the commands must succeed.  If the paragraph before it says "Leave it
  running", it is started and the next step follows when it has printed something; it ends with the tutorial.
  If it says "End them with Ctrl-C", all that runs is ended before the step.
- `python` and `yaml`, if the paragraph before names a file: that file is written.
- `text` after `sh`: its lines must be in the output, in this order; each number may differ by 15 %, and one with a
  point by one in its last digit.
- `console`: needs hardware or a person, and is not run.
"""

import argparse
import contextlib
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Dict, Iterator, List, Sequence

from rosgraph.masterapi import is_online

from ros1_bridge.node.processes import free_port
from tests.documents.blocks import ROOT, Block, blocks
from tests.waiting import PATIENCE, wait_until

FOLDER = ROOT / "docs" / "tutorials"
RUNS_ON, ENDS = "Leave it running", "End them with Ctrl-C"
START_S, STEP_S, END_S = 30.0, 300.0, 20.0
NEED_ROS = ("navigation", "team", "environment")
NUMBER = r"(-?\d+(?:\.\d+)?(?:e-?\d+)?)"
RELATIVE = 0.15
"""Share by which a number of the output may differ from the tutorial's."""


class Failed(Exception):
    """A step did not do what the tutorial says."""


def names() -> List[str]:
    """The names of all tutorials, in their order."""
    found = (path.stem for path in FOLDER.glob("[0-9]*.md"))
    return sorted(found, key=lambda name: int(name.partition("_")[0]))


def environment(folder: Path) -> Dict[str, str]:
    """The programs of this checkout, with a home of their own and a ROS master that is not there yet."""
    return {
        **os.environ,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]),
        "HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder / ".config"),
        "XDG_DATA_HOME": str(folder / ".data"),
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
        "ROS_IP": "127.0.0.1",
        "ROS_LOG_DIR": str(folder / "log"),
        "ROS_PACKAGE_PATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("ROS_PACKAGE_PATH")))),
        "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))),
        "PYTHONUNBUFFERED": "1",
    }


def check_output(expected: str, output: str) -> None:
    """Raises Failed unless these lines are in the output in this order, with similar numbers; `...`: any lines."""
    rest = output
    for line in expected.splitlines():
        if not line.strip() or line.strip() == "...":
            continue
        parts = re.split(NUMBER, line.strip())  # text, number, text, ...
        pattern = NUMBER.join(map(re.escape, parts[::2]))
        pattern = re.sub(r"(\\ )+", " +", pattern)  # a sign takes a space of a column
        found = next((each for each in re.finditer(pattern, rest) if _near(each.groups(), parts[1::2])), None)
        if not found:
            raise Failed(f"expected {line!r}, got:\n{output}")
        rest = rest[found.end() :]


def _near(got: Sequence[str], expected: Sequence[str]) -> bool:
    return all(
        math.isclose(float(a), float(b), rel_tol=RELATIVE, abs_tol=_last_digit(b))
        for a, b in zip(got, expected)
    )


def _last_digit(number: str) -> float:
    """The value of 1 in the last digit of a number with a point; 0 for others."""
    return 10.0 ** -len(number.partition(".")[2]) if re.search(r"\.\d+$", number) else 0.0


@contextlib.contextmanager
def in_background() -> Iterator[List["subprocess.Popen[bytes]"]]:
    """Programs that are ended at the end, the last one first, with all that they have started."""
    started: List[subprocess.Popen[bytes]] = []
    try:
        yield started
    finally:
        end(started)


def end(started: List["subprocess.Popen[bytes]"]) -> None:
    """End the programs, the last one first, and empty the list."""
    while started:
        each = started.pop()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(each.pid, signal.SIGINT)
        try:
            each.wait(END_S * PATIENCE)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(each.pid, signal.SIGKILL)
            each.wait()


def start(
    block: Block, folder: Path, env: Dict[str, str], number: int, running: List["subprocess.Popen[bytes]"]
) -> None:
    """Start a step that runs on, add it to those that run, and wait for its first output."""
    log = folder / f"step{number}.log"
    with log.open("wb") as file:
        command = ["bash", "-ec", block.text]
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )
    running.append(process)
    has_master = block.text.startswith("roslaunch")

    def is_up() -> bool:
        return log.stat().st_size > 0 and (not has_master or is_online(env["ROS_MASTER_URI"]))

    with contextlib.suppress(AssertionError):
        wait_until(lambda: is_up() or process.poll() is not None, START_S)
    if process.poll() is not None or not is_up():
        raise Failed(f"step {number} ended with {process.poll()}:\n{log.read_text(errors='replace')}")


def carry_out(name: str, folder: Path) -> int:
    """Carry out a tutorial in an empty folder; returns the number of steps that were run.

    Raises:
        Failed: a step did not do what the tutorial says.
    """
    env, output, steps = environment(folder), "", 0
    with in_background() as running:
        for block in blocks(str((FOLDER / f"{name}.md").relative_to(ROOT))):
            file = re.search(r"`([\w./-]+\.(?:py|yaml))`", block.before)
            if ENDS in block.before:
                end(running)
            if block.language in ("python", "yaml") and file:
                (folder / file[1]).parent.mkdir(parents=True, exist_ok=True)
                (folder / file[1]).write_text(block.text)
            elif block.language == "text":
                check_output(block.text, output)
            elif block.language == "sh" and RUNS_ON in block.before:
                steps += 1
                start(block, folder, env, steps, running)
            elif block.language == "sh":
                steps += 1
                done = subprocess.run(
                    ["bash", "-ec", block.text],
                    cwd=folder,
                    env=env,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    timeout=STEP_S * PATIENCE,
                )
                output = done.stdout.decode(errors="replace")
                if done.returncode:
                    raise Failed(f"{block.text}\nended with {done.returncode}:\n{output}")
    return steps


def main(arguments: Sequence[str]) -> int:
    """Carry out the named tutorials, or all; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.documents.tutorials")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(names())}")
    wanted = parser.parse_args(arguments).names or names()
    failed = 0
    for name in wanted:
        if any(word in name for word in NEED_ROS) and not shutil.which("roslaunch"):
            sys.stdout.write(f"{name}: left out, because ROS is not installed\n")
            continue
        start_s = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="tutorial ä ") as folder:
            try:
                steps = carry_out(name, Path(folder))
                sys.stdout.write(f"{name}: {steps} steps passed in {time.monotonic() - start_s:.0f} s\n")
            except (Failed, subprocess.TimeoutExpired) as error:
                failed += 1
                sys.stdout.write(f"{name}: {error}\n")
        sys.stdout.flush()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
