"""What the commands show of a board of 2013 with environment sensors, on the emulated board in simulated time."""

import pytest

from mrl_driver.calibration import part_procedures
from mrl_driver.cli.commands.shared import await_sensors
from mrl_driver.cli.doctor import board
from mrl_driver.cli.doctor.findings import NOTE, OK, WARNING
from mrl_driver.driver.options import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.protocol import encode_reply, encode_request
from mrl_driver.recording.recording import Recording
from mrl_driver.recording.summary import summarise
from mrl_driver.review import drive_data
from sim_arduino.serve import factory

NAMES = {"alcohol", "dust", "light", "thermopile"}


class Robots:
    """Stepped drivers on emulated boards, which end together."""

    def __init__(self):
        self._made = []

    def connect(self, build="", wait_s=0.0, **board_options):
        emulated = factory.make(factory.Options(**board_options))
        driver = SteppedDriver(emulated.engine, "traxbot", options=Options(build=build))
        self._made += [(driver, emulated)]
        driver.connect()
        driver.wait(wait_s)
        return driver

    def close(self):
        for driver, emulated in self._made:
            driver.close()
            emulated.close()


@pytest.fixture(scope="module")
def robots():
    made = Robots()
    yield made
    made.close()


@pytest.fixture(scope="module")
def gas_robot(robots):
    robot = robots.connect("environment", profile="2013-august", environment=True)
    assert await_sensors(robot) == []
    return robot


def test_doctor_has_a_finding_for_each_sensor_and_none_for_sonars(gas_robot):
    sonars = list(board.sonars(gas_robot.ranges, gas_robot.board))
    assert [(each.level, each.text.partition(":")[0]) for each in sonars] == [(NOTE, "none")]
    found = list(board.sensors(gas_robot.sensors))
    assert {each.subject for each in found} == NAMES and {each.level for each in found} == {OK}


def test_curve_of_the_sonars_is_not_measured_without_one(gas_robot):
    """The robot would drive up to the wall without seeing it."""
    with pytest.raises(ConfigError, match="this board has no front sonar"):
        part_procedures.require_sonars(gas_robot)


def test_doctor_says_that_the_build_of_a_2013_board_is_taken_as_sonar(robots):
    (found,) = board.build(robots.connect(profile="2013-august"))
    assert found.level == NOTE and "write build: environment" in found.advice


def test_doctor_tells_a_named_build_that_is_not_there(robots):
    (found,) = board.build(robots.connect("sonar", environment=True))
    assert found.level == WARNING and found.advice.startswith("change the name, or flash with: mrl flash")


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
