"""`mrl goto`: drive to a goal in odometry coordinates, around the obstacles that the sonars see."""

import math
from typing import TYPE_CHECKING, Callable, Optional

import click

from mrl_driver.errors import GoalMissed
from mrl_driver.geometry import Pose
from mrl_driver.view.shown_state import snapshot

from . import shared
from .drive import confirm_stop, require_driving
from .shared import Between, Run, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

FARTHEST_M = 1000.0
STEP_S = 0.05  # the speeds are computed again after this time [s]
LOOK_RAD = 4 * math.pi
"""Two turns on the spot: all obstacles are seen twice, 12 s apart on a TraxBot, so that a person can step aside."""
PROGRESS_S = 1.0  # the progress is reported this often [s]


@click.command(context_settings={"ignore_unknown_options": True})  # -0.5 is a number, not an option
@click.argument("x", type=Between(-FARTHEST_M, FARTHEST_M))
@click.argument("y", type=Between(-FARTHEST_M, FARTHEST_M))
@click.argument("yaw", type=Between(-360.0, 360.0), required=False)
@run_options(*shared.DRIVING)
@click.option(
    "--timeout",
    "timeout_s",
    type=Between(0, min_open=True),
    default=shared.FOREVER_S,
    help="Give up after this time [s]; default: after 60 s without progress, or two turns without a free path.",
)
def goto(run: Run, x: float, y: float, yaw: Optional[float], timeout_s: float) -> None:
    """Drive to a goal, around obstacles that the sonars see.

    X and Y [m] are coordinates of the odometry, which starts at 0 where the robot stands: X is forward, Y is to the
    left.  At the goal the robot turns to YAW [deg]; without it, to the direction from start to goal.
    The goal counts as reached within 0.03 m, and the heading within 3 deg, by the odometry.

    Exit codes: 0 reached; 16 blocked, or the time is over; 10 or 14 the robot was stopped; 130 Ctrl-C, which stops it.

    \b
    Examples:
      mrl goto 1 0 --port /dev/ttyACM0              1 m forward
      mrl goto 0.5 -0.3 90 --robot lab3 --yes       without the question; then turn to the left
      mrl goto -0.5 0 0 --robot lab3 --timeout 30   0.5 m back, with the front as at the start
    """
    run.confirm_overwrite(run.record)
    with run.connected(moves=True, odometry=True) as driver:
        shared.warn(driver)
        shared.report_losses(driver)
        if driver.model is None or not driver.model.sonars:
            shared.print_message("warning: this board has no sonars, the robot does not see obstacles")
        question = f"The robot drives by itself to {x:g} m, {y:g} m. Is the floor free?"
        shared.confirm_motion(question, run.yes)
        shared.await_gyro(driver)
        goal = Pose(x, y, math.atan2(y, x) if yaw is None else math.radians(yaw))
        why = drive_to(driver, goal, timeout_s, shared.print_message)
        facts = {"reached": not why, "why": why, "goal": goal._asdict(), **snapshot(driver)}
        run.print(facts, f"{'stopped' if why else 'reached'} at {_text(driver.pose)}")
        if why:
            raise GoalMissed(f"the goal was not reached: {why}")


def drive_to(driver: "Driver", goal: Pose, timeout_s: float, tell: Callable[[str], None]) -> str:
    """Drive to a pose of the odometry, and stop; returns why the goal was given up, empty if it was reached.

    `tell` gets a line of progress every second.  While it blocks, the driver's command timeout stops the robot.  Errors
    are as of `require_driving`.
    """
    from mrl_driver.navigation.goal_seeker import GoalSeeker

    assert driver.limits is not None and driver.model is not None
    begun_s = told_s = driver.now_s
    seeker = GoalSeeker(goal, driver.limits, begun_s, driver.model.sonars, look_rad=LOOK_RAD)
    while True:
        driver.drive(*seeker.command(driver.pose, driver.ranges, driver.now_s))
        driver.wait(STEP_S)
        if seeker.reached or seeker.blocked or driver.now_s - begun_s >= timeout_s:
            break
        require_driving(driver)
        if driver.now_s - told_s >= PROGRESS_S:
            told_s += PROGRESS_S
            away_m = math.dist(goal[:2], driver.pose[:2])
            waits = f", waits: {seeker.why}" if seeker.blind else ""
            tell(f"{away_m:.2f} m to go, at {_text(driver.pose)}{waits}")
            require_driving(driver)
    confirm_stop(driver)
    if seeker.reached:
        return ""
    return seeker.why if seeker.blocked else f"the time of {timeout_s:g} s is over"


def _text(pose: Pose) -> str:
    return f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, yaw {math.degrees(pose.yaw_rad):.1f} deg"
