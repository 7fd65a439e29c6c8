"""What is particular to the Python board; what all boards share stands in tests/conformance."""

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder, encode_request
from mrl_driver.protocol.table import BY_CODE, COMMANDS, PARAMETERS
from mrl_driver.robot import models
from sim_arduino.board import PythonBoard, parameter_store, registry
from sim_arduino.board import python_board as board_module
from sim_arduino.board.parameter_store import Config
from sim_arduino.board.uart import IN_BYTE_S, OUT_BYTE_S
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory

TRAXBOT = models.load("traxbot")
UNASKED = {"xbee_text"}
"""Rows that only the board sends, and only with a radio."""
RADIO = {"discover_xbee", "xbee_text"}


def awake(**options):
    board = PythonBoard(Plant(TRAXBOT), **options)
    board.advance(1.0)
    return board


def test_every_row_has_a_handler():
    assert {row.name for row in COMMANDS} - UNASKED - set(registry.REQUESTS) == set()


def test_every_reply_has_a_builder():
    replies = {row.name for row in COMMANDS if row.reply and row.code not in registry.REPLIES}
    assert replies - RADIO == set()


def test_no_handler_without_a_row():
    assert set(registry.REQUESTS) <= {row.name for row in COMMANDS}
    assert set(registry.REPLIES) <= set(BY_CODE)


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
    """The bootloader's second on a real Uno comes before."""
    drives.engine.reset()
    drives.engine.advance(0.502)
    assert [command.code for command in drives.plant.motor_board.commands][:1] == [0xFC]


def test_a_board_answers_2_ms_after_a_reset(drives):
    drives.engine.reset()
    drives.engine.advance(0.502)
    drives.engine.receive(b"@15e")
    assert drives.engine.advance(0.505) == b"@15,0e\r\n"


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


def test_the_same_steps_give_the_same_bytes():
    assert talk(150) == talk(150) != b""


def test_other_steps_give_the_same_frames():
    """One long step or many short ones, but for one count where a rounding tips over."""
    one, many = (FrameDecoder(REPLIES).feed(talk(steps)) for steps in (1, 777))
    assert len(one) == len(many) > 100
    for first, second in zip(one, many):
        assert first.args == pytest.approx(second.args, abs=1)


def test_next_event_of_an_idle_board_is_its_sonars():
    board = awake()
    assert 0.0 < board.next_event_s - 1.0 <= 0.312


def test_next_event_of_a_stream_is_the_end_of_its_frame():
    board = awake()
    board.receive(b"@18,100e")
    board.advance(1.05)
    frame = b""
    while not frame:
        frame = board.advance(board.next_event_s)
    assert frame.startswith(b"@8,")
    assert frame.endswith(b"\r\n")


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


def test_a_flood_is_bounded():
    """A second of requests at line rate: no more answers wait than there is room for."""
    board = awake()
    for i in range(100):
        board.receive(b"@5e" * 38)
        board.advance(1.0 + (i + 1) / 100)
    waiting = board.advance(3.0).count(b"\n")
    assert 0 < waiting <= 2 * board_module.ANSWERS, "beside those that wait, the line's own buffer has some"
    assert board.health.counters["overrun"] > 0


def test_garbage_at_line_rate_leaves_the_stream_alone():
    board = awake()
    board.receive(b"@18,20e")
    board.advance(1.1)
    out = b""
    for i in range(100):
        board.receive(b"\x80@9e," * 23)
        out += board.advance(1.1 + (i + 1) / 100)
    assert len(FrameDecoder(REPLIES).feed(out)) == pytest.approx(50, abs=1)


def test_short_gap_loses_nothing():
    board = awake()
    board.gap(1.2, b"@15e")
    assert board.advance(1.3) == b"@15,0e\r\n"


# ---- EEPROM


def test_fresh_image_holds_the_models_defaults():
    config = Config(bytearray(parameter_store.image(parameter_store.defaults(4))))
    assert (config["robot_id"], config["axis_radius"], config.sound) == (4, 11000, True)


def test_blank_eeprom_is_a_fault_and_has_no_id():
    config = Config(bytearray(b"\xff" * 1024))
    assert (config["robot_id"], config["axis_radius"], config.sound) == (0, 8700, False)


def test_id_of_2013_is_taken_from_its_float():
    """4.0 as a little-endian float at address 0, all else blank."""
    config = Config(bytearray(b"\x00\x00\x80\x40".ljust(1024, b"\xff")))
    assert (config["robot_id"], config["axis_radius"]) == (4, 11000)


IMAGE_BYTES = [*range(4), *range(16, 16 + 1 + 2 * len(PARAMETERS) + 2)]


def test_every_damaged_byte_is_noticed():
    def sound(place):
        eeprom = bytearray(parameter_store.image(parameter_store.defaults(1)))
        eeprom[place] ^= 0x10
        return Config(eeprom).sound

    assert [place for place in IMAGE_BYTES if sound(place)] == []


def test_eeprom_is_the_callers_own():
    eeprom = bytearray(parameter_store.image(parameter_store.defaults(2)))
    board = awake(eeprom=eeprom)
    assert board.config["robot_id"] == 2


def test_unset_id():
    assert awake(robot_id=0).health.has_fault("id_unset")


def test_inputs_count_for_nothing_before_a_sonars_first_reading():
    """Whatever the pins show: the sensors are ready 100 ms after one another."""
    board = PythonBoard(Plant(TRAXBOT))
    board.plant.adc_volts = lambda channel, time_s: 1.0
    ready = []
    for tenth in (3, 4, 5, 6):
        board.advance(tenth / 10)
        ready.append([value > 0 for value in board.sonars.values(board.now_s)])
    assert ready == [[False] * 3, [True, False, False], [True, True, False], [True] * 3]
