"""A bare board that calculates its robot says so everywhere, and the name of a real robot does not accept it."""

import json
import os
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from mrl_driver.apps.calibration import from_recording
from mrl_driver.apps.measure import report
from mrl_driver.apps.review import drive_data
from mrl_driver.driver import Driver, Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.errors import ConfigError, NotARobot, WrongRobot
from mrl_driver.host import avrdude, named_robots
from mrl_driver.host.firmware_images import image_path
from mrl_driver.recording.recording import Recording
from mrl_driver.robot import models
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.handshake import Board
from mrl_driver.view.shown_state import VIRTUAL, state_of
from sim_arduino.avr import intel_hex
from sim_arduino.testing import EmulatedBoard

from .bootloader import Bootloader, MegaBootloader
from .run import fails, mrl

REFUSED = "the robot on this port is a virtual one, expected a real one"
MEASURED = Path(__file__).resolve().parents[2] / "docs" / "measured" / "simulated_uno_virtual.json"
SERVE = ("serve", "--listen", "tcp://127.0.0.1:0", "--port-timeout", "0.1")
REFUSED_REAL = "the robot on this port is a real one, expected a virtual one"


@pytest.fixture
def bare_board(close_later):
    return close_later(EmulatedBoard(build="virtual"))


@pytest.fixture
def duo(close_later):
    return close_later(EmulatedBoard(robot="duo"))


def name(port, **changes):
    """The name lab3 for what answers on a port, as `mrl names add` has it."""
    assert mrl("names", "add", "lab3", "--port", port).returncode == 0
    named_robots.write({"lab3": named_robots.read()["lab3"]._replace(**changes)})


def test_info_and_doctor_say_so_and_advise_nothing_about_cables(bare_board):
    assert json.loads(mrl("info", "--json", "--port", bare_board.port).stdout)["virtual"] == VIRTUAL
    mrl("config", "set", "virtual_faults", str(64 + 512), "--yes", "--port", bare_board.port)
    found = json.loads(mrl("doctor", "--json", "--port", bare_board.port).stdout)["findings"]
    by_code = {each["code"]: each for each in found}
    assert by_code["virtual"]["level"] == "note"
    advice = {by_code[code]["advice"] for code in ("sonar_dead", "battery_empty")}
    assert advice == {f"look for a fault that is set: mrl config get virtual_faults --port {bare_board.port}"}
    assert by_code["wheels_unchecked"]["advice"] == f"run: mrl doctor --drive --port {bare_board.port}"
    assert "virtual duo 23" in mrl("ports", "--probe", bare_board.port).stdout


def test_the_page_and_the_comparison_of_a_measurement_say_so():
    made = report.load(str(MEASURED))
    page = report.render(made)
    assert "virtual duo, 20" in page and "not measured" in page and "None" not in page
    assert "virtual duo" in next(report.comparison(report.compared(made, made)))


def test_live_views_recordings_and_the_review_say_so(bare_board, tmp_path):
    path = str(tmp_path / "bare.rec")
    with Driver(bare_board.port, options=Options(record=path)) as robot:
        robot.wait(0.3)
        assert state_of(robot).name == "virtual duo 23"
    assert summarise(RecordedDriver(Recording(path)))["virtual"] is True
    assert drive_data.read(RecordedDriver(Recording(path))).robot_name == "virtual duo 23"


def test_the_name_of_a_virtual_robot_refuses_a_real_one(duo):
    name(duo.port, virtual=True)
    assert REFUSED_REAL in fails(8, "drive", "--linear", "0.1", "--for", "1", "--yes", "--robot", "lab3")


def test_a_name_that_is_added_with_the_bare_board_plugged_in_is_that_of_a_virtual_robot(bare_board):
    name(bare_board.port)
    assert "virtual: true" in Path(named_robots.path()).read_text()
    assert "robot 23  virtual" in mrl("names").stdout
    assert mrl("info", "--robot", "lab3").returncode == 0


@pytest.fixture
def own(tmp_path):
    """The file of a robot of one's own, which has the id of the bare board."""
    text = Path(models.path_of("duo")).read_text(encoding="utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("name: duo", "name: mine"))
    return path


def refuses(*command):
    done = mrl(*command)
    return done.returncode == 8 and REFUSED in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("command", [("info",), SERVE], ids=lambda command: command[0])
def test_the_file_of_a_robot_refuses_a_virtual_one(bare_board, own, command):
    assert refuses(*command, "--robot", own, "--port", bare_board.port)


def test_the_model_of_a_file_refuses_a_virtual_robot(bare_board, own):
    with pytest.raises(WrongRobot, match=REFUSED):
        Driver(bare_board.port, models.load(str(own))).connect()


def test_a_robot_of_ones_own_that_its_id_selects_refuses_a_virtual_one(bare_board, own):
    os.makedirs(models.own_folder(), exist_ok=True)
    Path(models.own_folder(), "mine.yaml").write_text(own.read_text())
    assert refuses("drive", "--linear", "0.1", "--for", "1", "--yes", "--port", bare_board.port)


def test_a_traxbot_is_never_virtual(close_later):
    board = close_later(EmulatedBoard(robot="duo", build="virtual", robot_id=1))
    with pytest.raises(WrongRobot, match=REFUSED):
        Driver(board.port).connect()
    assert refuses(*SERVE, "--robot", "traxbot", "--port", board.port)


@pytest.mark.parametrize(
    "command",
    [("info",), ("set-id", "23", "--yes"), ("flash", "--yes"), SERVE],
    ids=lambda command: command[0],
)
def test_the_name_of_a_real_robot_refuses_a_virtual_one(bare_board, command):
    name(bare_board.port, virtual=False)
    assert refuses(*command, "--robot", "lab3")


def test_the_recording_of_a_virtual_robot_plays_but_does_not_calibrate_a_real_one(
    bare_board, own, tmp_path, monkeypatch
):
    """It also plays when the packaged model has become another one."""
    path = str(tmp_path / "bare.rec")
    with Driver(bare_board.port, options=Options(record=path)) as robot:
        robot.wait(0.3)
    with pytest.raises(ConfigError, match="a recording of a virtual robot"):
        from_recording.read(path, models.load(str(own)))
    monkeypatch.setattr(models, "is_virtual", lambda model: False)
    recorded = RecordedDriver(path)
    recorded.play()
    assert recorded.telemetry is not None


def test_the_robot_of_before_does_not_become_virtual():
    """Another board with the same id is on the port after it was unplugged."""
    state = RobotState(models.load("duo"))
    state.info = Board(23, 2, 0.0, 12.0, 0.0, 2, frozenset({"bridge"}))
    with pytest.raises(WrongRobot, match=REFUSED):
        state.admit(state.info._replace(capabilities=frozenset({"bridge", "virtual"})))


@pytest.mark.parametrize("virtual", [None, False])
def test_a_real_robot_is_accepted(duo, virtual):
    with Driver(duo.port, options=Options(virtual=virtual)) as robot:
        assert not robot.board.virtual


@pytest.mark.parametrize(
    ("kind", "chip", "options"),
    [
        (Bootloader, ATMEGA328P, {}),
        (Bootloader, ATMEGA328P, {"baud": termios.B57600}),
        (MegaBootloader, ATMEGA2560, {}),
    ],
)
def test_each_bootloader_takes_the_image_of_a_bare_board(close_later, kind, chip, options):
    board, image = close_later(kind(**options)), image_path("virtual", chip.name)
    avrdude.upload(board.path, image, bauds=avrdude.BAUDS, chip=chip)
    for start, data in intel_hex.read(Path(image).read_text()):
        assert board.flash[start : start + len(data)] == data


@pytest.mark.parametrize("build", [("--build", "virtual"), ()], ids=["asked", "as it is"])
def test_a_mega_with_any_usb_device_gets_its_image(bare_board, monkeypatch, build):
    """Its bootloader answers none of those before."""
    tried = []

    def upload(port, image, chip, **options):
        tried.append((chip, Path(image).name))
        if chip != ATMEGA2560:
            raise NotARobot("not in sync")

    monkeypatch.setattr(avrdude, "upload", upload)
    assert mrl("flash", "--port", bare_board.port, *build, "--yes").returncode == 0
    names = "mrl_firmware_virtual.hex", "mrl_firmware_virtual_mega.hex"
    assert tried == list(zip((ATMEGA328P, ATMEGA2560), names))


def test_a_bare_board_without_an_id_is_a_duo_after_the_upload(monkeypatch):
    """No wiring is stored in it."""
    monkeypatch.setattr(avrdude, "upload", lambda *args, **options: None)
    with EmulatedBoard(robot="duo", build="virtual", robot_id=0) as board:
        done = mrl("flash", "--port", board.port, "--build", "virtual", "--yes")
        assert done.stdout.endswith("it is the virtual robot 23\n"), done.stderr
        found = json.loads(mrl("info", "--json", "--port", board.port).stdout)
        assert (found["robot"], "virtual" in found["capabilities"], found["faults"]) == ("duo", True, [])
        assert "pin_left_pwm_a" not in json.loads(mrl("config", "get", "--json", "--port", board.port).stdout)


def test_a_bare_board_with_the_id_of_a_robot_without_an_h_bridge_says_so(monkeypatch):
    monkeypatch.setattr(avrdude, "upload", lambda *args, **options: None)
    with EmulatedBoard(robot="duo", build="virtual", robot_id=1) as board:
        done = mrl("flash", "--port", board.port, "--build", "virtual", "--yes")
    assert "robot id 1 is that of a traxbot" in done.stdout and "mrl set-id 23" in done.stdout


TESTS = """
import pytest

from mrl_driver.driver import Driver


def test_drives(emulated_board):
    with Driver(emulated_board.port) as robot:
        emulated_board.wait_until(lambda: robot.drive(0.2, 0.0) and robot.pose.x_m > 0.1)


def test_of_the_motors(emulated_board, emulated_motors):
    raise AssertionError


@pytest.mark.emulated_board(robot="stingbot")
def test_of_another_robot(emulated_board):
    raise AssertionError
"""


def outcome(port, folder):
    """What pytest says at the end of these tests."""
    path = folder / "test_own.py"
    path.write_text(TESTS)
    options = ("-q", "-n", "0", "-p", "no:cacheprovider")
    command = (sys.executable, "-m", "pytest", *options, f"--port={port}", str(path))
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True).stdout


def test_tests_of_ones_own_run_on_a_bare_board(bare_board, tmp_path):
    assert "1 passed, 2 skipped" in outcome(bare_board.port, tmp_path)


def test_tests_of_ones_own_do_not_drive_a_real_robot(duo, tmp_path):
    said = outcome(duo.port, tmp_path)
    assert "3 errors" in said and "expected a bare board" in said and duo.true_pose.x_m == 0.0
