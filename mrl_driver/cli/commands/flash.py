"""`mrl flash`: upload the firmware to a board."""

import os
from typing import TYPE_CHECKING, Mapping, Optional, Tuple

import click

from mrl_driver.errors import ConfigError, MrlError, NotARobot, WrongRobot
from mrl_driver.host.firmware_images import HBRIDGE, VIRTUAL, VIRTUAL_MODEL
from mrl_driver.host.named_robots import Target
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, CHIPS, Chip
from mrl_driver.robot.models import ENVIRONMENT, SONAR

from .progress import progress, waiting
from .shared import (
    Run,
    choose,
    json_option,
    report_unknown_wiring,
    run_options,
    wait_until,
    yes_option,
)

if TYPE_CHECKING:
    from mrl_driver.driver.probe import Answer
    from mrl_driver.session.events import Status

BUILD_TEXTS = {
    SONAR: "motor board OMNI-3MD and sonars, such as TraxBot and StingBot",
    ENVIRONMENT: "gas and light sensors, motor board OMNI-3MD or none",
    "xbee": "motor board OMNI-3MD, sonars and a radio",
    HBRIDGE: "motors on an H-bridge, encoders on the Arduino's pins, sonars",
    VIRTUAL: "no robot: the bare board calculates one",
}


@click.command()
@run_options(yes_option, json_option)
@click.option(
    "--build",
    type=click.Choice(list(BUILD_TEXTS)),
    help="Firmware build; by default the one the board has now, or the one for its id; otherwise it asks.",
)
@click.option("--image", type=click.Path(), metavar="FILE.hex", help="Your own firmware instead.")
def flash(run: Run, build: Optional[str], image: Optional[str]) -> None:
    """Upload the firmware to an Arduino Uno, Nano or Mega.

    Reads the firmware back and checks that the board answers.  Without --port it uses the board made by Arduino,
    if only one is plugged in.  Needs avrdude.  The robot id and the other parameters in the EEPROM stay, but bridge
    and pins of an H-bridge board become those of the robot's file.  The chip is the one of the robot's file, or
    that of the USB device.  If this is not an Arduino Uno, it tries the baud rates of both bootloaders of a Nano,
    115200 and 57600, and then the bootloader of a Mega.

    With the build virtual a bare board is a robot: nothing is connected but the cable.  Without an id it becomes a duo.

    \b
    Examples:
      mrl flash --port /dev/ttyACM0
      mrl flash --robot lab3 --build environment
      mrl flash --port /dev/ttyUSB0 --build hbridge
      mrl flash --port /dev/ttyACM0 --build virtual
    """
    if build and image:
        raise ConfigError("--build is given with --image, expected one of them")
    from mrl_driver.host.firmware_images import image_path
    from mrl_driver.transport.link import SerialLink

    port = run.target.port or only_board()
    target = run.target._replace(port=port)
    SerialLink(port, target.baud).close()
    chip = chip_of(target)
    if image is None:
        build, why = (build, "as requested") if build else build_of(target)
        _require_pins(build, target.model)
        images = {each: image_path(build, each.name) for each in (chip, *_other_chips(target, build))}
        what = f"the {build} build ({why})"
    else:
        images, what = {chip: image}, os.path.basename(image)
    run.confirm(f"Upload {what} to {port}?")
    image = _upload(port, images)
    answer, target = _read_identity(target), target._replace(virtual=None)  # it is what it has become
    if VIRTUAL in answer.capabilities:
        words = _make_virtual(run._replace(target=target), answer)
    else:
        wired = _store_wiring(run._replace(target=target)) if "bridge" in answer.capabilities else ""
        words = _in_words(answer, port) + wired
    facts = {"port": port, "image": image, "build": build, "answer": words}
    run.print(facts, f"{port} has {what}; {words}")


def _upload(port: str, images: Mapping[Chip, str]) -> str:
    """Write the image of the first chip whose bootloader answers, and return it; raise the error of the last one."""
    from mrl_driver.host import avrdude

    with progress(f"writing and reading back {port}", avrdude.MARKS) as advance:
        for chip, image in images.items():
            try:
                avrdude.upload(port, image, advance=advance, bauds=bauds_of(port, chip), chip=chip)
                return image
            except NotARobot as error:
                last = error
            except KeyboardInterrupt:
                raise click.Abort(f"interrupted; {avrdude.HALF}") from None
        raise last


def only_board() -> str:
    """Return the port of the only board with Arduino's USB vendor id."""
    from mrl_driver.transport.port_info import facts

    there = facts()
    boards = [each for each in there if each.arduino and not each.used_by]
    if len(boards) == 1:
        return boards[0].device
    found = ", ".join(each.device for each in boards or there) or "none (is the board plugged in?)"
    several = "several boards are plugged in" if boards else "no board made by Arduino is plugged in"
    raise ConfigError(f"{several}, expected --port PORT; existing ports: {found}")


def bauds_of(port: str, chip: Chip) -> Tuple[int, ...]:
    """Return the baud rates that the bootloader on a port may have: one if it is a Mega, or has Arduino's USB ids."""
    from mrl_driver.host import avrdude
    from mrl_driver.transport.port_info import describe, facts_of

    one = chip == ATMEGA2560 or facts_of(describe(port)).arduino
    return avrdude.BAUDS[:1] if one else avrdude.BAUDS


def chip_of(target: Target) -> Chip:
    """Return the chip of the robot's file; without one, that of a USB device with the ids of a Mega, or the Uno's."""
    from mrl_driver.robot import models
    from mrl_driver.transport.port_info import describe, facts_of

    if target.model not in ("", "auto"):
        return CHIPS[models.load(target.model).chip]
    return ATMEGA2560 if "Mega" in facts_of(describe(str(target.port))).kind else ATMEGA328P


def _other_chips(target: Target, build: str) -> Tuple[Chip, ...]:
    """Return the Mega's chip if nothing says that it is not one: many have the USB device of others."""
    from mrl_driver.transport.port_info import describe, facts_of

    told = target.model not in ("", "auto") or facts_of(describe(str(target.port))).arduino
    return () if told or build not in (HBRIDGE, VIRTUAL) else (ATMEGA2560,)


def _needed(model: str) -> str:
    """Return the build that a model, by name or path, needs; empty if it has a motor board and sonars, or is `auto`."""
    from mrl_driver.robot import models

    if model in ("", "auto"):
        return ""
    found = models.load(model)
    return HBRIDGE if found.board.get("bridge") else ENVIRONMENT if found.build == ENVIRONMENT else ""


def _require_pins(build: str, model: str) -> None:
    """Check that a build has what a model needs on the board's pins."""
    needed = _needed(model)
    bridged = HBRIDGE if build == VIRTUAL else build  # the robot of a bare board has an H-bridge
    if bridged == needed or model == "auto" or not (needed or bridged == HBRIDGE):
        return
    has = {HBRIDGE: "an H-bridge", ENVIRONMENT: "environment sensors"}.get(needed, "a motor board")
    raise ConfigError(
        f"--build is {build}, but robot {model} has {has}, expected {needed or 'another build'}"
    )


def build_of(target: Target) -> Tuple[str, str]:
    """Return the firmware build that suits the board, and why; ask if neither the board nor its model tells."""
    from mrl_driver.driver.probe import probe
    from mrl_driver.robot import models
    from mrl_driver.robot.robot_state import require_kind

    needed = _needed(target.model)
    if needed:
        return needed, f"for {target.model}"
    with waiting("asking the board for its identity"):
        answer = probe(str(target.port), target.baud)
    if answer.robot_id is None:
        question = "The board does not answer. Which build fits its motors?"
        return choose(question, BUILD_TEXTS, "--build"), "as requested"
    if target.id is not None and answer.robot_id not in (0, target.id):
        raise WrongRobot(
            f"robot id {answer.robot_id} answers, expected {target.id}: another board is on this port"
        )
    require_kind(VIRTUAL in answer.capabilities, target.virtual)
    for build in (ENVIRONMENT, "xbee", VIRTUAL, HBRIDGE):
        if ("bridge" if build == HBRIDGE else build) in answer.capabilities:
            return build, "as on the board now"
    named = "" if target.model == "auto" else models.load(target.model).build
    if named:
        return named, f"for {target.model}"
    if answer.robot_id in models.SENSOR_BOARD_IDS:
        return ENVIRONMENT, f"robot {answer.robot_id} is a Pioneer"
    return SONAR, "as on the board now" if answer.capabilities else f"for robot {answer.robot_id}"


def _read_identity(target: Target) -> "Answer":
    from mrl_driver.driver.probe import probe

    with waiting("waiting for the board to answer"):
        answer = probe(str(target.port), target.baud)
    if answer.robot_id is None:
        raise MrlError(
            f"the firmware was written and read back, but the board does not answer: {answer.error}"
        )
    return answer


def _in_words(answer: "Answer", port: str) -> str:
    if answer.robot_id == 0:
        return f"it answers, but has no id yet; set it with: mrl set-id ID --port {port}"
    return f"robot {answer.robot_id} answers with firmware {answer.firmware_version}"


def _make_virtual(run: Run, answer: "Answer") -> str:
    """Give a virtual robot without an id that of the duo; return in words which robot it is."""
    from mrl_driver.robot import models

    robot_id = answer.robot_id
    if not robot_id:
        model = models.load(VIRTUAL_MODEL)
        robot_id, target = model.ids[0], run.target._replace(model="traxbot")
        with run._replace(target=target).connected(any_id=True, identify=True) as driver:
            driver.parameters.save_model(robot_id, model)
    name = models.by_id(robot_id)
    if name and not models.load(name).board.get("bridge"):
        return (
            f"robot id {robot_id} is that of a {name}, expected that of a robot with an H-bridge, such as "
            f"{VIRTUAL_MODEL}; set it with: mrl set-id {models.load(VIRTUAL_MODEL).ids[0]} --port {run.target.port}"
        )
    return f"it is the virtual robot {robot_id}"


def _store_wiring(run: Run) -> str:
    """Store bridge and pins of the robot's file in an H-bridge board, and return that in words.

    The robot is the one of --robot, or the one with the board's id; empty if its file has no pins.
    """
    from mrl_driver.driver.parameters import CABLES
    from mrl_driver.robot import wiring

    with run.connected(any_id=True) as driver:
        model = driver.model
        if model is None or wiring.NAMES[0] not in model.board:
            return ""
        wanted = {name: model.board[name] for name in CABLES if name in model.board}
        unknown = driver.parameters.replace(wanted)
        # A board reports once more what was wrong meanwhile: the next program would take that for the present.
        old = driver.status
        wait_until(driver, lambda: driver.status is not old and (unknown or _is_wired(driver.status)), 2.5)
        report_unknown_wiring(unknown, run.target.port)
        return f"; its pins are those of {model.name}"


def _is_wired(status: Optional["Status"]) -> bool:
    return status is not None and "wiring" not in status.faults
