"""`mrl flash`: upload the firmware to a board."""

import os
from typing import Optional, Tuple

import click

from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.host.named_robots import Target

from .progress import progress, waiting
from .shared import confirm, json_option, print_json, robot_options, yes_option

PIONEERS = range(6, 11)
"""Robot ids of the boards with environment sensors."""


@click.command()
@robot_options
@click.option(
    "--build",
    type=click.Choice(["sonar", "environment", "xbee"]),
    help="Firmware build; by default the one the board has now, or the one for its id.",
)
@click.option("--image", type=click.Path(), metavar="FILE.hex", help="Your own firmware instead.")
@yes_option
@json_option
def flash(target: Target, build: Optional[str], image: Optional[str], yes: bool, as_json: bool) -> None:
    """Upload the firmware to an Arduino Uno.

    Reads the firmware back and checks that the board answers.  Without --port it uses the board made by Arduino,
    if only one is plugged in.  Needs avrdude.  The robot id and the other parameters in the EEPROM stay.

    \b
    Examples:
      mrl flash --port /dev/ttyACM0
      mrl flash --robot lab3 --build environment
    """
    if build and image:
        raise ConfigError("--build is given with --image, expected one of them")
    from mrl_driver.host import avrdude
    from mrl_driver.host.firmware_images import image_path
    from mrl_driver.transport.link import SerialLink

    port = target.port or _only_board()
    target = target._replace(port=port)
    SerialLink(port, target.baud).close()
    if image is None:
        build, why = (build, "as requested") if build else build_of(target)
        image = image_path(build)
        what = f"the {build} build ({why})"
    else:
        what = os.path.basename(image)
    confirm(f"Upload {what} to {port}?", yes)
    with progress(f"writing and reading back {port}", avrdude.MARKS) as advance:
        avrdude.upload(port, image, advance=advance)
    answer = _read_identity(target)
    if as_json:
        print_json({"port": port, "image": image, "build": build, "answer": answer})
    else:
        click.echo(f"{port} has {what}; {answer}")


def _only_board() -> str:
    """Return the port of the only board with Arduino's USB vendor id.

    Raises:
        ConfigError: there is none, or more than one.
    """
    from mrl_driver.transport.port_info import facts

    there = facts()
    boards = [each for each in there if each.arduino and not each.used_by]
    if len(boards) == 1:
        return boards[0].device
    found = ", ".join(each.device for each in boards or there) or "none; is the board plugged in?"
    several = "several boards are plugged in" if boards else "no board made by Arduino is plugged in"
    raise ConfigError(f"{several}, expected --port PORT; existing ports: {found}")


def build_of(target: Target) -> Tuple[str, str]:
    """Return the firmware build that suits the board, and why."""
    from mrl_driver.driver.probe import probe

    with waiting("asking the board for its identity"):
        answer = probe(str(target.port), target.baud)
    if answer.robot_id is None:
        return "sonar", "the default, as the board does not answer"
    for build in ("environment", "xbee"):
        if build in answer.capabilities:
            return build, "as on the board now"
    if answer.robot_id in PIONEERS:
        return "environment", f"robot {answer.robot_id} is a Pioneer"
    return "sonar", "as on the board now" if answer.capabilities else f"for robot {answer.robot_id}"


def _read_identity(target: Target) -> str:
    """Return the answer of the newly flashed board, in words."""
    from mrl_driver.driver.probe import probe

    with waiting("waiting for the board to answer"):
        answer = probe(str(target.port), target.baud)
    if answer.robot_id is None:
        raise MrlError(
            f"the firmware was written and read back, but the board does not answer: {answer.error}"
        )
    if answer.robot_id == 0:
        return f"it answers, but has no id yet; set it with: mrl set-id ID --port {target.port}"
    return f"robot {answer.robot_id} answers with firmware {answer.firmware_version}"
