"""The boards of 2013 and their faults."""

import pytest

from mrl_driver import robots
from mrl_driver.codec import REPLIES, Frame, FrameDecoder
from sim_arduino.plant import Plant
from sim_arduino.profile_rows import through_single_precision
from sim_arduino.profiles import Board2013August, Board2013January
from sim_arduino.world import Wall, World

TRAXBOT = robots.load("traxbot")
BOTH = pytest.mark.parametrize("profile", [Board2013August, Board2013January])


class Bench:
    """A board of 2013, awake."""

    def __init__(self, profile=Board2013August, **options):
        self.plant = Plant(TRAXBOT, options.pop("world", None))
        self.board = profile(self.plant, **options)
        self.now_s = 0.0
        self.run(3.2)
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


@BOTH
def test_reports_version_1(profile):
    assert Bench(profile).send(b"@5e") == b"@5,2500,172,1360,1,1e\r\n"


@BOTH
def test_boots_for_seconds_and_then_answers_what_waited(profile):
    board = profile(Plant(TRAXBOT))
    board.receive(b"@15e")
    assert board.advance(2.4) == b""
    assert board.advance(2.6) == b"@15,0e\r\n"


@pytest.mark.parametrize("profile, code", [(Board2013August, 8), (Board2013January, 6)])
def test_stream(profile, code):
    bench = Bench(profile)
    frames = FrameDecoder(REPLIES).feed(bench.send(b"@18e"))
    assert {frame.code for frame in frames} == {code}


def test_stream_rate_of_august():
    """325.5 Hz on the chip, with frames of 27 bytes."""
    bench = Bench()
    bench.send(b"@4,3,-567e@4,1,1234e@18e")
    assert bench.run(1.0).count(b"\n") == pytest.approx(325.5, abs=2)


def test_stream_has_no_period():
    bench = Bench()
    assert bench.send(b"@18,100e", wait_s=0.5).count(b"\n") > 100


def test_command_behind_a_stream_waits_for_a_frame_per_byte():
    """One byte a pass: the 13 bytes of a move take about 13 frames, 40 ms."""
    bench = Bench()
    bench.send(b"@18e")
    before = bench.now_s
    bench.send(b"@11,500,-800e")
    command = bench.plant.motor_board.commands[-1]
    assert command.code == 0xEB
    assert command.time_s - before == pytest.approx(0.040, abs=0.004)


def test_input_buffer_overflows_behind_a_stream():
    """Above about 26 commands a second."""
    bench = Bench()
    bench.send(b"@18e")
    for i in range(60):
        bench.send(b"@11,100,-%de" % (100 + i), wait_s=1 / 60)
    assert len([command for command in bench.commands() if command[0] == 0xEB]) < 40


def test_commands_behind_a_slow_enough_host_all_arrive():
    bench = Bench()
    bench.send(b"@18e")
    for i in range(20):
        bench.send(b"@11,100,-%de" % (100 + i), wait_s=1 / 20)
    assert len([command for command in bench.commands() if command[0] == 0xEB]) == 20


# ---- parser


@pytest.mark.parametrize(
    "request_bytes, reached",
    [
        (b"@11,500,-800e", [(0xEB, 500, -800)]),
        (b"@11,-1,0e", []),
        (b"@11,5e", []),
        (b"@11,50@13e", []),
        (b"@11,50@13e@13e", [(0xFC,)]),
        (b"@13xe", [(0xFC,)]),
        (b"@1x3e", [(0xFC,)]),
        (b"@1\xb23e", [(0xFC,)]),
        (b"@11,5x0,0e", [(0xEB, 50, 0)]),
        (b"@13,7,8e", [(0xFC,)]),
        (b"@9,1,40,1,40e", [(0xF8, 1, 0, 40)]),
        (b"@11,12345678,0e", []),
        (b"@11,65636,0e", [(0xEB, 100, 0)]),
        (b"@99e", []),
        (b"@e", []),
        (b"@11,100,200,300,400,500,600,700,800e@13e", [(0xFC,)]),
    ],
)
def test_parser(request_bytes, reached):
    bench = Bench()
    bench.send(request_bytes)
    assert bench.commands() == reached


def test_some_speeds_come_out_one_off():
    """Through single-precision metres and back, cut off: 740 of the 65536 values."""
    assert sum(through_single_precision(value) != value for value in range(-32768, 32768)) == 740


# ---- what it does not do


def test_nothing_stops_the_motors_when_the_host_falls_silent():
    bench = Bench()
    bench.send(b"@11,100,0e", wait_s=10.0)
    assert bench.plant.true_pose.x_m > 0.9


def test_a_failed_read_is_reported_as_0():
    bench = Bench()
    bench.send(b"@4,1,5e")
    bench.plant.motor_board.present = False
    assert bench.send(b"@6e") == b"@6,0,0e\r\n"


def test_stale_commands_are_carried_out_after_a_stall():
    bench = Bench()
    bench.now_s += 5.0
    bench.board.gap(bench.now_s, b"@11,300,0e")
    bench.run(0.1)
    assert bench.commands() == [(0xEB, 300, 0)]


@pytest.mark.parametrize("request_bytes", [b"@29e", b"@30e", b"@32,1,31085e", b"@33,250,-20000e"])
def test_commands_of_later_firmware_are_unknown(request_bytes):
    assert Bench().send(request_bytes) == b""


# ---- values


def test_sonars_read_half_as_far_again():
    """The curve's first constant is 1.767 instead of 1.1767: 1 m reads 150 cm."""
    bench = Bench(world=World([Wall(1.1, -9, 1.1, 9)]))
    frame = FrameDecoder(REPLIES).feed(bench.send(b"@7e"))[0]
    assert frame.args[0] == pytest.approx(150, abs=2)


def test_nothing_in_range_is_a_long_distance():
    bench = Bench(world=World())
    assert bench.send(b"@7e") == b"@7,806,806,806e\r\n"


def test_debug_text_stands_on_the_line_of_the_reply_and_echoes_the_frame():
    bench = Bench()
    bench.send(b"@16,1e")
    assert bench.send(b"@6e") == b"[INFO] received @6e @6,0,0e\r\n"


def test_boards_without_motors_report_999():
    bench = Bench(robot_id=7)
    frame = FrameDecoder(REPLIES).feed(bench.send(b"@23e"))[0]
    assert frame.args[:2] == (999, 999)


@pytest.mark.parametrize("start, stop, code", [(23, 24, 23), (25, 26, 25), (27, 28, 27)])
def test_sensor_streams(start, stop, code):
    bench = Bench()
    frames = FrameDecoder(REPLIES).feed(bench.send(b"@%de" % start))
    assert {frame.code for frame in frames if isinstance(frame, Frame)} == {code}
    bench.send(b"@%de" % stop)
    assert bench.run(0.1) == b""


def test_answers_every_command_of_2013():
    """1 to 28: what the table gives a reply is answered, nothing else is."""
    bench = Bench()
    answered = set()
    for code in range(1, 29):
        if code in (18, 23, 25, 27):
            continue
        arguments = {
            2: b",1,2,3",
            3: b",1,0",
            4: b",1,0",
            9: b",1,2",
            10: b",1,2",
            11: b",1,2",
            12: b",1,2,3",
            16: b",0",
        }
        events = FrameDecoder(REPLIES).feed(bench.send(b"@%d" % code + arguments.get(code, b"") + b"e"))
        answered |= {event.code for event in events}
    assert answered == {5, 6, 7, 8, 15, 17, 20, 21, 22}


def test_reset_button_boots_again():
    bench = Bench()
    bench.send(b"@18e")
    bench.board.reset()
    assert bench.run(2.0) == b""
    assert bench.send(b"@17e", wait_s=1.0) == b"@17,0e\r\n"
