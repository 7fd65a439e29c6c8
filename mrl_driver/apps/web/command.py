"""`mrl web`: a page that shows and drives a robot."""

import contextlib
import os
import signal
import threading
from typing import TYPE_CHECKING, Any, Iterator, Optional

import click

from mrl_driver import folders
from mrl_driver.cli.commands.shared import (
    battery_option,
    connected,
    fast_option,
    full_screen,
    port_timeout_option,
    print_message,
    report_losses,
    robot_options,
    warn,
)
from mrl_driver.errors import ConfigError
from mrl_driver.host.access import is_loopback
from mrl_driver.host.named_robots import Target
from mrl_driver.program import handle_end_signals

if TYPE_CHECKING:
    from mrl_driver.apps.web.server import Server

COMMAND_TIMEOUT_S = 0.2
"""The driver stops the robot this long after the last fresh command of a page [s]; the page sends one every 50 ms."""


@click.command(short_help="Show and drive a robot on a web page.")
@robot_options
@click.option(
    "--listen",
    metavar="ADDRESS[:PORT]",
    default="127.0.0.1:8642",
    show_default=True,
    help="Address of this computer; 0.0.0.0 for all of them. Beyond this computer, the page needs a link with a token.",
)
@click.option(
    "--new-tokens",
    is_flag=True,
    help="Make other tokens: the links of before end, also those of servers that run.",
)
@click.option(
    "--recordings",
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    help="Folder for recordings that are made on the page  [default: ~/.local/share/mrl-driver/recordings]",
)
@click.option("--browser", is_flag=True, help="Open the page in this computer's browser; without --listen.")
@port_timeout_option
@battery_option
@fast_option
def web(
    target: Target, listen: str, new_tokens: bool, recordings: Optional[str], browser: bool, **options: Any
) -> None:
    """Show and drive a robot on a web page, on a phone or a desk.

    The page shows map, speeds, battery, link and time series.  One person drives; everybody who sees the page can stop
    the robot.  The robot drives only while a control is held, and stops 0.15 s after the last fresh command.

    Without --listen the page is for this computer alone.  With it, the command prints a link to drive and a link to
    watch, and the first as a QR code.  The connection is encrypted; the browser asks once whether you trust it.

    \b
    Examples:
      mrl web --port /dev/ttyACM0                     then open http://127.0.0.1:8642/
      mrl web --robot lab3 --listen 0.0.0.0           for phones in the same network
      mrl web --robot lab3 --listen 0.0.0.0 --new-tokens
    """
    from mrl_driver.apps.web.driver_robot import DriverRobot
    from mrl_driver.apps.web.listening import address, lines_for, listening_socket, settings_for
    from mrl_driver.apps.web.server import serve
    from mrl_driver.driver.options import QUEUED_S
    from mrl_driver.view.shown_state import state_of

    ends = click.get_current_context().find_object(str) or "Ctrl-C"  # `mrl demo` has a key for it
    host, port = address(listen)
    if browser and not is_loopback(host):
        raise ConfigError(
            f"--browser is given with --listen {listen}, expected one of them: other users of this computer could read "
            "the link in the list of its processes; open the link that is printed"
        )
    folder = recordings or os.path.join(folders.data(), "recordings")
    options.update(reconnect=True, command_timeout_s=COMMAND_TIMEOUT_S, queued_s=QUEUED_S)
    with contextlib.ExitStack() as stack:
        ear = stack.enter_context(listening_socket(host, port))
        settings = settings_for(listen, new_tokens, print_message)  # new tokens once the address is ours
        driver = stack.enter_context(connected(target, **options))
        warn(driver)
        report_losses(driver)

        def begun(server: "Server") -> None:
            stack.enter_context(_ended_by_signals(server))
            lines = lines_for(settings, server.port, picture=full_screen())
            if browser:
                click.launch(lines[0].split()[-1])
            if settings.tokens is None:
                lines[0] += f" shows {state_of(driver).name}; {ends} ends it"
            click.echo("\n".join(lines))

        serve(DriverRobot(driver, folder), settings, lambda: str(driver.error or ""), begun, ear)
        driver.wait(0)


@contextlib.contextmanager
def _ended_by_signals(server: "Server") -> Iterator[None]:
    """In this block, signals stop the robot at once and end the server; behind it they have their usual effect.

    Outside the main thread, which alone may set handlers, nothing changes.
    """
    seen = []

    def end(number: int, _frame: Any) -> None:
        seen.append(number)
        server.end("mrl web has ended")

    before = {}
    if threading.current_thread() is threading.main_thread():
        before = handle_end_signals(end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if seen:
            signal.raise_signal(seen[0])
