"""`python -m tests.documents.survey FILE.bag` records an emulated robot that sweeps the arena, and exports it."""

import subprocess
import sys
from pathlib import Path

from mrl_driver.apps.calibration import manoeuvres
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.navigation.line_follower import Course
from sim_arduino.experiments import arena, arena_sweep
from sim_arduino.serve import factory
from sim_arduino.world import world_file
from tests.long.bench.report import either

POINTS, MOST_S = either(1000, 3), 900.0


def main(bag: str) -> None:
    """Sweep in simulated time, with the errors of the sensors of the experiment."""
    world, record = world_file.load("hazards"), str(Path(bag).with_suffix(".jsonl"))
    Path(record).unlink(missing_ok=True)
    sensors = {"environment": True, "environment_errors": arena_sweep.ERRORS}
    course = Course(arena.sweep(world)[:POINTS], arena_sweep.SPEEDS)  # as long as there is no robot
    made = factory.make(factory.Options(world=world, name="survey", seed=1, **sensors))

    def steer(_pose: object) -> manoeuvres.Command:
        speeds = course.command(made.plant.true_pose)
        return None if course.done else speeds

    with SteppedDriver(made.engine, made.plant.model, Options(period_ms=50, record=record)) as driver:
        manoeuvres.follow(driver, steer, MOST_S)
    made.close()
    Path(bag).unlink(missing_ok=True)
    subprocess.run([sys.executable, "-m", "mrl_driver", "export", record, bag], check=True)


if __name__ == "__main__":
    main(sys.argv[1])
