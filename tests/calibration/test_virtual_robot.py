"""A virtual robot drives on with the file of its calibration; a real robot does not, and its file stays its own."""

import contextlib
from pathlib import Path

import pytest

from mrl_driver.apps.calibration import from_recording
from mrl_driver.apps.calibration.calibration_files import write_model
from mrl_driver.apps.calibration.commands import calibrate_job
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, WrongRobot
from mrl_driver.robot import models
from sim_arduino.serve import factory

from .kit import calibrate

FILE = "duo-23.yaml"
REAL_REFUSED = "the robot on this port is a real one, expected a virtual one"


@contextlib.contextmanager
def driver(robot, build, **options):
    """A robot with an H-bridge: the board calculates it, or the emulator has it."""
    made = factory.make(factory.Options(robot="duo", robot_id=23, build=build))
    with contextlib.closing(made), SteppedDriver(made.engine, robot, Options(**options)) as driven:
        yield driven


@pytest.fixture
def mrl(monkeypatch, tmp_path, capsys):
    """`mrl calibrate gains` on a bare board whose name says that it is virtual."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(
        calibrate_job, "connect", lambda job, **options: driver(job.target.model, "virtual", virtual=True)
    )
    return lambda *args: calibrate(capsys, "gains", "--yes", *args)


def virtual_file():
    write_model(models.path_of("duo"), FILE, {("board", "kp"): 100}, "test", virtual=True)
    return FILE


def test_a_virtual_robot_drives_on_with_the_file_of_its_calibration(mrl):
    """Without a name that says that it is virtual; a real one is refused, and another calibration goes on from it."""
    code, _, lines = mrl()
    assert code == 0, lines
    with driver(FILE, "virtual") as robot:
        assert robot.board.virtual and robot.model.board["kp"] == models.load(FILE).board["kp"]
    with pytest.raises(WrongRobot, match=REAL_REFUSED), driver(FILE, ""):
        pass
    assert mrl("--robot", FILE)[0] == 0
    assert Path(FILE).read_text().count("virtual: true") == 1


def test_the_file_of_a_real_robot_does_not_become_that_of_a_virtual_one(mrl):
    """It has a name, by which a virtual robot may use it."""
    text = Path(models.path_of("duo")).read_text()
    Path("mine.yaml").write_text(text)
    code, _, lines = mrl("--robot", "mine.yaml")
    assert code == 2 and "mine.yaml is the file of a real robot" in lines[-1]
    assert Path("mine.yaml").read_text() == text
    assert mrl("--robot", "mine.yaml", "--output", "virtual.yaml")[0] == 0
    assert models.load("virtual.yaml").virtual


def test_no_name_lets_the_file_of_a_virtual_robot_drive_a_real_one(mrl):
    with pytest.raises(WrongRobot, match=REAL_REFUSED), driver(virtual_file(), "", virtual=False):
        pass


@pytest.mark.parametrize(
    ("build", "file", "words"),
    [("virtual", "duo", "virtual robot, .* virtual: true"), ("", FILE, "real robot, .* virtual: false")],
)
def test_a_recording_calibrates_the_file_of_its_own_kind(mrl, build, file, words):
    virtual_file()
    with driver("duo", build, record="drive.rec") as robot:
        robot.wait(0.5)
    with pytest.raises(ConfigError, match=f"is a recording of a {words}"):
        from_recording.read("drive.rec", models.load(file))


def test_the_recording_of_a_virtual_robot_calibrates_its_file(mrl):
    with driver(virtual_file(), "virtual", record="drive.rec") as robot:
        robot.wait(0.5)
    assert len(from_recording.read("drive.rec", models.load(FILE))[0]) > 1
