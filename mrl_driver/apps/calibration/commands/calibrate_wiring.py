"""`mrl calibrate wiring`: with a motor board, names wires to exchange; with an H-bridge, stores how they are."""

from typing import Any, List, Optional

import click

from mrl_driver.apps.calibration import gain_procedures, wiring_check, wiring_procedures
from mrl_driver.apps.calibration.manoeuvres import Track
from mrl_driver.apps.calibration.wiring_procedures import Scene, Witness
from mrl_driver.cli.commands.shared import print_json, warn
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError, WheelFault
from mrl_driver.protocol.table import BRIDGES

from . import calibrate_job
from .calibrate_job import Job, confirm_drive, job_options, recorded_model, recording_option
from .calibrate_view import SeenByTruth, SeenByUser, require_terminal, ruler_for, unmeasured

CHIPS = BRIDGES[1:]
bridge_choice = click.Choice(CHIPS, case_sensitive=False)


@click.command()
@job_options
@click.option("--unseen", is_flag=True, help="Do not ask which wheel turned; finds fewer faults.")
@click.option(
    "--bridge", type=bridge_choice, help="Chip of the H-bridge; default: that of the board or model."
)
@click.option(
    "--single-channel", is_flag=True, help="The encoders of the H-bridge board have channel A only."
)
@click.option("--answers", metavar="WORDS", help="Answers for scripts, such as left,forward,back,yes.")
@recording_option
def wiring(job: Job, unseen: bool, recording: Optional[str], answers: Optional[str], **bridge: Any) -> None:
    """Find swapped or reversed wires of motors and encoders.

    With a motor board, it asks, turns each wheel forward for half a second, and names the wires to exchange.  Put the
    robot on a box, or clear half a metre in front of it.

    With an H-bridge board, no wire needs to be exchanged: the board stores how they are.  Lift the wheels off the
    ground.  Each motor output turns its wheel for 0.3 s at 20 % duty, and you say which wheel turned, and in which
    direction.  A slow turn to the right proves the result.  After Ctrl-C the board is as before.

    \b
    Examples:
      mrl calibrate wiring --port /dev/ttyACM0
      mrl calibrate wiring --robot kit --bridge l298n
    """
    if recording is not None:
        model = recorded_model(job)
        if model.board.get("bridge"):
            raise ConfigError(
                "--recording does not show which wheel turned, which the wiring of an H-bridge board needs; run "
                "mrl calibrate wiring with the robot"
            )
        _report(wiring_procedures.recorded(recording, model), job)
        return
    if job.truth is None and not unseen and answers is None:
        require_terminal(
            "--unseen to skip the question which wheel turned, or --answers with an H-bridge board"
        )
    with calibrate_job.connect(job) as driver:
        if gain_procedures.CAPABILITY in driver.board.capabilities:
            _store(driver, job, unseen, answers, **bridge)
            return
        warn(driver)
        scene = _scene(driver, job, SeenByUser(more=["unseen"]), unseen)
        confirm_drive(
            job, "Each wheel turns forward for half a second. Is the robot on a box, or its path free?"
        )
        _report(wiring_procedures.check(scene), job)


def _scene(driver: Driver, job: Job, user: SeenByUser, unseen: bool = False) -> Scene:
    """The robot, seen by its true pose if that is known, else by the user, or by nobody."""
    ruler = ruler_for(job.truth) if job.truth is not None else unmeasured()
    witness: Witness = user if job.truth is None else SeenByTruth()
    return Scene(driver, Track(driver), ruler, Witness() if unseen else witness)


def _report(found: List[str], job: Job) -> None:
    """Print the faults of a motor board's wires; raise WheelFault if there is one."""
    if job.as_json:
        print_json({"findings": found})
    if found:
        raise WheelFault("; ".join(found))
    if not job.as_json:
        click.echo("the wiring of motors and encoders is right")


def _store(
    driver: Driver,
    job: Job,
    unseen: bool,
    answers: Optional[str],
    bridge: Optional[str],
    single_channel: bool,
) -> None:
    """Find the wiring of an H-bridge board, prove it, and save it in the EEPROM."""
    if unseen:
        raise ConfigError(
            "--unseen is given, but the encoders of an H-bridge board do not show which wheel turned; leave it out, or "
            "give --answers"
        )
    scene, number = _scene(driver, job, SeenByUser(answers)), _bridge_of(driver, bridge)
    confirm_drive(
        job,
        f"Each wheel turns slowly for {wiring_procedures.SLOW_S} s, driven by a {BRIDGES[number].upper()}. Are the "
        "wheels off the ground?",
    )
    with wiring_procedures.uncorrected(driver, number, single_channel):
        with gain_procedures.ramp_off(driver):  # a slow ramp would not reach 20 % in 0.3 s
            found = wiring_procedures.find_wiring(scene, single_channel)
            driver.parameters.write({"wiring": found})
            wiring_procedures.prove(scene)
        if job.eeprom is not False:
            driver.parameters.save()
    words = wiring_check.in_words(found)
    if job.as_json:
        print_json({"bridge": BRIDGES[number], "wiring": found, "differences": words})
        return
    kept = "in force until the board restarts" if job.eeprom is False else "stored in the board's EEPROM"
    click.echo(f"{', '.join(words) or 'the wires are as in HARDWARE.md'}: wiring {found}, {kept}")


def _bridge_of(driver: Driver, wanted: Optional[str]) -> int:
    """Return the number of the bridge: as given, or that of the board, or that of the model."""
    assert driver.model is not None
    if wanted is not None:
        return BRIDGES.index(wanted.lower())
    found = driver.parameters.read("bridge")["bridge"] or driver.model.board.get("bridge", 0)
    if not found:
        raise ConfigError(
            f"neither the board nor the model names its bridge; give --bridge with one of {', '.join(CHIPS)}"
        )
    return found
