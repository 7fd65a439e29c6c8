"""What is particular to the Python board; what all boards share stands in tests/conformance."""

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder, encode_request
from mrl_driver.protocol.table import COMMANDS, PARAMETERS
from mrl_driver.robot import models
from sim_arduino.board import PythonBoard, parameter_store, registry
from sim_arduino.board.parameter_store import Config
from sim_arduino.board.uart import IN_BYTE_S, OUT_BYTE_S
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory

TRAXBOT = models.load("traxbot")
UNASKED = {"xbee_text"}  # Rows that only the board sends, and only with a radio
RADIO = {"discover_xbee", "xbee_text"}


def test_every_row_has_its_handlers():
    names = {row.name for row in COMMANDS}
    assert names - UNASKED == set(registry.REQUESTS)
    replies = {row.name for row in COMMANDS if row.reply and row.name not in registry.REPLIES}
    assert replies <= RADIO and set(registry.REPLIES) <= names


def awake(**options):
    board = PythonBoard(Plant(TRAXBOT), **options)
    board.advance(1.0)
    return board


@pytest.fixture(params=["python", "avr"])
def drives(request):
    """A board that drives since 0.5 s, on both engines; its motor board has forgotten what led to it."""
    robot = factory.make(factory.Options(engine=request.param, name="stopped"))
    robot.engine.advance(0.3)
    robot.engine.receive(b"@11,300,0e")
    robot.engine.advance(0.5)
    robot.plant.motor_board.commands.clear()
    yield robot
    robot.close()


def test_a_reset_stops_the_motors_within_2_ms(drives):
    drives.engine.reset()
    drives.engine.advance(0.502)
    assert [command.code for command in drives.plant.motor_board.commands][:1] == [0xFC]


def test_a_request_takes_the_wires_time_both_ways():
    board = awake()
    board.receive(b"@15e")
    needed_s = 4 * IN_BYTE_S + 8 * OUT_BYTE_S
    assert board.advance(1.0 + needed_s - 1e-6) == b"@15,0e\r"
    assert board.advance(1.0 + needed_s + 1e-6) == b"\n"


def talk(steps):
    """What a driving board streams in 3 s that are made in so many steps."""
    board = PythonBoard(Plant(TRAXBOT))
    board.receive(b"@18,20e@11,200,300e")
    return b"".join(board.advance(3.0 * (i + 1) / steps) for i in range(steps))


def test_other_steps_give_the_same_frames():
    """One long step or many short ones, but for one count where a rounding tips over."""
    one, many = (FrameDecoder(REPLIES).feed(talk(steps)) for steps in (1, 777))
    assert len(one) == len(many) > 100
    for first, second in zip(one, many):
        assert first.args == pytest.approx(second.args, abs=1)


@pytest.mark.parametrize("code, rate_hz", [(18, 1310.0), (23, 922.0), (27, 5555.0)])
def test_a_fast_line_waits_for_what_it_has_to_tell(code, rate_hz):
    """Rates of the image on the simulated chip at 500000 baud, frames of 30, 31 and 9 bytes."""
    board = awake(environment=code != 18)
    board.receive(encode_request(45, 2))
    board.advance(1.1)
    board.set_host_baud(500000.0)
    board.receive(b"@4,1,12345e@4,3,-23456e@%de" % code)
    board.advance(1.2)
    assert board.advance(1.7).count(b"\n") / 0.5 == pytest.approx(rate_hz, rel=0.06)


@pytest.mark.parametrize(
    ("image", "robot_id", "axis_radius", "sound"),
    [
        (parameter_store.image(parameter_store.defaults(4)), 4, 11000, True),
        (b"\xff" * 1024, 0, 8700, False),
        (b"\x00\x00\x80\x40".ljust(1024, b"\xff"), 4, 11000, False),
    ],
    ids=["fresh", "blank", "id of 2013, a little-endian float"],
)
def test_an_eeprom_gives_id_and_parameters(image, robot_id, axis_radius, sound):
    config = awake(eeprom=bytearray(image)).config
    assert (config["robot_id"], config["axis_radius"], config.sound) == (robot_id, axis_radius, sound)


IMAGE_BYTES = [*range(4), *range(16, 16 + 1 + 2 * len(PARAMETERS) + 2)]


def test_every_damaged_byte_is_noticed():
    def sound(place):
        eeprom = bytearray(parameter_store.image(parameter_store.defaults(1)))
        eeprom[place] ^= 0x10
        return Config(eeprom).sound

    assert [place for place in IMAGE_BYTES if sound(place)] == []
