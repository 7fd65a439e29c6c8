"""`python -m tests.documents.live_view_picture FILE.svg` makes the animation of the live view in docs/command_line.md.

The real firmware binary drives an emulated TraxBot along a square of 1 m in simulated time, and the live view of `make
run` shows it: its still pictures, one every `STEP_S`, follow each other in one SVG.  It needs `make firmware`.
"""

import io
import re
import sys
from pathlib import Path
from typing import List, Sequence

from rich.console import Console

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.navigation.line_follower import Square
from mrl_driver.terminal.live_panels import render
from mrl_driver.terminal.live_view import Screen, Settings
from sim_arduino.serve import factory
from tests.long.bench.report import either

WIDTH, HEIGHT = 100, 30
STEP_S, CONTROL_S, SHOWN_S = 2.0, 0.05, 0.7
"""Simulated time between two pictures, and between two commands; time for which each picture is shown [s]."""
CORNERS, MOST = 4, either(24, 2)


def still(screen: Screen, now_s: float, name: str) -> str:
    """One picture of the live view as SVG; `name` makes its styles its own."""
    console = Console(file=io.StringIO(), width=WIDTH, height=HEIGHT, record=True, force_terminal=True)
    console.print(render(screen.content(now_s), WIDTH, HEIGHT))
    return console.export_svg(title="make run", unique_id=name)


def stills(engine: str) -> List[str]:
    """The pictures of one lap."""
    emulated = factory.make(factory.Options(robot="traxbot", engine=engine, world="square"))
    found: List[str] = []
    try:
        with SteppedDriver(emulated.engine, options=Options(command_timeout_s=None)) as robot:
            screen = Screen(robot, Settings("/dev/ttyACM0"), None, clock=lambda: robot.now_s)
            square, shown_s = Square(), robot.now_s
            while square.corner < CORNERS and len(found) < MOST:
                robot.drive(*square.command(robot.pose))
                robot.wait(CONTROL_S)
                screen.shown(robot.now_s)
                if robot.now_s >= shown_s:
                    found.append(still(screen, robot.now_s, f"f{len(found)}"))
                    shown_s += STEP_S
    finally:
        emulated.close()
    return found


def animation(pictures: Sequence[str]) -> str:
    """One SVG that shows the pictures one after the other, without end; a program without animations shows the last."""
    match = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', pictures[0])
    assert match
    width, height = match.groups()
    length_s, share = len(pictures) * SHOWN_S, 100 / len(pictures)
    lines = [f'<svg viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">', "<style>"]
    lines.append(
        f"@keyframes show {{ 0%, {share:.3f}% {{ opacity: 1 }} {share + 0.001:.3f}%, 100% {{ opacity: 0 }} }}"
    )
    lines.append(f".still {{ opacity: 0; animation: show {length_s:.1f}s step-end infinite }}")
    lines.append(".still:last-of-type { opacity: 1 }\n</style>")
    for number, picture in enumerate(pictures):
        body = re.sub(r"<svg [^>]*>", f'<svg viewBox="0 0 {width} {height}">', picture, count=1)
        lines.append(
            f'<g class="still" style="animation-delay: {number * SHOWN_S - length_s:.1f}s">{body.strip()}</g>'
        )
    text = "\n".join([*lines, "</svg>"])
    return re.sub(r"\n\s+", "\n", re.sub(r"@font-face \{.*?\}", "", text, flags=re.S)) + "\n"


def main(arguments: Sequence[str]) -> int:
    """Make the animation; returns the exit code."""
    if len(arguments) != 1:
        sys.stderr.write("expected the name of an .svg file\n")
        return 2
    Path(arguments[0]).write_text(animation(stills("avr")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
