"""The commands on a board without motors: sensors where there are some to show, else one line that says why not."""

import contextlib
import io
import json
import time

import pytest
from rich.console import Console

from mrl_driver.cli.commands import flash
from mrl_driver.cli.doctor import board as checks
from mrl_driver.cli.doctor.findings import NOTE, OK
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.host.named_robots import Target
from mrl_driver.review import drive_data, drive_plot
from mrl_driver.terminal.frame_log import FrameLog
from mrl_driver.terminal.live_panels import render
from mrl_driver.terminal.live_view import Screen, Settings
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard

from .run import fails, mrl

NO_MOTORS = "robot pioneer is a board without motors (drive: none): it has sensors, and something else drives"


@pytest.fixture(scope="module")
def port():
    with EmulatedBoard(robot="pioneer", robot_id=7) as board:
        yield board.port


def test_doctor_shows_the_sensors_and_no_fault(port, monkeypatch):
    monkeypatch.setattr(checks.watch, "__defaults__", (0.3, 5))
    monkeypatch.setattr(checks, "MIN_SHARE", 0.0)
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


def test_monitor_prints_the_sensors_alone(port):
    line = mrl("monitor", "--seconds", 0.3, "--port", port).stdout.splitlines()[-1]
    assert line.startswith("pioneer 7  alcohol 123 count") and "battery" not in line and " x " not in line


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


def test_flash_takes_the_build_of_its_sensors(port):
    assert flash.build_of(Target("/dev/ttyACM7", "pioneer")) == ("environment", "for pioneer")
    assert flash.build_of(Target(port)) == ("environment", "as on the board now")
    line = fails(2, "flash", "--port", port, "--robot", "pioneer", "--build", "sonar", "--yes")
    assert "--build is sonar, but robot pioneer has environment sensors, expected environment" in line


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
