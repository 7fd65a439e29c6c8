"""Range sensors of an H-bridge board: distances, what is missing or far, echoes that stay high, and analog ones."""

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import RANGE_HELD, RANGE_INVALID, RANGE_NOTHING
from mrl_driver.robot.models import SonarMount
from mrl_driver.robot.sonar import input_range_m
from sim_arduino.hardware import echo_ranges
from sim_arduino.hardware.echo_ranges import HELD, SILENT, sound_m_s
from sim_arduino.world.world import Wall, World
from tests.models import four_wheels, model

NO_MORE = (RANGE_INVALID,) * 3  # inputs for which the Uno has no pins
ROUND_S, HELD_S = 0.2, 0.45  # longer than three turns, and than six and one more
SETTLED_S = 1.5
PHASES, PHASE_S = 64, 4.125e-3  # the battery has a turn every 8 ms
ECHO_MM = 0.5e-3 * 40e-6 * 343.4e3 * 1e3  # way of the sound in half of 40 us
PINS = {
    **dict.fromkeys(("pin_sonar_front", "pin_sonar_left", "pin_sonar_right", "pin_battery"), -1),
    **dict.fromkeys(("pin_sonar_trigger", "pin_sonar_power"), -1),
    "pin_range_1_trigger": 13,
    "pin_range_1_echo": 14,
    "pin_range_2_trigger": 15,
    "pin_range_2_echo": 12,  # on a port with channels of an encoder
    "pin_range_3_trigger": 16,
    "pin_range_3_echo": 17,
}
SONARS = {
    "nose": SonarMount(0.0, 0.0, 0.0, "range_1"),
    "left": SonarMount(0.0, 0.0, 90.0, "range_2"),
    "back": SonarMount(0.0, 0.0, 180.0, "range_3"),
}
WALLS = World([Wall(1.0, -9, 1.0, 9), Wall(-0.2, 0.25, 9, 0.25)])
"""1 m ahead, 25 cm to the left, nothing behind."""


@pytest.fixture
def ranges(make):
    """Makes the robot of this file."""

    def made(sonars=SONARS, **board):
        robot = model("duo")._replace(sonars=sonars)
        return make(robot=robot, board={**PINS, **board}, world=WALLS, pose=Pose(0.0, 0.0, 0.0))

    return made


def read(bench, wait_s=ROUND_S):
    bench.run(wait_s)
    return bench.reply("read_ranges")


def test_ranges_are_those_of_the_walls(ranges):
    nose, left, back, *more = read(ranges())
    assert nose == pytest.approx(1000, abs=ECHO_MM) and left == pytest.approx(250, abs=ECHO_MM)
    assert back == RANGE_NOTHING and tuple(more) == NO_MORE


def test_a_mega_has_six(make):
    """Echoes on external interrupts, and on two groups of pins."""
    names = [f"pin_range_{i}_{pin}" for i in range(1, 7) for pin in ("trigger", "echo")]
    board = dict(zip(names, (30, 2, 31, 18, 32, 19, 33, 50, 34, 51, 35, 10)))
    around = {f"at_{i}": SonarMount(0.0, 0.0, 90.0 * i, f"range_{i}") for i in range(1, 7)}
    robot = four_wheels("skid")._replace(sonars=around)
    bench = make(robot=robot, board=board, world=WALLS, pose=Pose(0.0, 0.0, 0.0))
    left, ahead = pytest.approx(250, abs=ECHO_MM), pytest.approx(1000, abs=ECHO_MM)
    found = (left, RANGE_NOTHING, RANGE_NOTHING, ahead, left, RANGE_NOTHING)
    assert read(bench, 2 * ROUND_S) == found and bench.reply("read_board")[3] == 0b111111
    bench.plant.ranges.failed["range_6"] = HELD
    assert read(bench, HELD_S)[5] == RANGE_HELD


ANALOG = {"pin_range_2_trigger": -1, "pin_range_2_echo": 16, "pin_range_3_trigger": -1}
"""The second sensor and the third one are analog, on A2 and A3."""


def test_without_a_trigger_a_range_is_the_count_of_its_voltage(ranges):
    bench = ranges(**ANALOG)
    volts = {"range_2": 1.25, "range_3": 5.0}
    bench.plant.range_volts.update((name, lambda _, v=v: v + 1e-3) for name, v in volts.items())
    assert read(bench, SETTLED_S) == (pytest.approx(1000, abs=ECHO_MM), 256, 1023, *NO_MORE)
    assert bench.status().faults == 0 and bench.reply("read_board")[3] == 0b111


def test_the_count_of_a_sharp_gives_the_distance_of_the_wall(ranges):
    sharp = SONARS["left"]._replace(type="GP2Y0A21")
    bench = ranges({**SONARS, "left": sharp}, **ANALOG)
    assert input_range_m(read(bench)[1], sharp.kind) == pytest.approx(0.25, abs=2e-3)


ALL_ANALOG = {
    **dict.fromkeys(PINS, -1),
    **{"pin_range_1_echo": 17, "pin_range_2_echo": 18, "pin_range_3_echo": 19, "i2c": 0},
    **{"pin_sonar_front": 14, "pin_sonar_trigger": 12, "pin_battery": 16, "battery_divider": 4000},
}


def test_analog_ranges_the_battery_and_sonars_take_turns(make):
    """Whatever the time between them: the battery's turns begin anew with its divider."""
    sonar = SonarMount(0.0, 0.0, 180.0, "front")
    robot, start = model("duo")._replace(sonars={"front": sonar}), Pose(2.0, 0.0, 0.0)
    bench = make(robot=robot, board=ALL_ANALOG, world=World([Wall(0.0, -9, 0.0, 9)]), pose=start)
    for i in range(1, 4):
        bench.plant.range_volts[f"range_{i}"] = lambda _, i=i: (100 * i + 0.5) * 5 / 1024
    bench.plant.robot.set_battery(7.4)
    bench.run(SETTLED_S)
    assert bench.reply("robot_info")[2] == pytest.approx(740, abs=4)
    for _ in range(PHASES):
        for divider in (0, 4000):
            bench.write_config("battery_divider", divider)
        bench.run(PHASE_S)
        assert bench.reply("read_ranges") == (100, 200, 300, *NO_MORE)
        assert bench.reply("read_sonars")[0] == pytest.approx(200, abs=1)
    bench.run(ROUND_S)
    assert bench.reply("robot_info")[2] == pytest.approx(740, abs=4)


def test_the_board_says_which_ranges_it_has(ranges):
    assert ranges(pin_range_2_trigger=-1, pin_range_2_echo=-1).reply("read_board")[3] == 0b101


@pytest.mark.parametrize("air_c", [-20, 45])
def test_the_speed_of_sound_is_that_of_the_stated_temperature(ranges, air_c):
    bench = ranges(air_temperature=air_c)
    assert read(bench)[0] == pytest.approx(1000 * sound_m_s(air_c) / sound_m_s(20), abs=ECHO_MM)


def test_a_missing_echo_is_told_from_a_far_one(ranges):
    bench = ranges()
    bench.plant.ranges.failed["range_1"] = SILENT
    nose, _, back, *_ = read(bench)
    assert (nose, back) == (RANGE_INVALID, RANGE_NOTHING)
    assert bench.status().faults == 0


@pytest.mark.parametrize("others", [{}, dict.fromkeys(list(PINS)[-4:], -1)], ids=["three", "one"])
def test_a_long_echo_of_a_sensor_that_sees_nothing_is_not_a_held_one(ranges, monkeypatch, others):
    """Some modules end it after 200 ms."""
    monkeypatch.setattr(echo_ranges, "NOTHING_S", 0.2)
    bench = ranges({"nose": SONARS["back"]._replace(input="range_1")}, **others)
    bench.run(2 * ROUND_S)
    for _ in range(8):
        assert read(bench, ROUND_S / 2)[0] == RANGE_NOTHING
    assert bench.status().faults == 0


def test_an_echo_held_high_is_a_fault_until_it_ends(ranges):
    bench = ranges()
    bench.plant.ranges.failed["range_2"] = HELD
    nose, left, *_ = read(bench, HELD_S)
    assert nose == pytest.approx(1000, abs=ECHO_MM) and left == RANGE_HELD
    assert bench.status().faults == 16
    bench.plant.ranges.failed.clear()
    assert read(bench)[1] == pytest.approx(250, abs=ECHO_MM)
    bench.status()
    assert bench.status().faults == 0


def test_other_boards_have_no_ranges(omni3md):
    assert omni3md.ask("read_ranges") == [] and omni3md.counters() == {"unavailable": 1}
