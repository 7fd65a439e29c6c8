"""Other robots hold this one by radio: what the driver knows and does."""

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.hold_text import HoldText, is_newer
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from mrl_driver.robot.hold import Hold
from sim_arduino.board import PythonBoard
from sim_arduino.board.parameter_store import first, image
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import RadioFit, XBee, packet
from tests.models import model

BOARD, HOLDER = 0x0013A20040000001, 0x0013A20040000002
SILENCE = 20
SILENCE_S = SILENCE * 0.1
POLLED_S = 0.6
HEARD_S = 0.1


def stepped(radio_hold):
    """A TraxBot whose board has a radio and this parameter; its host has connected."""
    traxbot = model("traxbot")
    values = first(traxbot.ids[0], traxbot)
    values[PARAMETER_BY_NAME["radio_hold"].number] = radio_hold
    plant = Plant(traxbot, radio=RadioFit(BOARD))
    robot = SteppedDriver(PythonBoard(plant, eeprom=bytearray(image(values))), traxbot)
    robot.peer = XBee(plant.world.radio, "holder", RadioFit(HOLDER), lambda: (0.0, 0.0))
    return robot


@pytest.fixture
def robot():
    with stepped(SILENCE) as made:
        made.wait(SILENCE_S)
        yield made


def say(robot, kind, number=1):
    head = b"\x10\0" + BOARD.to_bytes(8, "big") + b"\xff\xfe\0\0"
    robot.peer.receive(packet(head + HoldText(kind, number).data), robot.now_s)
    robot.wait(HEARD_S)


def test_started_board_is_known_to_listen():
    with stepped(SILENCE) as robot:
        robot.wait(HEARD_S)
        assert robot.radio.hold.state == "listening" and not robot.drive(0.1, 0.0)


def test_hold_ends_the_command(robot):
    robot.drive(0.2, 0.0)
    robot.wait(HEARD_S)
    say(robot, "hold")
    assert robot.radio.hold == Hold("held", 1, 0, 0, HOLDER)
    assert robot.command is None and robot.stop_reason is StopReason.HELD


def test_freed_robot_waits_for_a_new_command(robot):
    robot.drive(0.2, 0.0)
    say(robot, "hold")
    say(robot, "free")
    assert robot.command is None and robot.drive(0.2, 0.0)


def test_changes_are_events(robot):
    states = []
    robot.on_event(lambda event: states.append(event.state) if isinstance(event, Hold) else None)
    say(robot, "hold")
    robot.wait(SILENCE_S)
    say(robot, "free")
    assert states == ["held", "silent", "free"]


def test_host_that_connects_to_a_held_board_knows_it(robot):
    """A reply that was lost on the way is asked for again."""
    say(robot, "hold")
    robot._core.hold, robot._core.held = None, False
    robot.wait(POLLED_S)
    assert robot.radio.hold.held


def test_silent_holder_is_released(robot):
    say(robot, "hold")
    robot.wait(SILENCE_S)
    assert "release the hold" in str(robot.radio.hold)
    assert robot.radio.release_hold()
    robot.wait(HEARD_S)
    assert robot.drive(0.2, 0.0)


def test_speaking_holder_is_not_released(robot):
    say(robot, "hold")
    assert not robot.radio.release_hold()
    assert robot.radio.hold.held


def test_board_without_a_radio_has_no_holds():
    with SteppedDriver(PythonBoard(Plant(model("traxbot"))), model("traxbot")) as robot:
        assert robot.radio.hold is None
        with pytest.raises(ConfigError, match="radio build"):
            robot.radio.release_hold()


@pytest.mark.parametrize("data", [b"", b"1 12 2 11", b"\xf8H\0", b"\xf8h\0\1\0", b"\xf8x\0\1"])
def test_other_texts_are_no_hold_texts(data):
    assert HoldText.parse(data) is None


@pytest.mark.parametrize(
    "number, than, newer", [(2, 1, True), (1, 1, False), (0, 0xFFFF, True), (0xFFFF, 0, False)]
)
def test_numbers_of_holds_wrap(number, than, newer):
    assert is_newer(number, than) is newer
