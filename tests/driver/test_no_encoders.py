"""A robot whose motors have no encoders: it drives and stops as others do, and no number pretends to be odometry."""

import math

import pytest

from mrl_driver.cli.doctor import board as doctor_board
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import load
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.view import rows, shown_state
from mrl_driver.view.series import Series
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.models import four_wheels, without_encoders


def open_loop(kind, folder):
    """A duo from its file, or a robot with four wheels."""
    if kind == "duo":
        return load(without_encoders(folder))
    model = four_wheels(kind)
    open_pins = {name: -1 for name in model.board if "encoder_" in name and name.startswith("pin_")}
    return model._replace(board={**model.board, **open_pins, "no_encoders": 1})


@pytest.fixture(params=["duo"])
def robot(request, tmp_path):
    model = open_loop(request.param, tmp_path)
    plant = Plant(model, World(), (0.0, 0.0, 0.0), footprint="none", imu=True)
    with SteppedDriver(PythonBoard(plant, model.ids[0]), model, Options()) as driver:
        driver.plant = plant
        yield driver


def drive(robot, seconds):
    for _ in range(round(seconds / 0.1)):
        robot.drive(0.3, 0.0)
        robot.wait(0.1)


@pytest.mark.parametrize("robot", ["duo", "skid", "mecanum"], indirect=True)
def test_it_drives_and_nothing_is_known_of_its_motion(robot):
    events = []
    robot.on_event(events.append)
    drive(robot, 2.0)
    telemetry = robot.telemetry
    numbers = (*robot.pose, *robot.twist, *telemetry.counts, *telemetry.spread, *telemetry.twist_variances)
    assert all(map(math.isnan, numbers)) and robot.plant.true_pose.x_m > 0.3
    assert not any(isinstance(event, Mismatch) for event in events) and robot.command is not None


def test_its_ranges_arrive(robot):
    drive(robot, 1.0)
    assert set(robot.ranges) == set(robot.model.sonars)


def test_the_command_timeout_stops_it(robot):
    drive(robot, 0.5)
    robot.wait(1.0)
    assert robot.stop_reason == StopReason.COMMAND_TIMEOUT
    assert all(motor.shares.brake == 1.0 for motor in map(robot.plant.bridge.motor, (0, 1)))


def test_its_imu_is_not_read(robot):
    robot.wait(1.0)
    assert robot.imu is None and robot.imu_state == "absent"


def test_a_pose_cannot_be_set(robot):
    with pytest.raises(ConfigError, match="has no odometry, because its motors have no encoders"):
        robot.reset_pose()


def test_each_view_says_so(robot):
    drive(robot, 0.5)
    shown = shown_state.state_of(robot)
    assert "odometry none: the motors have no encoders" in shown_state.line_of(shown)
    motion = {row.name: row.value for row in rows.sections(shown)[0].rows}
    assert motion["odometry"] == "none: no encoders" and not {"pose", "speed", "path"} & set(motion)
    snapshot = shown_state.snapshot(robot)
    assert snapshot["pose"] is None is snapshot["twist"]
    names = {name for name, _ in Series(robot).names}
    assert "asked speed" in names and not {"x", "speed", "right wheel"} & names
    found = [
        finding for finding in doctor_board.supply(robot.board, robot.model) if finding.subject == "odometry"
    ]
    assert [finding.code for finding in found] == ["no_odometry"]


def test_numbers_that_the_board_cannot_control_are_named():
    """Its pins are right, and it refuses all moves."""
    with SteppedDriver(PythonBoard(Plant(load("duo"))), load("duo")) as robot:
        assert robot.parameters.wiring_problem() == ""
        robot.parameters.write({"encoder_counts": 5})
        assert "give 48 counts/s at most, expected 51 to 25600" in robot.parameters.wiring_problem()
