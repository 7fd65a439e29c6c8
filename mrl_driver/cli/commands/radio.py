"""`mrl radio`: search for other robots' radios, send a text, print received texts."""

from typing import TYPE_CHECKING, List

import click

from mrl_driver.errors import ConfigError, FrameError
from mrl_driver.host.named_robots import Target
from mrl_driver.robot.radio import (
    BROADCAST,
    DISCOVERY_S,
    RadioText,
    format_address,
    parse_address,
    text_request,
)

from .shared import Between, connected, json_option, print_json, robot_options, seconds_option

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

ALL = "all"
LEAVES_S = 0.1
"""The text is on the air this time after it was sent [s]; the command does not end the session before."""
POLL_S = 0.1


@click.group()
def radio() -> None:
    """Use the XBee of a board with the radio build.

    \b
    Examples:
      mrl radio discover --port /dev/ttyACM0
      mrl radio send 0013a20040a1b2c3 hello --port /dev/ttyACM0
      mrl radio send all hello --port /dev/ttyACM0
      mrl radio listen --port /dev/ttyACM0
    """


@radio.command()
@robot_options
@click.option(
    "--seconds",
    type=Between(0, 60, min_open=True),
    default=DISCOVERY_S,
    show_default=True,
    help="Collect answers for this time [s]; an XBee waits 6 s for them.",
)
@json_option
def discover(target: Target, seconds: float, as_json: bool) -> None:
    """List the radios that answer.

    A line has the 64-bit address and the 16-bit network address of a radio, in hexadecimal.
    """
    with connected(target, ignore_battery=True) as driver:
        print_nodes(driver, seconds, as_json)


def print_nodes(driver: "Driver", seconds: float, as_json: bool) -> None:
    """Print the radios that answer within this time [s], one a line.

    Raises:
        ConfigError: the board has no radio.
    """
    nodes = driver.discover_radios(seconds)
    if as_json:
        print_json(
            [{"address": format_address(node.address), "network": f"{node.network:04x}"} for node in nodes]
        )
        return
    for node in nodes:
        click.echo(f"{format_address(node.address)}  {node.network:04x}")
    if not nodes:
        click.echo("no other radio has answered; check that they are on and belong to the same network (PAN)")


@radio.command()
@click.argument("address")
@click.argument("text")
@robot_options
def send(target: Target, address: str, text: str) -> None:
    """Send a text.

    TEXT has at most 16 ASCII characters; ADDRESS has 16 hexadecimal digits, or is `all`.
    The command does not report whether the text has arrived; `mrl radio listen` on the other side shows it.
    """
    to = _address(address)
    try:
        text_request(to, text)
    except FrameError as error:
        raise ConfigError(str(error)) from None
    with connected(target, ignore_battery=True) as driver:
        driver.send_text(to, text)
        driver.wait(LEAVES_S)


def _address(text: str) -> int:
    try:
        return BROADCAST if text == ALL else parse_address(text)
    except FrameError as error:
        raise ConfigError(f"{error}, or {ALL}") from None


@radio.command()
@robot_options
@seconds_option
@json_option
def listen(target: Target, seconds: float, as_json: bool) -> None:
    """Print received texts with their senders' addresses."""
    with connected(target, ignore_battery=True) as driver:
        print_texts(driver, seconds, as_json)


def print_texts(driver: "Driver", seconds: float, as_json: bool) -> None:
    """Print received texts, one a line, for this time [s].

    Raises:
        ConfigError: the board has no radio.
    """
    driver.require_radio()
    heard: List[RadioText] = []
    driver.on_text(heard.append)
    end_s = driver.now_s + seconds
    while driver.now_s < end_s:
        driver.wait(min(POLL_S, end_s - driver.now_s))
        while heard:
            text = heard.pop(0)
            if as_json:
                print_json({"address": format_address(text.address), "text": text.text})
            else:
                click.echo(f"{format_address(text.address)}  {text.text}")
