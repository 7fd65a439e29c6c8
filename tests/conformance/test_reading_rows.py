"""Rows that read encoders, sonars and environment sensors, once or as a stream."""

import math

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from sim_arduino.world.world import Wall, World

from .bench import CAPABILITIES

COUNT_CM = 1  # What rounding the curve in integers may cost
SONARS_READY_S = 0.6


def box(front_m, side_m):
    """Walls at a distance ahead and to both sides, long enough to fill the sonars' cones."""
    return World([Wall(front_m, -9, front_m, 9), Wall(-9, side_m, 9, side_m), Wall(-9, -side_m, 9, -side_m)])


def test_encoders_are_right_then_left(bench):
    bench.ask("preset_encoder", 3, 1234)
    bench.ask("preset_encoder", 1, -567)
    assert bench.reply("read_encoders") == (1234, -567)


def test_encoders_wrap_at_16_bits(bench):
    bench.ask("preset_encoder", 3, 32767)
    bench.ask("preset_encoder", 1, 32767)
    bench.ask("move_differential", 300, 0, wait_s=1.0)
    right, left = bench.reply("read_encoders")
    assert right < -30000
    assert left < -30000


def test_sonars_say_no_reading_before_they_are_ready(make):
    bench = make(wake=False)
    bench.run(0.25)
    assert bench.reply("read_sonars") == (-1, -1, -1)


def test_sonars_measure_the_walls(make):
    """Front sonar 0.1 m ahead of the middle; the side ones see their wall at the cone's edge, 63 deg off."""
    bench = make(world=box(1.6, 1.06))
    bench.run(SONARS_READY_S)
    front, left, right = bench.reply("read_sonars")
    side = 100 * 1.0 / math.sin(math.radians(63))
    assert (front, left, right) == pytest.approx((150, side, side), abs=COUNT_CM)


def test_sonars_that_see_nothing_say_645(make):
    bench = make(world=World())
    bench.run(SONARS_READY_S)
    assert bench.reply("read_sonars") == (645, 645, 645)


def test_sonars_without_power_are_invalid(make):
    bench = make()
    bench.plant.sonars.power(False, bench.now_s)
    bench.run(SONARS_READY_S)
    assert bench.reply("read_sonars") == (-1, -1, -1)


def test_encoders_and_sonars_together(make):
    bench = make(world=World())
    bench.run(SONARS_READY_S)
    assert bench.reply("read_encoders_and_sonars") == (0, 0, 645, 645, 645)


# ---- streams


def frames(bench, seconds):
    return FrameDecoder(REPLIES, bench.checked).feed(bench.run(seconds))


def test_stream_repeats_the_reply_of_8_at_its_period(bench):
    bench.ask("start_stream", 20)
    got = frames(bench, 1.0)
    assert {event.code for event in got if isinstance(event, Frame)} == {8}
    assert len(got) == pytest.approx(50, abs=1)


def test_stream_without_a_period_fills_the_wire(bench):
    """85.0 us a byte."""
    bench.ask("start_stream")
    assert len(bench.run(1.0)) >= 0.97 / 85.0e-6


def test_stream_ends(bench):
    bench.ask("start_stream", 20)
    bench.ask("stop_stream")
    assert bench.run(0.2) == b""


def test_get_stream(bench):
    assert bench.reply("get_stream") == (0,)
    bench.ask("start_stream", 10000)
    assert bench.reply("get_stream")[-1:] == (1,)


def test_requests_are_answered_between_the_frames_of_a_full_stream(bench):
    bench.ask("start_stream")
    got = bench.ask("read_protocol", wait_s=0.02)
    assert Frame(29, (2, CAPABILITIES[bench.motors])) in got


def test_another_streams_end_leaves_this_one_running(bench):
    bench.ask("start_stream", 20)
    bench.ask("stop_compass_stream")
    assert frames(bench, 0.1)


# ---- environment sensors


@pytest.mark.parametrize(
    "name",
    [
        "read_alcohol",
        "read_dust",
        "read_thermopile",
        "read_light",
        "read_compass",
        "start_sensor_stream",
        "start_sensor_ldr_stream",
        "start_compass_stream",
    ],
)
def test_sonar_build_has_no_environment_sensors(bench, name):
    assert bench.ask(name) == []
    assert bench.counters() == {"unavailable": 1}


@pytest.mark.parametrize("name", ["stop_sensor_stream", "stop_sensor_ldr_stream", "stop_compass_stream"])
def test_ending_a_stream_that_does_not_run_is_no_error(bench, name):
    assert bench.ask(name) == []
    assert bench.counters() == {}


def test_alcohol_is_1023_minus_the_count(sensors):
    sensors.plant.environment.alcohol_count = 700
    sensors.run(0.1)
    assert sensors.reply("read_alcohol") == (323,)


def test_thermopile(sensors):
    sensors.plant.environment.pixels_c = tuple(range(30, 38))
    assert sensors.reply("read_thermopile", wait_s=0.2) == tuple(range(30, 38))


def test_light_and_compass_by_request(sensors):
    sensors.plant.environment.light_count = 321
    sensors.run(0.1)
    assert sensors.reply("read_light") == (321,)
    assert sensors.reply("read_compass", wait_s=0.2) == (90,)


def test_missing_thermopile_is_refused_and_a_fault(sensors):
    sensors.plant.i2c[0x68].present = False
    assert sensors.ask("read_thermopile", wait_s=0.2) == []
    assert sensors.counters() == {"unavailable": 1}
    assert sensors.status().faults == 16


def test_environment_build_has_no_sonars(sensors):
    assert sensors.reply("read_sonars") == (-1, -1, -1)


def test_sensor_stream(sensors):
    sensors.plant.environment.alcohol_count = 1000
    sensors.plant.environment.pixels_c = (20.0,) * 7 + (41.0,)
    sensors.ask("preset_encoder", 3, 7)
    sensors.ask("preset_encoder", 1, -8)
    sensors.ask("start_sensor_stream", 100)
    sensors.run(0.5)
    right, left, alcohol, _, hottest = frames(sensors, 0.5)[-1].args
    assert (right, left, alcohol, hottest) == (7, -8, 23, 41)


def test_sensor_stream_with_light(sensors):
    sensors.plant.environment.light_count = 321
    sensors.ask("start_sensor_ldr_stream", 100)
    sensors.run(0.5)
    assert frames(sensors, 0.5)[-1].args[-1] == 321


def test_compass_runs_clockwise_from_north(sensors):
    sensors.ask("start_compass_stream", 100)
    sensors.run(0.5)
    assert frames(sensors, 0.5)[-1] == Frame(27, (90,))


@pytest.mark.parametrize("name, args", [("send_xbee", (0, 0, 0, 1, 1, 0x4100)), ("discover_xbee", ())])
def test_boards_without_a_radio_refuse(bench, name, args):
    assert bench.ask(name, *args) == []
    assert bench.counters() == {"unavailable": 1}
