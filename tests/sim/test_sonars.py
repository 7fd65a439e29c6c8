"""The sonar chain, and what the environment sensors sense, up to the frames of both engines."""

import math

import pytest

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.environment_sensors import DustPulses, dust_share
from sim_arduino.hardware.sonars import FULL_COUNT, SonarChain, SonarErrors, count_of
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.scene import PIXEL_RAD, Environment, Scene, Source
from sim_arduino.world.world import Wall, World
from sim_arduino.world.world_file import load

MOUNTS = models.load("traxbot").sonars
VOLT = 1024 / 5.0
WALL = World([Wall(1.1, -9, 1.1, 9)])  # 1 m before the front sonar


def chain(world=WALL, pose=lambda time_s: Pose(0.0, 0.0, 0.0)):
    sonars = SonarChain(MOUNTS, world, pose)
    sonars.power(True, 0.0)
    return sonars


def counts(sonars, time_s):
    return [int(sonars.volts(channel, time_s) * VOLT) for channel in range(3)]


OTHER_CURVE = SonarErrors(gain=1.05, exponent=1.03, offset=-0.01)


@pytest.mark.parametrize("centimetres", [15, 20, 50, 100, 200, 400])
@pytest.mark.parametrize("errors", [SonarErrors(), OTHER_CURVE])
def test_the_thesis_curve_gives_the_distance_back(centimetres, errors):
    count = count_of(centimetres / 100, errors)
    found = errors.gain * 1.1767 * count ** (errors.exponent * 0.94657) - 0.3759 + 100 * errors.offset
    assert found == pytest.approx(centimetres, abs=0.6)


def test_what_is_nearer_than_the_dead_zone_reads_as_its_edge():
    assert count_of(0.05) == count_of(0.15)


def test_nothing_in_range_is_the_full_count_of_another_curve():
    """Which reaches farther than the sonar before its voltage is at its end."""
    assert count_of(float("inf")) == FULL_COUNT
    assert count_of(6.4, OTHER_CURVE) < count_of(float("inf"), OTHER_CURVE) == FULL_COUNT


def test_sensors_take_turns_of_100_ms():
    sonars = chain()
    sonars.trigger(0.3)
    ready = [[bool(count) for count in counts(sonars, time_s)] for time_s in (0.399, 0.41, 0.51, 0.61)]
    assert ready == [[False] * 3, [True, False, False], [True, True, False], [True] * 3]


def test_a_robot_without_a_left_sonar_has_nothing_on_its_input():
    mounts = {name: mount for name, mount in MOUNTS.items() if name != "left"}
    sonars = SonarChain(mounts, WALL, lambda time_s: Pose(0.0, 0.0, 0.0))
    sonars.power(True, 0.0)
    sonars.trigger(0.3)
    assert [count > 0 for count in counts(sonars, 1.0)] == [True, False, True]


def test_a_trigger_during_warm_up_is_lost():
    sonars = chain()
    sonars.trigger(0.2)
    assert counts(sonars, 1.0) == [0, 0, 0]


def test_echo_is_of_the_moment_the_sensor_fires():
    """The robot moves on afterwards; the front sonar fired at the start of its round."""
    sonars = chain(pose=lambda time_s: Pose(0.0 if time_s <= 0.3 else 0.5, 0.0, 0.0))
    sonars.trigger(0.3)
    assert counts(sonars, 0.45)[0] == count_of(1.0)


def test_a_round_that_runs_ends_after_the_trigger_goes_low():
    sonars = chain()
    sonars.hold(True, 0.3)
    sonars.hold(False, 0.7)
    assert sonars.next_s < 0.91
    sonars.advance(0.91)
    assert sonars.next_s == float("inf")


def test_power_that_returns_under_a_held_trigger_starts_a_round():
    sonars = chain()
    sonars.hold(True, 0.3)
    sonars.power(False, 0.5)
    sonars.power(True, 1.0)
    assert counts(sonars, 1.36)[0] > 0


TRAXBOT = models.load("traxbot")
HERE = Pose(0.0, 0.0, 0.0)
AMBIENT = Environment()


def sensed(pose=HERE, walls=(), **sources):
    world = World(walls, scene=Scene(**sources))
    return world.scene.sensed(AMBIENT, pose, world.sees)


@pytest.mark.parametrize(
    ("x_m", "share"), [(0.0, 1.0), (0.5, 1 / math.e), (50.0, 0.0)], ids=["middle", "reach", "far"]
)
def test_a_source_is_its_share_of_the_difference_from_what_is_around_it(x_m, share):
    around = sensed(**{kind: (Source(x_m, 0, value, 0.5),) for kind, value in (("light", 900), ("gas", 250))})
    assert around.light_count == round(500 + 400 * share)
    assert around.alcohol_count == round(AMBIENT.alcohol_count + (250 - AMBIENT.alcohol_count) * share)


@pytest.mark.parametrize(("yaw", "walls"), [(0.0, [Wall(1, -1, 1, 1)]), (math.pi, [])])
def test_heat_behind_a_wall_or_behind_the_robot_is_not_seen(yaw, walls):
    around = sensed(Pose(0, 0, yaw), walls, heat=(Source(2, 0, 60, 0.1),))
    assert around.pixels_c == AMBIENT.pixels_c


def test_the_first_pixel_is_the_leftmost():
    angle = 3.5 * PIXEL_RAD
    pixels = sensed(heat=(Source(math.cos(angle), math.sin(angle), 60, 0.02),)).pixels_c
    assert pixels.index(max(pixels)) == 0


@pytest.mark.parametrize("pcs_l", [50, 300, 5500, 9000, 30000])
def test_share_of_low_time_is_the_curve_backwards(pcs_l):
    r = 100 * dust_share(pcs_l)
    assert (1.1 * r**3 - 3.8 * r**2 + 520 * r) / 0.2832 == pytest.approx(pcs_l, rel=1e-6)


@pytest.mark.parametrize("pcs_l", [300, 5500, 20000])
def test_dust_pulses_have_their_length_and_share(pcs_l):
    edges = DustPulses(lambda time_s: pcs_l).edges(1000.0)
    widths = [rise - fall for (fall, _), (rise, _) in zip(edges[::2], edges[1::2])]
    assert 0.0099 <= min(widths) <= max(widths) <= 0.0901
    assert sum(widths) / 1000.0 == pytest.approx(dust_share(pcs_l), rel=0.02)
    assert DustPulses(lambda time_s: 0.0).edges(100.0) == []


def test_a_board_reports_the_hazards_of_its_place():
    plant = Plant(TRAXBOT, load("hazards"), (3.3, 3.8, 0.0), sonars=False)
    board = PythonBoard(plant, environment=True)
    board.receive(b"@21e@20e")
    out = board.advance(0.5)
    assert b"@21,9000e" in out
    assert b"@20,123e" in out


def bearing(north_deg, yaw_deg):
    world = World(scene=Scene(north_rad=math.radians(north_deg)))
    plant = Plant(TRAXBOT, world, (0.0, 0.0, math.radians(yaw_deg)))
    plant.i2c[0x60].write(b"\x02", 0.0)
    return int.from_bytes(plant.i2c[0x60].read(2, 0.0), "big") / 10


@pytest.mark.parametrize(
    "north, yaw, expected", [(90, 90, 0), (90, 0, 90), (0, 0, 0), (0, 90, 270), (30, 0, 30)]
)
def test_the_compass_counts_clockwise_from_the_worlds_north(north, yaw, expected):
    assert bearing(north, yaw) == pytest.approx(expected)


def test_sources_that_add_up_to_more_than_the_converter_takes_saturate_it():
    scene = Scene(gas=(Source(0.0, 0.0, 0.0, 1.0),) * 2, light=(Source(0.0, 0.0, 1000.0, 1.0),) * 3)
    sensed = scene.sensed(scene.ambient, Pose(0.0, 0.0, 0.0), lambda *_: True)
    assert (sensed.alcohol_count, sensed.light_count) == (0, 1023)
