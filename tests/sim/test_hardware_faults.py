"""Faults of encoders, wheels, battery, sonars and IMU: what they do to the edges at the board, and to the robot."""

import math
from types import SimpleNamespace

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.board import PythonBoard
from sim_arduino.faults.fault_table import FAULTS
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from tests.models import bridged, model


class Driven:
    """An engine that drives both wheels forward at full duty, and collects the edges."""

    next_event_s = math.inf

    def __init__(self, plant):
        self.plant, self.edges, self.causes = plant, [], []
        for motor in (0, 1):
            plant.bridge.write(0.0, motor, 1.0, 1.0, 0.0)

    def advance(self, to_s):
        self.plant.advance(to_s)
        self.edges += self.plant.bridge.take_edges()
        return b""

    def receive(self, data):
        pass

    def reset(self):
        self.causes.append("external")

    def brown_out(self):
        self.causes.append("brown_out")


def driven(*faults):
    return FaultyEngine(Driven(Plant(bridged())), faults)


def test_a_blocked_wheel_stands_until_it_is_free():
    engine = driven("wheel_blocked:wheel=right,at=0.3,lasts=0.3")
    wheel = engine.engine.plant.bridge.motor(1)
    speeds = []
    for to_s in (0.29, 0.59, 0.9):
        engine.advance(to_s)
        speeds.append(wheel.speed > 0.0)
    assert speeds == [True, False, True]


def test_a_brown_out_is_a_reset_with_its_own_cause():
    engine = driven("brown_out:at=0.5", "reset:at=0.7")
    engine.advance(1.0)
    assert engine.engine.causes == ["brown_out", "external"]


def ahead(*faults):
    """A TraxBot whose motor board has driven it forward for a second, with faults from the start."""
    plant = Plant(model("traxbot"))
    plant.sonars.power(True, 0.0)
    plant.sonars.hold(True, 0.0)

    engine = FaultyEngine(SimpleNamespace(plant=plant, advance=plant.advance), faults)
    plant.motor_board.move_differential(0.0, 200, 0)
    plant.advance(1.0)
    return engine, plant


@pytest.mark.parametrize(
    ("fault", "counts", "turns"),
    [
        ("encoder_open", "none", -1),
        ("encoder_swapped", "back", -1),
        ("motor_reversed", "back", 1),
        ("wheel_blocked", "none", 1),
        ("wheel_slips:grip=0", "ahead", 1),
    ],
)
def test_a_faulty_left_wheel_counts_and_moves_as_it_does_on_the_floor(fault, counts, turns):
    """Speed control follows the encoder: without one, or with a reversed one, the wheel runs away."""
    _, plant = ahead(fault)
    left, _, right = plant.motor_board.counts()
    assert {-1: "back", 0: "none", 1: "ahead"}[(left > 5) - (left < -5)] == counts
    assert right > 100
    assert plant.robot.state.yaw_rad * turns > 0.1


def test_clear_mends_motor_board_wheels_and_sonars():
    engine, plant = ahead(
        *(
            "encoder_open",
            "wheel_blocked",
            "wheel_slips",
            "motor_reversed",
            "motor_board_absent",
            "sonar_failed",
        )
    )
    motor = plant.robot.motors[0]
    broken = motor.sensed, motor.blocked, motor.polarity, plant.robot.grip[0], plant.motor_board.present
    assert broken == (0.0, True, -1.0, 0.5, False)
    engine.clear()
    mended = motor.sensed, motor.blocked, motor.polarity, plant.robot.grip[0], plant.motor_board.present
    assert mended == (1.0, False, 1.0, 1.0, True)
    assert plant.sonars.failed == {}


@pytest.mark.parametrize(("state", "shows"), [("dead", (0, 0)), ("stuck", (0, 0)), ("deaf", (645, 645))])
def test_a_failed_sonar_shows_no_reading_the_same_one_or_nothing_in_range(state, shows):
    engine, plant = ahead(f"sonar_failed:sonar=left,state={state}")
    counts = [
        [round(plant.adc_volts(channel, s) * 1024 / 5 - 0.5) for channel in range(3)] for s in (1.5, 3.0)
    ]
    assert tuple(max(0, at[1]) for at in counts) == shows
    assert counts[0][0] > counts[1][0] > 10 and counts[0][2] > 10


def measuring(*faults):
    """A Python board with an IMU whose stream has run for half a second, and what it has sent."""
    board = FaultyEngine(PythonBoard(Plant(model("traxbot"), imu=True)), faults)
    board.advance(0.2)
    board.receive(b"@47,20e")
    return board, board.advance(0.5)


@pytest.mark.parametrize("fault", ["imu_absent", "imu_power"])
def test_an_imu_that_is_gone_comes_back(fault):
    """0.5 s until the board looks for it, and 0.06 s until it has settled."""
    board, before = measuring(f"{fault}:at=0.5,lasts=0.3")
    gone, after = board.advance(0.8), board.advance(1.3)
    assert before and after
    assert gone == b""


def test_a_frozen_imu_repeats_its_reading():
    board, _ = measuring("imu_frozen:at=0.5")
    frames = board.advance(1.0).split(b"\r\n")[1:-1]
    assert len(frames) > 10
    assert len(set(frames)) == 1


def traxbot():
    return Plant(model("traxbot"))


def needing(what):
    return [name for name, kind in FAULTS.items() if kind.needs == what]


@pytest.mark.parametrize(
    ("plant", "name", "text"),
    [
        *((traxbot, name, "needs motors on an H-bridge, robot traxbot") for name in needing("bridge")),
        *((traxbot, name, "needs an IMU, the robot has none") for name in needing("imu")),
        (traxbot, "radio_cut", "needs a radio, the robot has none; expected --radio too"),
        (lambda: Plant(model("traxbot"), sonars=False), "sonar_failed", "needs sonars"),
        (lambda: Plant(model("pioneer")), "wheel_slips", "needs motors, robot pioneer has none"),
        (lambda: Plant(bridged()), "motor_reversed", "needs an OMNI-3MD, robot duo has"),
    ],
)
def test_a_robot_without_the_part_has_no_such_fault(plant, name, text):
    with pytest.raises(ConfigError, match=f"fault '{name}' {text}"):
        FaultyEngine(SimpleNamespace(plant=plant()), [name])
