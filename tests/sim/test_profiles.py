"""What is particular to the Python board, and the boards of 2013 with their faults."""

from functools import partial

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import COMMANDS, SETTINGS
from mrl_driver.robot import models, wiring
from mrl_driver.robot.chips import ATMEGA328P
from sim_arduino.board import PythonBoard, handlers, parameter_store
from sim_arduino.board.board2013 import Board2013
from sim_arduino.board.parameter_store import Config
from sim_arduino.board.uart import IN_BYTE_S, OUT_BYTE_S
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory
from sim_arduino.world.world import Wall, World

TRAXBOT = models.load("traxbot")
JANUARY = partial(Board2013, january=True)
BOTH = pytest.mark.parametrize("profile", [Board2013, JANUARY])


class Bench:
    """A board of 2013, awake."""

    def __init__(self, profile=Board2013, **options):
        self.plant = Plant(TRAXBOT, options.pop("world", None), sonars=options.pop("sonars", True))
        self.board = profile(self.plant, **options)
        self.now_s = 0.0
        self.run(3.5)
        self.commands()

    def run(self, seconds):
        self.now_s += seconds
        return self.board.advance(self.now_s)

    def send(self, data, wait_s=0.1):
        self.board.receive(data)
        return self.run(wait_s)

    def commands(self):
        log = [(each.code, *each.values) for each in self.plant.motor_board.commands]
        self.plant.motor_board.commands.clear()
        return log


@pytest.mark.parametrize("profile, boot_s", [(Board2013, 3.35), (JANUARY, 0.10)])
def test_sets_itself_up_and_then_answers_what_waited(profile, boot_s):
    """On the chip the first answer begins 3.35 s (August: a pause of 3 s for its sensors) and 0.10 s after a reset."""
    board = profile(Plant(TRAXBOT))
    board.receive(b"@17e")
    assert board.advance(boot_s - 0.01) == b""
    assert board.advance(boot_s + 0.01) == b"@17,0e\r\n"


@BOTH
def test_set_up_tells_the_motor_board_11_ms_after_a_reset(profile):
    """Stop, no time-out, counts of 0, prescalers of 1, gains, ramp and geometry."""
    plant = Plant(TRAXBOT)
    profile(plant).advance(0.09)
    told = [(command.code, *command.values) for command in plant.motor_board.commands]
    assert plant.motor_board.commands[0].time_s == pytest.approx(0.011)
    assert told == [
        (0xFC,),
        (0xF1, 0),
        (0xEF, 1, 0),
        (0xEF, 3, 0),
        (0xF0, 1, 0),
        (0xF0, 3, 0),
        (0xF4, 700, 400, 200),
        (0xEC, 2500, 0),
        (0xEA, 8700, 2700, 437, 640),
    ]


@pytest.mark.parametrize(
    "profile, start, hz",
    [
        (Board2013, 18, 325.5),
        (JANUARY, 18, 759),
        (Board2013, 23, 168),
        (Board2013, 25, 163),
        (Board2013, 27, 1054),
    ],
)
def test_rates_of_the_streams(profile, start, hz):
    """As on the chip, with a robot that stands at (0, 0), north ahead; the thermopile takes most of 23 and 25."""
    bench = Bench(profile, sonars=start == 18)
    if hz == 325.5:  # frames of 27 bytes
        bench.send(b"@4,3,-567e@4,1,1234e@7e", wait_s=0.5)
    bench.send(b"@%de" % start)
    assert bench.run(1.0).count(b"\n") == pytest.approx(hz, rel=0.02)


def test_streams_of_august_go_on_until_each_is_stopped():
    """18 comes before 23, 23 before 27, 27 before 25; 17 tells of 18 alone."""
    bench = Bench(sonars=False)
    bench.send(b"@25e@27e@23e@18e")
    seen = []
    for stop in (b"@19e", b"@24e", b"@28e", b"@26e"):
        seen += [
            {frame.code for frame in FrameDecoder(REPLIES).feed(bench.run(0.2)) if isinstance(frame, Frame)}
        ]
        bench.send(stop, wait_s=0.3)
    assert seen == [{8}, {23}, {27}, {25}]
    bench.send(b"@23e")
    assert b"@17,0e\r\n" in bench.send(b"@17e", wait_s=0.3)


def test_command_behind_a_stream_waits_for_a_frame_per_byte():
    """One byte a pass: the 13 bytes of a move take about 13 frames, 40 ms."""
    bench = Bench()
    bench.send(b"@7e", wait_s=0.5)
    bench.send(b"@18e")
    before = bench.now_s
    bench.send(b"@11,500,-800e")
    command = bench.plant.motor_board.commands[-1]
    assert command.code == 0xEB
    assert command.time_s - before == pytest.approx(0.040, abs=0.004)


@pytest.mark.parametrize(
    "request_bytes, reached",
    [
        (b"@11,500,-800e", [(0xEB, 500, -800)]),
        (b"@11,-1,0e", []),
        (b"@11,50@13e", []),
        (b"@11,50@13e@13e", [(0xFC,)]),
        (b"@13xe", [(0xFC,)]),
        (b"@1x3e", [(0xFB, 1, 0, 0)]),
        (b"@ 13e", [(0xFC,)]),
        (b"@-13e", []),
        (b"@11,5x0,0e", [(0xEB, 5, 0)]),
        (b"@11,,5e", []),
        (b"@11,65535,0e", []),
        (b"@13,7,8e", [(0xFC,)]),
        (b"@9,1,40,1,40e", [(0xF8, 1, 0, 40)]),
        (b"@11,12345678,0e", []),
        (b"@11,65636,0e", [(0xEB, 100, 0)]),
        (b"@99e", []),
        (b"@11,100,200,300,400,500,600,700,800e@13e", [(0xFC,)]),
        (b"@13," + b"7" * 26 + b"e", [(0xFC,)]),
        (b"@13," + b"7" * 27 + b"e", []),
        (b"@13," + b"7" * 29 + b"@13e", [(0xFC,)]),
    ],
)
def test_parser(request_bytes, reached):
    bench = Bench()
    bench.send(request_bytes)
    assert bench.commands() == reached


def test_stale_commands_are_carried_out_after_a_stall():
    bench = Bench()
    bench.now_s += 5.0
    bench.board.gap(bench.now_s, b"@11,300,0e")
    bench.run(0.1)
    assert bench.commands() == [(0xEB, 300, 0)]


@pytest.mark.parametrize(("walls", "centimetres"), [([Wall(1.1, -9, 1.1, 9)], 150), ([], 805)])
def test_sonars_read_half_as_far_again(walls, centimetres):
    """The curve's first constant is 1.767 instead of 1.1767: 1 m reads 150 cm, and nothing in range 805 cm."""
    bench = Bench(world=World(walls))
    bench.send(b"@7e", wait_s=0.5)
    frame = FrameDecoder(REPLIES).feed(bench.send(b"@7e"))[0]
    assert frame.args[0] == pytest.approx(centimetres, abs=2)


@BOTH
def test_sonars_read_0_until_the_first_request_has_started_them(profile):
    bench = Bench(profile, world=World([Wall(1.1, -9, 1.1, 9)]))
    assert bench.send(b"@7e", wait_s=0.5) == b"@7,0,0,0e\r\n"
    frame = FrameDecoder(REPLIES).feed(bench.send(b"@7e", wait_s=0.5))[0]
    assert min(frame.args) > 0


@pytest.mark.parametrize(
    "request_bytes, text",
    [
        (b"@15e", b"[INFO] Got message: @15e\r\n[INFO] Debug mode is ON!\r\n@15,1e\r\n"),
        (b"@99e", b"[INFO] Got message: @99e\r\n[ERROR] Unknown action: 99\r\n"),
    ],
)
def test_debug_text_has_lines_of_its_own_and_echoes_the_frame(request_bytes, text):
    bench = Bench()
    bench.send(b"@16,1e")
    assert bench.send(request_bytes) == text


@pytest.mark.parametrize("request_bytes, address", [(b"@22e", 0x68), (b"@27e", 0x60)])
def test_a_sensor_that_is_missing_hangs_the_board_until_a_reset(request_bytes, address):
    bench = Bench(sonars=False)
    bench.plant.i2c[address].present = False
    assert bench.send(request_bytes + b"@17e", wait_s=5.0) == b""
    bench.board.reset()
    assert bench.send(b"@17e", wait_s=4.0) == b"@17,0e\r\n"


@pytest.mark.parametrize("robot_id, has_them", [(5, False), (6, True)])
def test_robot_id_implies_environment_sensors(robot_id, has_them):
    emulated = factory.make(factory.Options(profile="2013-august", robot_id=robot_id))
    emulated.engine.advance(4.0)
    emulated.engine.receive(b"@20e")
    assert (emulated.engine.advance(4.1) == b"@20,123e\r\n") == has_them
    emulated.close()


UNASKED = {"xbee_text"}  # Rows that only the board sends, and only with a radio
OF_OTHER_BOARDS = {"discover_xbee", "xbee_text", "read_virtual_pose"}


def test_every_row_has_its_handlers():
    names = {row.name for row in COMMANDS}
    assert names - UNASKED == set(handlers.REQUESTS)
    replies = {row.name for row in COMMANDS if row.reply and row.name not in handlers.REPLIES}
    assert replies <= OF_OTHER_BOARDS and set(handlers.REPLIES) <= names


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


@pytest.mark.parametrize("board", [PythonBoard, Board2013])
def test_a_host_with_another_rate_is_not_understood(board):
    board = board(Plant(TRAXBOT))
    board.set_host_baud(9600.0)
    board.advance(4.0)
    board.receive(b"@5e")
    assert board.advance(5.0).strip(b"\xff") == b""
    board.set_host_baud(115200.0)
    board.receive(b"@5e")
    assert board.advance(6.0).startswith(b"@5,")


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


def test_the_wiring_has_a_block_of_its_own():
    """An older board keeps its parameters and has no pins; so does one whose block is damaged."""
    values = parameter_store.first(23, models.load_packaged("duo"))
    eeprom = bytearray(parameter_store.image(values))
    assert Config(eeprom, pins=wiring.rows(ATMEGA328P)).values == values
    old = Config(bytearray(parameter_store.image(values[: len(SETTINGS)])), pins=wiring.rows(ATMEGA328P))
    assert old.sound and old.pins == wiring.EMPTY and old["bridge"] == values[19]
    for place in range(96, 96 + 1 + len(wiring.rows(ATMEGA328P)) + 2):
        eeprom[place] ^= 0x10
        damaged = Config(eeprom, pins=wiring.rows(ATMEGA328P))
        assert damaged.pins == wiring.EMPTY and damaged.values[: len(SETTINGS)] == values[: len(SETTINGS)]
        eeprom[place] ^= 0x10
    config = Config(eeprom, pins=wiring.rows(ATMEGA328P))
    config.set_defaults()
    assert config.values == parameter_store.defaults(23) + values[len(SETTINGS) :]


IMAGE_BYTES = [*range(4), *range(16, 16 + 1 + 2 * len(SETTINGS) + 2)]


def test_every_damaged_byte_is_noticed():
    def sound(place):
        eeprom = bytearray(parameter_store.image(parameter_store.defaults(1)))
        eeprom[place] ^= 0x10
        return Config(eeprom).sound

    assert [place for place in IMAGE_BYTES if sound(place)] == []
