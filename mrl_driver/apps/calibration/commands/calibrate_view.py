"""Questions and output of a calibration at the terminal."""

import math
import sys
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple

import numpy as np
from rich.console import Console
from rich.prompt import Confirm, Prompt
from rich.table import Table
from rich.text import Text

from mrl_driver.apps.calibration.calibration_files import Key
from mrl_driver.apps.calibration.gains import Response
from mrl_driver.apps.calibration.geometry_procedures import Outcome
from mrl_driver.apps.calibration.ground_truth import Check, Ruler, Truth, parse_pose, truth_file
from mrl_driver.apps.calibration.wiring_check import LEAST_RAD, seen_in
from mrl_driver.errors import ConfigError, WheelFault
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot.models import RobotModel

console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True)
"""Prompts and progress go to stderr, results to stdout."""
MEASURED = Text("Measure from the mark: x y [m], and the heading [deg] if you can")

ALIGNED = Text(
    "Turn the robot slowly by hand until the same side lies along the line again, and press Enter; or type its heading "
    "[deg], counter-clockwise from the start"
)


class TapeMeasure:
    """A ruler that asks the user to measure with a tape."""

    def begin(self, run: str) -> None:
        """Ask for the mark on the floor."""
        console.print(f"\n{run}", style="bold")
        console.print("Mark the robot's position and heading on the floor, and clear its path.")
        Prompt.ask(Text("Press Enter to drive"), console=console, default="", show_default=False)

    def end(self, run: str, check: Check) -> Pose:
        """Ask for the robot's position until the answer is plausible."""
        while True:
            text = Prompt.ask(MEASURED, console=console)
            try:
                pose = parse_pose(text)
                check(pose)
                return pose
            except ConfigError as error:
                console.print(f"{error}; measure again, or end with Ctrl-C: earlier runs are kept")


class HeadingMark:
    """A ruler that asks the user to align the robot with a line, or for its heading; it measures no position."""

    def begin(self, run: str) -> None:
        """Ask for the line."""
        console.print(f"\n{run}", style="bold")
        console.print("Align a side of the robot with a straight line on the floor, and clear its path.")
        Prompt.ask(Text("Press Enter to drive"), console=console, default="", show_default=False)

    def end(self, run: str, check: Check) -> Pose:
        """Ask until the answer is plausible; the robot may be turned by hand before the answer."""
        while True:
            text = Prompt.ask(ALIGNED, console=console, default="0", show_default=False)
            try:
                pose = Pose(math.nan, math.nan, _heading(text))
                check(pose)
                return pose
            except ConfigError as error:
                console.print(f"{error}; measure again, or end with Ctrl-C")


def _heading(text: str) -> float:
    """Parse a heading [deg]; return it in (-pi, pi]."""
    try:
        heading_rad = wrap_angle(math.radians(float(text)))
    except ValueError:
        heading_rad = math.nan
    if math.isnan(heading_rad):
        raise ConfigError(f"got {text!r}, expected a heading in degrees, such as -1.5, or only Enter")
    return heading_rad


class Unmeasured:
    """A ruler for runs without a measurement."""

    def begin(self, run: str) -> None:
        """Only announce the run."""
        console.print(f"{run}")

    def end(self, run: str, check: Check) -> Pose:
        """Return NaN: nothing is measured."""
        return Pose(math.nan, math.nan, math.nan)


class _AnnouncedTruth(Truth):
    """Also announces each run."""

    def begin(self, run: str) -> None:
        console.print(run)
        super().begin(run)


def require_terminal(instead: str) -> None:
    """Raise ConfigError if stdin is not a terminal."""
    if not sys.stdin.isatty():
        raise ConfigError(f"stdin is not a terminal; give {instead}")


def ruler_for(truth: Optional[str], heading_only: bool = False) -> Ruler:
    """Return a ruler: the emulator's ground truth, or a user with a tape or a line on the floor.

    Raises:
        ConfigError: there is neither.
    """
    if truth is not None:
        return _AnnouncedTruth(truth_file(truth))
    if heading_only:
        require_terminal("--truth FILE for an emulated robot")
        return HeadingMark()
    require_terminal("--truth FILE for an emulated robot, or --run FILE:X,Y,HEADING for recordings")
    return TapeMeasure()


def observer_for(truth: Optional[str], unseen: bool) -> Any:
    """Return the function that finds which wheel turned: unknown, from the ground truth, or by asking the user."""
    if unseen:
        return lambda motor, pose: (None, 0)
    if truth is not None:
        return lambda motor, pose: seen_in(pose.x_m, pose.yaw_rad)
    return _ask_wheel


def _ask_wheel(motor: str, _: Pose) -> Tuple[Optional[str], int]:
    wheel = Prompt.ask(
        Text("Which wheel turned"), console=console, choices=["left", "right", "none", "unseen"]
    )
    if wheel == "unseen":
        return None, 0
    if wheel == "none":
        return motor, 0
    forward = Prompt.ask(Text("In which direction"), console=console, choices=["forward", "back"])
    return wheel, 1 if forward == "forward" else -1


class SeenByTruth:
    """The witness of an emulated robot: its true motion."""

    def turned(self, output: str, expected: Optional[str], moved: Pose) -> Tuple[str, int]:
        """Return the wheel that explains the motion, and its direction."""
        wheel, direction = seen_in(moved.x_m, moved.yaw_rad)
        if not direction or wheel is None:
            raise no_wheel(output)
        return wheel, direction

    def turned_right(self, moved: Pose) -> bool:
        """Return whether the robot turned to the right."""
        return moved.yaw_rad < -LEAST_RAD


class SeenByUser:
    """A user at the terminal, or words that were given before as `answers`."""

    def __init__(self, answers: Optional[str]) -> None:
        self._answers = None if answers is None else [word.strip() for word in answers.split(",")]

    def turned(self, output: str, expected: Optional[str], moved: Pose) -> Tuple[str, int]:
        """Ask which wheel turned, if both are possible, and in which direction."""
        wheel = expected or self._ask("Which wheel turned", ["left", "right", "none"])
        words = f"In which direction did the {wheel} wheel turn"
        direction = "none" if wheel == "none" else self._ask(words, ["forward", "back", "none"])
        if direction == "none":
            raise no_wheel(output)
        return wheel, 1 if direction == "forward" else -1

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


def no_wheel(output: str) -> WheelFault:
    """Return the error for a motor output that turned no wheel."""
    return WheelFault(
        f"no wheel turned when the {output} motor output was driven, expected one: check the battery, the motor's "
        "wires, and that --bridge names the right chip"
    )


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
        table.add_row(
            f"{section}.{name}{_THESIS.get(name, '')}",
            number(value_of(model, (section, name))),
            number(value),
        )
    Console(highlight=False, width=100).print(table)


def value_of(model: RobotModel, key: Key) -> Optional[float]:
    """Return the model's present value; None if it has none."""
    part = getattr(model, key[0])
    return part.get(key[1]) if isinstance(part, dict) else getattr(part, key[1])


def number(value: Optional[float]) -> str:
    """Format a value for the table."""
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


def response_line(name: str, response: Response) -> str:
    """Return one line about a step response."""
    return (
        f"{name}: rises in {response.rise_s * 1000:.0f} ms, overshoots {response.overshoot:.1%}, "
        f"settles after {response.settle_s * 1000:.0f} ms, mean error {response.offset:.1%}"
    )
