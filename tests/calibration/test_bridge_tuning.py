"""`mrl calibrate gains` with an H-bridge board, on the emulated kit in simulated time."""

import contextlib
import json
import re

import numpy as np
import pytest

from mrl_driver.calibration import bridge_procedures, from_recording, manoeuvres
from mrl_driver.calibration.bridge_gains import BridgeGains
from mrl_driver.cli import main
from mrl_driver.cli.commands import calibrate_job
from mrl_driver.driver import eeprom
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol import Frame
from mrl_driver.robot import models
from sim_arduino.serve import factory

from .test_commands import recorded

OVERSHOOT, SETTLED_S, OFFSET = 0.05, 0.25, 0.01
"""Limits of a step of the speed, as for the firmware; the speeds are means over 50 ms."""
SOFT = BridgeGains(kp=200, ki=1000, friction_duty=0, full_speed=200)
"""Gains that settle late."""
STEPS = len(bridge_procedures.STEP_PERCENTS) + 2


class Lab:
    """One emulated kit, and the command line."""

    def __init__(self, capsys):
        self.made = factory.make(factory.Options(robot="duo", footprint="none"))
        self._capsys, self.record = capsys, None

    @contextlib.contextmanager
    def connect(self, job):

        with SteppedDriver(self.made.engine, "duo", recorded(self.record)) as robot:
            eeprom.write(robot, SOFT._asdict())
            yield robot

    def mrl(self, *args):
        """Run `mrl calibrate gains`; exit code, stdout, lines of stderr."""
        with pytest.raises(SystemExit) as ended:
            main.main(["calibrate", "gains", "--robot", "duo", "--output", "kit.yaml", "--yes", *args])
        out, err = self._capsys.readouterr()
        assert "Traceback" not in err
        return ended.value.code, out, err.strip().splitlines()

    @property
    def in_force(self):
        return BridgeGains(*(self.made.engine.config[name] for name in BridgeGains._fields))


@pytest.fixture
def lab(monkeypatch, tmp_path, capsys):
    made = Lab(capsys)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(calibrate_job, "connect", made.connect)
    yield made
    made.made.close()


def test_suggested_gains_keep_a_step_within_its_limits(lab, tmp_path):
    """They go to the file and the EEPROM."""
    code, out, _ = lab.mrl("--json", "--plot", "gains.png", "--eeprom")
    found = json.loads(out)
    assert code == 0
    for wheel in ("left", "right"):
        before, after = found["before"][wheel], found["after"][wheel]
        assert after["overshoot"] < OVERSHOOT and abs(after["offset"]) < OFFSET
        assert after["settle_s"] < SETTLED_S
        assert before["settle_s"] is None or before["settle_s"] > SETTLED_S
    assert (tmp_path / "gains.png").stat().st_size > 5000
    board, gains = models.load("kit.yaml").board, found["gains_after"]
    assert {name: board[name] for name in gains} == gains
    assert lab.in_force == BridgeGains(**gains)


def test_the_former_gains_and_the_ramp_come_back(lab):
    ramp = lab.made.engine.config["ramp_time"]
    code, out, _ = lab.mrl()
    assert code == 0 and lab.in_force == SOFT
    assert lab.made.engine.config["ramp_time"] == ramp != 0
    assert re.search(
        r"right motor: turns from 5\.\d% duty, 17\d 1/min at full duty, time constant \d+ ms", out
    )


@pytest.mark.parametrize("steps", range(STEPS))
def test_an_interruption_brings_them_back_too(lab, monkeypatch, steps):
    step, calls = bridge_procedures.step, []

    def interrupted(*args):
        calls.append(args)
        if len(calls) > steps:
            raise KeyboardInterrupt
        return step(*args)

    monkeypatch.setattr(bridge_procedures, "step", interrupted)
    ramp = lab.made.engine.config["ramp_time"]
    code, _, _ = lab.mrl()
    assert code == main.INTERRUPTED and lab.in_force == SOFT
    assert lab.made.engine.config["ramp_time"] == ramp


def test_a_motor_that_does_not_turn_is_named(lab, tmp_path):
    lab.made.plant.bridge.motor(0).blocked = True
    code, _, lines = lab.mrl()
    assert code == 2 and "left motor: the wheel turned at 0 of 3 duties" in lines[-1]
    assert not (tmp_path / "kit.yaml").exists()


def test_a_recording_gives_the_gains_of_its_drive(lab, tmp_path):
    lab.record = tmp_path / "drive.mrl"
    _, out, _ = lab.mrl("--json")
    driven = json.loads(out)["gains_after"]
    (tmp_path / "kit.yaml").unlink()
    code, _, lines = lab.mrl("--recording", str(lab.record))
    board = models.load("kit.yaml").board
    assert code == 0, lines
    assert {name: board[name] for name in driven} == pytest.approx(driven, rel=0.03)


