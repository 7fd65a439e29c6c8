"""The commands on a board of 2013 with environment sensors, and on a board without motors."""

import contextlib
import io
import json
import time

import pytest
from rich.console import Console

from mrl_driver.apps.calibration import part_procedures
from mrl_driver.apps.review import drive_data, drive_plot
from mrl_driver.cli.commands.shared import await_sensors
from mrl_driver.cli.doctor import board
from mrl_driver.cli.doctor.findings import NOTE, OK
from mrl_driver.driver.options import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.protocol import encode_reply, encode_request
from mrl_driver.recording.recording import Recording
from mrl_driver.recording.summary import summarise
from mrl_driver.terminal.frame_log import FrameLog
from mrl_driver.terminal.live_panels import render
from mrl_driver.terminal.live_view import Screen, Settings
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard

from .run import fails, mrl

NAMES = {"alcohol", "dust", "light", "thermopile"}


@pytest.fixture(scope="module")
def gas_robot():
    emulated = factory.make(factory.Options(profile="2013-august", environment=True))
    with SteppedDriver(emulated.engine, "traxbot", options=Options(build="environment")) as robot:
        assert await_sensors(robot) == []
        yield robot
    emulated.close()


def test_curve_of_the_sonars_is_not_measured_without_one(gas_robot):
    """The robot would drive up to the wall without seeing it."""
    with pytest.raises(ConfigError, match="this board has no front sonar"):
        part_procedures.require_sonars(gas_robot)


def test_doctor_has_a_finding_for_each_sensor_and_none_for_sonars(gas_robot):
    sonars = list(board.sonars(gas_robot.ranges, gas_robot.board))
    assert [(each.level, each.text.partition(":")[0]) for each in sonars] == [(NOTE, "none")]
    found = list(board.sensors(gas_robot.sensors))
    assert {each.subject for each in found} == NAMES and {each.level for each in found} == {OK}


@pytest.fixture
def recorded(tmp_path):
    """A TraxBot of 2013 that drives a metre, with more and more alcohol."""
    frames = [encode_reply(5, 2500, 172, 1200, 1, 2)]
    frames += [encode_reply(25, 60 * i, 60 * i, 100 + i, -25536, 22, 400) for i in range(191)]
    frames += [encode_reply(22, *range(22, 30))]
    lines = [f"{0.01 * i:f} < {frame.decode().strip()}\\r\\n\n" for i, frame in enumerate(frames)]
    lines.insert(0, f"0.0 > {encode_request(25).decode().strip()}\n")
    (tmp_path / "gas.mrl").write_text("#mrl-recording 1 {}\n" + "".join(lines))
    return Recording(str(tmp_path / "gas.mrl"))


def test_recording_shows_path_and_sensors_and_has_no_ranges(recorded):
    """Also without the robot's file: stream 25 shows that the board has environment sensors."""
    figures, found = summarise(recorded), drive_data.read(RecordedDriver(recorded))
    assert figures["sensors"]["dust"] == {"least": 40000.0, "most": 40000.0, "unit": "pcs/l"}
    assert figures["sensors"]["alcohol"]["most"] == 290.0 and figures["pose"]["x_m"] == pytest.approx(
        1, abs=0.01
    )
    assert found.ranges == {} and set(found.sensors) == NAMES


NO_MOTORS = "robot pioneer is a board without motors (drive: none): it has sensors, and something else drives"


@pytest.fixture(scope="module")
def port():
    with EmulatedBoard(robot="pioneer", robot_id=7) as board:
        yield board.port


def test_doctor_shows_the_sensors_and_no_fault(port, monkeypatch):
    monkeypatch.setattr(board.watch, "__defaults__", (0.3, 5))
    monkeypatch.setattr(board, "MIN_SHARE", 0.0)
    done = mrl("doctor", "--json", "--drive", "--yes", "--port", port)
    found = json.loads(done.stdout)["findings"]
    assert {each["level"] for each in found if each["subject"] not in ("latency", "ModemManager")} <= {
        OK,
        NOTE,
    }
    texts = {each["subject"]: each["text"] for each in found}
    assert texts["light"] == "500 count" and "this board has no motors" in texts["wheels"]
    assert not {"battery", "motor board"} & set(texts)
    assert "hardware that does not answer" not in texts.get("refused by board", "")


@pytest.mark.parametrize(
    "words",
    [
        ("drive", "--linear", 0.1, "--for", 1),
        ("goto", 1, 0, "--yes"),
        ("calibrate", "gains", "--yes"),
    ],
    ids=lambda words: words[0],
)
def test_what_needs_motors_is_refused(port, words):
    assert NO_MOTORS in fails(2, *words, "--port", port)


def test_recording_has_sensors_and_no_pose(port, tmp_path):
    path = tmp_path / "air.mrl"
    mrl("record", path, "--seconds", 0.3, "--port", port)
    figures = json.loads(mrl("replay", path, "--json").stdout)
    assert (figures["robot"], figures["pose"], figures["sensors"]["light"]["most"]) == (
        "pioneer",
        None,
        500.0,
    )
    with pytest.raises(ConfigError, match="holds no odometry, because pioneer is a board without motors"):
        drive_plot.draw(drive_data.read(RecordedDriver(str(path))), "unused.png")


def test_live_view_shows_the_sensors_without_a_map_and_drives_nothing():
    emulated = factory.make(factory.Options(robot="pioneer"))
    with contextlib.closing(emulated), SteppedDriver(emulated.engine) as driver:
        driver.wait(1.0)
        screen = Screen(driver, Settings(), FrameLog())
        screen.press("\n", 0.0)
        screen.press("up", 0.0)
        screen.steer(0.0)
        console = Console(file=io.StringIO(), width=100, height=30)
        console.print(render(screen.content(time.monotonic()), 100, 30))
        text = console.file.getvalue()
    assert "this board has no motors: no driving" in text and "500 count" in text
    assert not [words for words in ("path", "motion", "battery", "last stop") if words in text]
