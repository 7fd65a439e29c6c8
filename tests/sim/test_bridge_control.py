"""What is particular to the Python board with an H-bridge; what all boards share stands in tests/conformance."""

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder
from sim_arduino.board import PythonBoard, parameter_store
from sim_arduino.board.bridge.battery_input import CONVERSIONS, PERIOD_S, BatteryInput
from sim_arduino.board.bridge_control import MISSED_KICK_S
from sim_arduino.board.parameter_store import Config
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.models import model

DUO = model("duo")
ROLL_OUT_S = 0.3


def config(**changed):
    found = Config(bytearray(parameter_store.image(parameter_store.first(DUO.ids[0], DUO))))
    for name, value in changed.items():
        found[name] = value
    return found


@pytest.fixture
def driving():
    board = PythonBoard(Plant(DUO, World()))
    board.advance(0.1)
    board.receive(b"@11,200,0e")
    board.advance(2.1)
    return board


def is_driven(board):
    return any(motor.shares.forward or motor.shares.backward for motor in board.plant.robot.motors)


def test_the_watchdog_switches_the_outputs_of_a_standing_program_off(driving):
    before_m = driving.plant.true_pose.x_m
    driving.gap(10.0, b"")
    way_m = driving.plant.true_pose.x_m - before_m
    assert 0.2 * MISSED_KICK_S < way_m < 0.2 * (MISSED_KICK_S + ROLL_OUT_S) and not is_driven(driving)


def test_counts_go_on_while_the_program_stands_still(driving):
    """The encoders' interrupts and the sampling go on, so that none is masked."""
    driving.gap(10.0, b"")
    driving.receive(b"@6e")
    (reply,) = FrameDecoder(REPLIES).feed(driving.advance(11.0))
    assert reply.args[1] * DUO.drive.metres_per_count == pytest.approx(driving.plant.true_pose.x_m, abs=1e-3)


def test_the_battery_is_the_mean_of_16_conversions():
    counts = iter(range(500, 1000))
    battery = BatteryInput(config(battery_divider=4000), lambda channel: next(counts), 0.0)
    battery.run(PERIOD_S * CONVERSIONS - 1e-6)
    assert not battery.measured
    battery.run(PERIOD_S * CONVERSIONS + 1e-6)
    assert battery.measured and battery.centivolts == int(507.5 / 1024 * 500 * 4.0)
