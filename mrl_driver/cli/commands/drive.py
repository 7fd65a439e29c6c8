"""`mrl drive`: drive with the keyboard, or at given speeds for a given time."""

import contextlib
import sys
import time
from typing import TYPE_CHECKING, Optional

import click

from mrl_driver.errors import BoardTimeout, ConfigError, MrlError
from mrl_driver.session.events import MAY_MOVE
from mrl_driver.view.shown_state import line, snapshot
from mrl_driver.view.words import stop_error

from . import shared
from .monitor import watch_live
from .shared import Between, Run, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

TICK_S = 0.05
STOP_S = 2.0  # telemetry confirms a stop within this time [s]
ROUNDING = 1e-6
SPEED = Between(-100.0, 100.0)  # m/s or rad/s; the robot's model has the limits


@click.command()
@run_options(*shared.DRIVING, shared.max_delay_option)
@click.option("--linear", type=SPEED, help="Forward speed [m/s].")
@click.option("--lateral", type=SPEED, help="Speed to the left, for robots that can drive sideways [m/s].")
@click.option("--angular", type=SPEED, help="Yaw rate, counter-clockwise [rad/s].")
@click.option("--for", "for_s", type=Between(0, 3600, min_open=True), help="Stop after this time [s].")
def drive(
    run: Run,
    linear: Optional[float],
    lateral: Optional[float],
    angular: Optional[float],
    for_s: Optional[float],
) -> None:
    """Drive with the keyboard, or at given speeds for a given time.

    A robot with a gyro first stands until the gyro's bias is known, for at most 1 s.  The key r releases the emergency
    stop of a board's input.  --for includes the time in which the robot accelerates; for a distance use mrl goto.

    \b
    Examples:
      mrl drive --port /dev/ttyACM0                         hold the arrow keys, or w a s d
      mrl drive --robot lab3 --linear 0.2 --for 2           for 2 s forward, a bit less than 0.4 m
      mrl drive --robot lab3 --angular 0.5 --for 3.14       for 3.14 s to the left, almost a quarter turn
      mrl drive --robot omni1 --lateral 0.2 --for 2         for 2 s to the left, on three wheels
    """
    if (linear, lateral, angular, for_s) == (None, None, None, None):
        if run.as_json or not (sys.stdin.isatty() and shared.full_screen()):
            raise ConfigError(f"{shared.no_view_because()}; give --linear or --angular, and --for SECONDS")
        run.confirm_overwrite(run.record)
        watch_live(run._replace(reconnect=True), keys_drive=True)
        return
    speeds = linear or 0.0, angular or 0.0, lateral or 0.0
    if run.max_delay_s is not None:
        raise ConfigError("--max-delay is for driving with the keys, expected it without speeds and --for")
    if for_s is None:
        raise ConfigError("--for is missing, expected the seconds to drive, such as: --for 2")
    run.confirm_overwrite(run.record)
    with run.connected(moves=True) as driver:
        shared.warn(driver)
        shared.report_losses(driver)
        _report_limits(driver, *speeds)
        shared.await_gyro(driver)
        drive_for(driver, speeds[0], speeds[1], for_s, speeds[2])
        run.print(snapshot(driver), line(driver))


def _report_limits(driver: "Driver", linear_m_s: float, angular_rad_s: float, lateral_m_s: float) -> None:
    """Report the limited speeds if the robot's model does not allow the requested ones."""
    assert driver.model is not None
    wanted = linear_m_s, angular_rad_s, lateral_m_s
    kept = driver.limited(*wanted)
    if lateral_m_s and len(kept) < len(wanted):
        return  # `drive` reports that this base cannot move sideways
    if any(abs(found - asked) > ROUNDING for found, asked in zip(kept, wanted)):
        sideways = "".join(f", --lateral {speed:.3g} m/s" for speed in kept[2:])
        shared.print_message(
            f"limited to --linear {kept[0]:.3g} m/s, --angular {kept[1]:.3g} rad/s{sideways}: the model "
            f"{driver.model.name} allows {driver.model.limits.linear_m_s:g} m/s and "
            f"{driver.model.limits.angular_rad_s:g} rad/s"
        )


def drive_for(
    driver: "Driver", linear_m_s: float, angular_rad_s: float, seconds: float, lateral_m_s: float = 0.0
) -> None:
    """Drive for `seconds`, stop, and wait up to 2 s for telemetry to confirm it; errors are as of `require_driving`.

    It prints nothing while driving: a terminal that accepts no output would delay the stop.
    """
    deadline = time.monotonic() + seconds
    driver.drive(linear_m_s, angular_rad_s, lateral_m_s)
    while time.monotonic() < deadline:
        require_driving(driver)
        driver.wait(min(TICK_S, deadline - time.monotonic()))
        require_driving(driver)
        driver.drive(linear_m_s, angular_rad_s, lateral_m_s)
    require_driving(driver)
    confirm_stop(driver)


def require_driving(driver: "Driver") -> None:
    """Raise why the robot was stopped, unless a command is in force.

    WheelFault if a wheel did not follow its command, MrlError if another robot holds this one, else BoardTimeout.
    """
    if driver.command is not None:
        return
    if driver.mismatch is not None:
        raise stop_error(driver, "stopped early")
    if driver.radio.hold is not None and driver.radio.hold.held:
        raise MrlError(f"stopped early: {driver.radio.hold}")
    if driver.may_be_moving:
        raise BoardTimeout(f"no telemetry for {driver.link.age_s * 1000:.0f} ms; {MAY_MOVE}")
    raise stop_error(driver, "stopped early")


def confirm_stop(driver: "Driver") -> None:
    """Stop, and wait up to `STOP_S` for telemetry to confirm it; BoardTimeout if one without a watchdog does not."""
    with contextlib.suppress(BoardTimeout):  # telemetry may be back in time
        driver.stop()
    deadline_s = driver.now_s + STOP_S
    while not driver.stopped and driver.now_s < deadline_s and not driver.wait(0.02):
        pass
    if driver.may_be_moving:
        raise BoardTimeout(f"the stop was sent, but not confirmed; {MAY_MOVE}")
