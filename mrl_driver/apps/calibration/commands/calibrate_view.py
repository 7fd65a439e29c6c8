"""Questions and output of a calibration at the terminal."""

import math
import sys
from typing import Any, Callable, Dict, Mapping, Optional, Sequence, Tuple

import numpy as np
from rich.console import Console
from rich.prompt import Confirm, Prompt
from rich.table import Table
from rich.text import Text

from mrl_driver.apps.calibration.calibration_files import Key
from mrl_driver.apps.calibration.geometry_procedures import NOT_MEASURED, Outcome
from mrl_driver.apps.calibration.ground_truth import Check, Ruler, Truth, parse_pose, truth_file
from mrl_driver.apps.calibration.wiring_check import LEAST_RAD, seen_in
from mrl_driver.apps.calibration.wiring_procedures import Witness
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot.models import RobotModel

console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True)
"""Prompts and progress go to stderr, results to stdout."""


class ByHand:
    """A ruler that asks the user to measure.

    Args:
        mark: what to do before a run.
        question: what to answer after it.
        parse: gives the pose of an answer.
        kept: what the user should know before Ctrl-C.
        answer: answer for only Enter; None if there must be one.
    """

    def __init__(
        self, mark: str, question: str, parse: Callable[[str], Pose], kept: str, answer: Optional[str] = None
    ) -> None:
        self._mark, self._question, self._parse, self._kept = mark, Text(question), parse, kept
        self._default: Dict[str, Any] = {} if answer is None else {"default": answer, "show_default": False}

    def begin(self, run: str) -> None:
        """Ask for the mark on the floor."""
        console.print(f"\n{run}", style="bold")
        console.print(f"{self._mark} on the floor, and clear its path.")
        Prompt.ask(Text("Press Enter to drive"), console=console, default="", show_default=False)

    def end(self, run: str, check: Check) -> Pose:
        """Ask until the answer is plausible; the robot may be turned by hand before the answer."""
        while True:
            text = Prompt.ask(self._question, console=console, **self._default)
            try:
                pose = self._parse(text)
                check(pose)
                return pose
            except ConfigError as error:
                console.print(f"{error}; measure again, or end with Ctrl-C{self._kept}")


TAPE_MEASURE = ByHand(
    "Mark the robot's position and heading",
    "Measure from the mark: x y [m], and the heading [deg] if you can",
    parse_pose,
    ": earlier runs are kept",
)


def _heading(text: str) -> Pose:
    """Parse a heading [deg]; return it as a pose without a position, in (-pi, pi]."""
    try:
        heading_rad = wrap_angle(math.radians(float(text)))
    except ValueError:
        heading_rad = math.nan
    if math.isnan(heading_rad):
        raise ConfigError(f"got {text!r}, expected a heading in degrees, such as -1.5, or only Enter")
    return NOT_MEASURED._replace(yaw_rad=heading_rad)


HEADING_MARK = ByHand(
    "Align a side of the robot with a straight line",
    "Turn the robot slowly by hand until the same side lies along the line again, and press Enter; or type its heading "
    "[deg], counter-clockwise from the start",
    _heading,
    "",
    answer="0",
)


def require_terminal(instead: str) -> None:
    """Raise ConfigError if stdin is not a terminal."""
    if not sys.stdin.isatty():
        raise ConfigError(f"stdin is not a terminal; give {instead}")


def ruler_for(truth: Optional[str], heading_only: bool = False) -> Ruler:
    """Return a ruler: the emulator's ground truth, or a user with a tape or a line on the floor."""
    if truth is not None:
        return Truth(truth_file(truth), console.print)
    if heading_only:
        require_terminal("--truth FILE for an emulated robot")
        return HEADING_MARK
    require_terminal("--truth FILE for an emulated robot, or --run FILE:X,Y,HEADING for recordings")
    return TAPE_MEASURE


def unmeasured() -> Ruler:
    """Return a ruler for runs without a measurement."""
    return Truth(lambda: NOT_MEASURED, console.print)


class SeenByTruth(Witness):
    """The witness of an emulated robot: its true motion."""

    def turned(self, motor: str, expected: Optional[str], moved: Pose) -> Tuple[Optional[str], int]:
        """Return the wheel that explains the motion, and its direction."""
        return seen_in(moved.x_m, moved.yaw_rad)

    def turned_right(self, moved: Pose) -> bool:
        """Return whether the robot turned to the right."""
        return moved.yaw_rad < -LEAST_RAD


class SeenByUser(Witness):
    """A user at the terminal, or words that were given before as `answers`; `more` are words for a wheel."""

    def __init__(self, answers: Optional[str] = None, more: Sequence[str] = ()) -> None:
        self._answers = None if answers is None else [word.strip() for word in answers.split(",")]
        self._more = more

    def turned(self, motor: str, expected: Optional[str], moved: Pose) -> Tuple[Optional[str], int]:
        """Ask which wheel turned, if both are possible, and in which direction."""
        wheel = expected or self._ask("Which wheel turned", ["left", "right", "none", *self._more])
        if wheel == "none":
            return motor, 0
        if wheel == "unseen":
            return None, 0
        words = f"In which direction did the {wheel} wheel turn"
        direction = self._ask(words, ["forward", "back", "none"])
        return wheel, {"forward": 1, "back": -1, "none": 0}[direction]

    def turned_right(self, moved: Pose) -> bool:
        """Ask whether the wheels turned as they would in a right turn."""
        return self._ask("Did the left wheel turn forward, and the right one back", ["yes", "no"]) == "yes"

    def _ask(self, question: str, choices: Sequence[str]) -> str:
        if self._answers is None:
            return Prompt.ask(Text(question), console=console, choices=list(choices))
        answer = self._answers.pop(0) if self._answers else "nothing"
        if answer not in choices:
            raise ConfigError(
                f"--answers has {answer} for the question: {question}? expected {', '.join(choices)}"
            )
        return answer


def confirm_here(question: str, yes: bool) -> bool:
    """Ask at the terminal; with `yes` return True without asking; without a terminal return False."""
    if yes:
        return True
    return sys.stdin.isatty() and Confirm.ask(Text(question), console=console)


_THESIS = {"wheel_offset": " (Cm)", "turn_slip": " (Cs)"}  # names in (Araujo 2012)


def show_values(model: RobotModel, values: Mapping[Key, float]) -> None:
    """Print the values of the robot's file, before and after."""
    table = Table(box=None, pad_edge=False, show_edge=False)
    for name, justify in (("parameter", "left"), ("before", "right"), ("after", "right")):
        table.add_column(name, justify=justify)  # type: ignore[arg-type]
    for (section, name), value in values.items():
        part = getattr(model, section)
        before = part.get(name) if isinstance(part, dict) else getattr(part, name)
        table.add_row(f"{section}.{name}{_THESIS.get(name, '')}", _shown(before), _shown(value))
    Console(highlight=False, width=100).print(table)


def _shown(value: Optional[float]) -> str:
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.7g}"


def outcome_lines(outcome: Outcome) -> Sequence[str]:
    """Return lines about the errors of the runs, before and after."""
    lines = []
    for name, errors in (("before", outcome.errors_before), ("after", outcome.errors_after)):
        off_m, yaw = np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])
        turned = (
            f"{math.degrees(np.nanmax(yaw)):.2f} deg" if np.isfinite(yaw).any() else "heading not measured"
        )
        lines.append(
            f"end errors {name}: mean {off_m.mean() * 1000:.1f} mm, worst {off_m.max() * 1000:.1f} mm, {turned}"
        )
    if outcome.after.metres_per_count != outcome.before.metres_per_count:
        before, after = (1 / drive.metres_per_count for drive in (outcome.before, outcome.after))
        lines.append(f"counts per metre: {before:.1f} before, {after:.1f} after")
    if outcome.square is not None:
        square = outcome.square
        lines.append(
            f"UMBmark: E_d {square.wheel_ratio:.5f}, E_b {square.wheelbase_ratio:.5f}, type A "
            f"{math.degrees(square.corner_excess_rad):.2f} deg per corner, type B "
            f"{math.degrees(square.side_bend_rad):.2f} deg per side, E_max {square.worst_m * 1000:.1f} mm"
        )
    return lines


def facts_of(outcome: Outcome) -> Dict[str, Any]:
    """Return the facts of an outcome as a mapping, for JSON."""
    facts: Dict[str, Any] = {
        "runs": len(outcome.errors_before),
        "drive_before": outcome.before._asdict(),
        "drive_after": outcome.after._asdict(),
        "errors_before_m_rad": outcome.errors_before.tolist(),
        "errors_after_m_rad": outcome.errors_after.tolist(),
        "noise": dict(outcome.noise),
    }
    if outcome.square is not None:
        facts["umbmark"] = outcome.square._asdict()
    return facts
