"""From `mrl new` to a closed square: an emulated kit with hidden errors, in simulated time."""

import contextlib
import math

import numpy as np
import pytest

from mrl_driver.apps.calibration import manoeuvres
from mrl_driver.apps.calibration.commands import calibrate_job, calibrate_view
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.apps.calibration.trial import Trial, errors
from mrl_driver.cli import main
from mrl_driver.cli.commands import set_id
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.serve import factory

SIDE_M, END_M, END_RAD = 0.4, 0.01, math.radians(0.5)
BEFORE_M = 0.05  # The hidden errors put a square off by more than this
HIDDEN = 54  # Motors and encoders swapped, left motor and left encoder reversed
FACTS = ("--wheel-diameter", 65, "--separation", 150, "--counts", "11x4x34", "--bridge", "tb6612")


class Later:
    """An engine whose time has begun before."""

    def __init__(self, engine, now_s):
        self._engine, self._since_s, self.now_s = engine, now_s, now_s

    @property
    def next_event_s(self):
        return self._engine.next_event_s - self._since_s

    def receive(self, data):
        self._engine.receive(data)

    def advance(self, to_s):
        self.now_s = self._since_s + to_s
        return self._engine.advance(self.now_s)


class Workshop:
    """One emulated kit, and the command line."""

    def __init__(self, capsys):
        self.emulated = factory.make(
            factory.Options(robot="duo", wiring=HIDDEN, error="wheel_ratio=1.04,axle=1.02", footprint="none")
        )
        self._capsys, self._now_s = capsys, 0.0

    @contextlib.contextmanager
    def robot(self, model, **options):
        engine = Later(self.emulated.engine, self._now_s)
        with SteppedDriver(engine, model, Options(**options)) as driver:
            yield driver
        self._now_s = engine.now_s

    def pose(self):
        return Pose(*self.emulated.plant.true_pose)

    def mrl(self, *args):
        """Run `mrl`; its output."""
        with pytest.raises(SystemExit) as ended:
            main.main(list(map(str, args)))
        out, err = self._capsys.readouterr()
        assert not ended.value.code, err
        return out

    def square_error(self, model):
        """Error of the odometry after a clockwise square: metres and radians."""
        with self.robot(model, period_ms=50) as robot:
            track, ruler = manoeuvres.Track(robot), Truth(self.pose)
            track.begin()
            ruler.begin("")
            manoeuvres.square(robot, SIDE_M, False, manoeuvres.Speeds())
            steps = manoeuvres.steps_of(track.end())
            off = errors(robot.model.differential, [Trial(steps, ruler.end("", lambda _: None))])[0]
            return float(np.hypot(*off[:2])), abs(float(off[2]))


@pytest.fixture
def workshop(monkeypatch, tmp_path, capsys):
    made = Workshop(capsys)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(calibrate_job, "connect", lambda job: made.robot(job.target.model, period_ms=20))
    monkeypatch.setattr(
        set_id, "connected", lambda target, model, any_id, **_: made.robot(model, any_id=any_id)
    )
    monkeypatch.setattr(calibrate_view, "truth_file", lambda path: made.pose)
    yield made
    made.emulated.close()


def test_an_unknown_kit_becomes_a_calibrated_robot(workshop, tmp_path):
    """Wires swapped, one wheel 4 % larger, axle 2 % wider: `mrl new`, two calibrations, and the square closes."""
    out = workshop.mrl("new", "rover", *FACTS, "--no-flash", "--port", "kit", "--truth", "t", "--yes")
    assert f"wiring {HIDDEN | 1}, stored in the board's EEPROM" in out
    path = str(tmp_path / "config" / "mrl-driver" / "robots" / "rover.yaml")
    before_m, _ = workshop.square_error("rover")
    for procedure in (
        ("straight", "--count", 2, "--distance", 1),
        ("umbmark", "--laps", 2, "--side", SIDE_M),
    ):
        workshop.mrl("calibrate", *procedure, "--robot", path, "--truth", "t", "--yes", "--eeprom")
    after_m, after_rad = workshop.square_error("rover")
    assert before_m > BEFORE_M and after_m < END_M and after_rad < END_RAD
    with workshop.robot("rover") as robot:
        stored = robot.parameters.read("robot_id", "wiring", "kp", "wheel_radius")
        board = models.load("rover").board
    assert stored == {
        "robot_id": 11,
        "wiring": HIDDEN | 1,
        "kp": board["kp"],
        "wheel_radius": board["wheel_radius"],
    }
