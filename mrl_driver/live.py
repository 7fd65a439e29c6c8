"""A robot on the terminal: a live view, or a line a second where there is no terminal."""

import math
import time
from functools import partial
from typing import Tuple

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from .commands.text import line, range_text, sensor_texts
from .driver import Driver
from .keyboard import Keyboard
from .teleop import Teleop

REFRESH_HZ = 10
BAR_M, BAR_WIDTH = 4.0, 24


def watch(driver: Driver, seconds: float) -> None:
    """Show the robot for `seconds`, on a terminal live, else a line a second."""
    console = Console()
    deadline = time.monotonic() + seconds
    if not console.is_terminal:
        while time.monotonic() < deadline and not driver.wait(
            min(1.0, max(0.0, deadline - time.monotonic()))
        ):
            console.print(line(driver), soft_wrap=True, highlight=False)
        return
    with Live(console=console, refresh_per_second=REFRESH_HZ, get_renderable=lambda: view(driver)):
        driver.wait(min(seconds, 1e6))


def drive(driver: Driver) -> None:
    """Drive with the keyboard until `q`: arrows or wasd drive while they are held, space stops.

    A press lasts for `teleop.HOLD_S`, so a terminal that is cut off stops the robot.
    """
    teleop = Teleop()
    console = Console()
    show = partial(view, driver, "hold arrows or wasd: drive   space: stop   q: quit")
    with Keyboard() as keyboard, Live(console=console, refresh_per_second=REFRESH_HZ, get_renderable=show):
        while not driver.wait(0):
            for key in keyboard.read(0.05):
                if key in ("q", "escape"):
                    return
                teleop.press(key, time.monotonic())
            steer(driver, teleop.command(time.monotonic()))


def steer(driver: Driver, wanted: Tuple[float, float]) -> None:
    """Put the speeds of the keys that are held in force; stop when none is."""
    if any(wanted):
        driver.drive(*wanted)
    elif driver.command is not None:
        driver.stop()


def view(driver: Driver, hint: str = "Ctrl-C: end") -> Panel:
    """The whole robot as one panel."""
    body = Group(_motion(driver), Text(), _ranges(driver), _sensors(driver), Text(), _link(driver))
    model = driver.model.name if driver.model else "robot"
    return Panel(body, title=f"{model} {driver.board.robot_id}", subtitle=hint, width=78)


def _motion(driver: Driver) -> Table:
    pose, twist, asked = driver.pose, driver.twist, driver.command
    grid = Table.grid(padding=(0, 2))
    grid.add_row(
        "pose",
        f"x {pose.x_m:8.3f} m",
        f"y {pose.y_m:8.3f} m",
        f"yaw {math.degrees(pose.yaw_rad):7.2f} deg",
    )
    grid.add_row("speed", f"{twist.linear_m_s:8.3f} m/s", f"{twist.angular_rad_s:8.3f} rad/s", "")
    grid.add_row(
        "asked",
        *("stopped", "", "") if asked is None else (f"{asked[0]:8.3f} m/s", f"{asked[1]:8.3f} rad/s", ""),
    )
    return grid


def _ranges(driver: Driver) -> Table:
    grid = Table.grid(padding=(0, 2))
    for name, value in driver.ranges.items():
        grid.add_row(name, bar(value), range_text(value))
    return grid


def _sensors(driver: Driver) -> Table:
    grid = Table.grid(padding=(0, 2))
    for name, value in sensor_texts(driver).items():
        grid.add_row(name, value)
    return grid


def bar(value_m: float) -> str:
    """A range as a bar of up to `BAR_WIDTH` characters for `BAR_M`."""
    share = 0.0 if math.isnan(value_m) else max(0.0, min(1.0, value_m / BAR_M))
    return ("#" * round(share * BAR_WIDTH)).ljust(BAR_WIDTH, ".")


def _link(driver: Driver) -> Table:
    seen, status = driver.statistics, driver.status
    style = {"ok": "", "low": "yellow"}.get(driver.battery_state, "red")
    charge = Text(f"{driver.battery_v:.1f} V {driver.battery_state}", style=style)
    damage = f"{seen.lost} lost, {sum(seen.garbage.values())} damaged, {seen.refused_counts} refused"
    age = f"{driver.age_s * 1000:.0f} ms old" if driver.ready else "NO TELEMETRY"
    health = "firmware 1 (2013), no watchdog"
    if status is not None:
        health = f"last stop: {status.stop_reason}; faults: {', '.join(status.faults) or 'none'}"
    grid = Table.grid(padding=(0, 2))
    grid.add_row("battery", charge, f"{driver.temperature_c:.0f} degC")
    grid.add_row("link", f"{seen.frames} frames", damage)
    grid.add_row("board", age, health)
    return grid
