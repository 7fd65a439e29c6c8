"""`mrl radio`: search for other robots' radios, send a text, print received texts, hold other robots."""

import contextlib
from typing import TYPE_CHECKING, Iterator, List, Sequence, Tuple

import click

from mrl_driver.errors import BoardTimeout, ConfigError, FrameError, one_line
from mrl_driver.navigation.radio_holder import RadioHolder
from mrl_driver.robot import radio as xbee
from mrl_driver.robot.radio import format_address, parse_address

from . import shared
from .shared import Between, Run, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

ALL = "all"
LEAVES_S = 0.1
"""The text is on the air this time after it was sent [s]; the command does not end the session before."""
POLL_S = 0.1
FREE_S = 6.0  # at the end, the command waits this long for the answers of the robots that it has held [s]


@click.group()
def radio() -> None:
    """Use the XBee of a board with the radio build.

    \b
    Examples:
      mrl radio discover --port /dev/ttyACM0
      mrl radio send 0013a20040a1b2c3 hello --port /dev/ttyACM0
      mrl radio send all hello --port /dev/ttyACM0
      mrl radio listen --port /dev/ttyACM0
      mrl radio hold 0013a20040a1b2c3 --port /dev/ttyACM0
      mrl radio free 0013a20040a1b2c3 --port /dev/ttyACM0
    """


@radio.command()
@run_options(shared.json_option)
@click.option(
    "--seconds",
    type=Between(0, 60, min_open=True),
    default=xbee.DISCOVERY_S,
    show_default=True,
    help="Collect answers for this time [s]; an XBee waits 6 s for them.",
)
def discover(run: Run) -> None:
    """List the radios that answer.

    A line has the 64-bit address and the 16-bit network address of a radio, in hexadecimal.
    """
    with run.connected() as driver:
        print_nodes(driver, run.seconds, run.as_json)


def print_nodes(driver: "Driver", seconds: float, as_json: bool) -> None:
    """Print the radios that answer within this time [s], one a line."""
    nodes = [(format_address(node.address), f"{node.network:04x}") for node in driver.radio.discover(seconds)]
    if as_json:
        shared.print_json([dict(zip(("address", "network"), node)) for node in nodes])
        return
    for node in nodes:
        click.echo("  ".join(node))
    if not nodes:
        click.echo(xbee.NO_ANSWER)


@radio.command()
@click.argument("address")
@click.argument("text")
@run_options()
def send(run: Run, address: str, text: str) -> None:
    """Send a text.

    TEXT has at most 16 ASCII characters; ADDRESS has 16 hexadecimal digits, or is `all`.
    The command does not report whether the text has arrived; `mrl radio listen` on the other side shows it.
    """
    with _options_of_user(f", or {ALL}"):
        to = xbee.BROADCAST if address == ALL else parse_address(address)
    with _options_of_user():
        xbee.text_request(to, text)
    with run.connected() as driver:
        driver.radio.send(to, text)
        driver.wait(LEAVES_S)


@contextlib.contextmanager
def _options_of_user(more: str = "") -> Iterator[None]:
    """In this block, what the frame does not allow is an error of the options."""
    try:
        yield
    except FrameError as error:
        raise ConfigError(f"{error}{more}") from None


@radio.command()
@run_options(shared.seconds_option, shared.json_option)
def listen(run: Run) -> None:
    """Print received texts with their senders' addresses."""
    with run.connected() as driver:
        print_texts(driver, run.seconds, run.as_json)


def print_texts(driver: "Driver", seconds: float, as_json: bool) -> None:
    """Print received texts, one a line, for this time [s]."""
    driver.radio.require()
    heard: List[xbee.RadioText] = []
    driver.radio.on_text(heard.append)
    end_s = driver.now_s + seconds
    while driver.now_s < end_s:
        driver.wait(min(POLL_S, end_s - driver.now_s))
        while heard:
            text = heard.pop(0)
            if as_json:
                shared.print_json({"address": format_address(text.address), "text": text.text})
            else:
                click.echo(f"{format_address(text.address)}  {one_line(text.text)}")


@radio.command()
@click.argument("addresses", nargs=-1, required=True, metavar="ADDRESS...")
@run_options(shared.seconds_option)
def hold(run: Run, addresses: Tuple[str, ...]) -> None:
    """Stop other robots and hold them.

    Their boards stop, and refuse to move until this command ends.  They allow it if their parameter `radio_hold` is not
    0.  The command prints which robots have confirmed that they are held.  If it is killed, or the radio fails, they
    stay held, and their own hosts may release them.
    """
    with _holding(run, addresses) as (driver, holder):
        hold_others(driver, holder, run.seconds)


@radio.command()
@click.argument("addresses", nargs=-1, required=True, metavar="ADDRESS...")
@run_options()
def free(run: Run, addresses: Tuple[str, ...]) -> None:
    """End the hold of other robots.

    Only the radio that holds a robot can free it.  The robot does not move until its own host moves it.
    """
    with _holding(run, addresses):
        pass


@contextlib.contextmanager
def _holding(run: Run, addresses: Sequence[str]) -> Iterator[Tuple["Driver", RadioHolder]]:
    """Connect for the block; at its end, the robots with these addresses are freed."""
    with _options_of_user():
        holder = RadioHolder([parse_address(address) for address in addresses])
    with run.connected() as driver:
        driver.radio.on_text(lambda text: holder.receive(text, driver.now_s))
        try:
            yield driver, holder
        finally:
            free_others(driver, holder)


def hold_others(driver: "Driver", holder: RadioHolder, seconds: float) -> None:
    """Hold robots for this time [s], and print each change of their answers; texts of the radio go to `holder`."""
    driver.radio.require()
    holder.hold()
    end_s, shown = driver.now_s + seconds, ""
    while driver.now_s < end_s:
        _talk(driver, holder, end_s)
        silent = holder.unanswered(driver.now_s)
        text = f"no answer from {', '.join(map(format_address, silent))}" if silent else "all are held"
        if text != shown:
            shown = text
            click.echo(text)


def free_others(driver: "Driver", holder: RadioHolder) -> None:
    """End the hold, and wait for the answers; texts of the radio go to `holder`."""
    driver.radio.require()
    holder.free()
    end_s = driver.now_s + FREE_S
    while not holder.all_freed and driver.now_s < end_s:
        _talk(driver, holder, end_s)
    if not holder.all_freed:
        names = ", ".join(map(format_address, holder.unfreed))
        raise BoardTimeout(
            f"no answer from {names}: it may still be held; free it again, or release it at its own host"
        )
    shared.print_message("all are freed")


def _talk(driver: "Driver", holder: RadioHolder, end_s: float) -> None:
    for address, data in holder.texts(driver.now_s):
        driver.radio.send(address, data)
    driver.wait(min(POLL_S, end_s - driver.now_s))
