"""Rows 46 to 48: an IMU beside the motors, its stream beside the other one, and its losses."""

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_NAME, CAPABILITIES, FAULTS, TICK_S
from sim_arduino.hardware.imu import MPU6050, MPU9250, ImuErrors

from . import bench as benches_

IMU, ENCODERS = BY_NAME["read_imu"].code, BY_NAME["read_encoders_and_sonars"].code
CAPABILITY = 1 << [name for name, _ in CAPABILITIES].index("imu")
FAULT = 1 << [name for name, _ in FAULTS].index("imu")
RAD_S, M_S2 = BY_NAME["read_imu"].reply[0].scale, BY_NAME["read_imu"].reply[3].scale
G_M_S2 = 9.80665
SILENT = ImuErrors(accel_noise=0.0)
RATE_RAD_S = 0.02  # What the ripple of the speed control makes of a constant rate
FRAMES = 1
JITTER_S = 0.5e-3
BACK_S = 1.15
"""From the return of an IMU to its frames: 1.01 s until its address has been asked, 0.06 s until it has settled."""


@pytest.fixture
def fitted(benches):
    return benches("omni3md", imu=True, imu_errors=SILENT)


def frames(bench, seconds):
    return [event for event in FrameDecoder(REPLIES, bench.checked).feed(bench.run(seconds))]


def count(events, code):
    return sum(event.code == code for event in events if isinstance(event, Frame))


def steps(times):
    return [(after - before) % 65536 * TICK_S for before, after in zip(times, times[1:])]


def true_rate(bench):
    left, right = bench.wheels()
    return (right - left) / bench.model.drive.wheel_separation_m


def test_a_board_without_an_imu_says_so(bench):
    assert bench.reply("read_protocol")[1] == benches_.CAPABILITIES[bench.motors]
    assert bench.ask("read_imu") == []
    assert bench.ask("start_imu_stream", 20) == []
    assert bench.counters() == {"unavailable": 2}


def test_a_board_with_one_has_the_capability(make):
    bench = make(imu=True)
    assert bench.reply("read_protocol")[1] == benches_.CAPABILITIES[bench.motors] + CAPABILITY
    assert bench.status().faults == 0


def test_at_rest_it_measures_gravity(fitted):
    gx, gy, gz, ax, ay, az = fitted.reply("read_imu")
    assert (gx, gy, gz, ax, ay) == (0, 0, 0, 0, 0)
    assert az * M_S2 == pytest.approx(G_M_S2, abs=M_S2)


def test_in_a_turn_it_measures_the_rate(fitted):
    fitted.ask("move_differential", 0, 1000, wait_s=fitted.ramped_s)
    rate = fitted.reply("read_imu")[2] * RAD_S
    assert rate == pytest.approx(true_rate(fitted), abs=RATE_RAD_S)
    assert rate > 0.8


def test_the_environment_build_has_it_beside_the_thermopile(benches):
    bench = benches("omni3md", environment=True, imu=True, imu_errors=SILENT)
    assert bench.reply("read_imu")[5] * M_S2 == pytest.approx(G_M_S2, abs=M_S2)
    assert len(bench.reply("read_thermopile", wait_s=0.2)) == 8


def test_the_environment_build_does_not_take_its_thermopile_for_one(benches):
    bench = benches("omni3md", wake=False, environment=True, imu=True)
    bench.plant.i2c[0x68] = bench.plant.i2c.pop(0x69)
    bench.wake()
    assert not bench.reply("read_protocol")[1] & CAPABILITY


def test_another_chip_at_its_address_is_not_an_imu(benches):
    bench = benches("omni3md", wake=False, imu=True)
    bench.plant.imu.who_am_i = 0x12
    bench.wake()
    assert not bench.reply("read_protocol")[1] & CAPABILITY


# ---- the stream


def test_its_stream_runs_beside_the_other_one_until_its_own_end(fitted):
    fitted.ask("start_stream", 20)
    fitted.ask("start_imu_stream", 20)
    both = frames(fitted, 0.4)
    assert (count(both, ENCODERS), count(both, IMU)) == pytest.approx((20, 20), abs=FRAMES)
    assert fitted.ask("stop_stream")
    alone = frames(fitted, 0.2)
    assert (count(alone, ENCODERS), count(alone, IMU)) == (0, pytest.approx(10, abs=FRAMES))
    fitted.ask("stop_imu_stream")
    assert frames(fitted, 0.1) == []


def test_a_stream_without_a_period_lets_it_pass_when_it_is_due(fitted):
    fitted.ask("start_stream")
    assert count(fitted.ask("start_imu_stream", 100), IMU) == 1
    assert count(frames(fitted, 0.4), IMU) == 4


def test_its_frames_keep_their_times_if_its_period_fits(fitted):
    fitted.ask("set_check", 1)
    fitted.ask("start_imu_stream", 10)
    fitted.ask("start_stream", 20)
    times = [event.stamp.time for event in frames(fitted, 0.4)[4:] if event.code == IMU]
    assert steps(times) == pytest.approx([0.01] * (len(times) - 1), abs=JITTER_S)


@pytest.mark.parametrize("period_ms", [20, 17])
def test_frames_of_the_encoders_keep_their_times(fitted, period_ms):
    fitted.ask("set_check", 1)
    fitted.ask("start_imu_stream", period_ms)
    fitted.ask("start_stream", 20)
    times = [event.stamp.time for event in frames(fitted, 0.4) if event.code == ENCODERS]
    assert len(times) >= 19
    assert steps(times) == pytest.approx([0.02] * (len(times) - 1), abs=JITTER_S)


def test_all_stamped_frames_share_one_sequence(fitted):
    """The IMU is read directly after the counters that are due with it."""
    fitted.ask("set_check", 1)
    fitted.ask("start_imu_stream", 20)
    fitted.ask("start_stream", 20)
    got = frames(fitted, 0.3)[4:]
    sequence = [event.stamp.sequence for event in got]
    assert sequence == list(range(sequence[0], sequence[0] + len(got)))
    pairs = [(a, b) for a, b in zip(got, got[1:]) if (a.code, b.code) == (ENCODERS, IMU)]
    assert len(pairs) > 10
    assert all(0 <= (b.stamp.time - a.stamp.time) * TICK_S < 1.5e-3 for a, b in pairs)


# ---- losses


def test_an_imu_that_vanishes_is_a_fault_and_stops_nothing(fitted):
    fitted.ask("move_differential", 300, 0)
    fitted.ask("start_imu_stream", 20)
    fitted.plant.imu.present = False
    fitted.run(0.05)
    assert frames(fitted, 0.1) == []
    assert fitted.status().faults == FAULT
    assert fitted.is_driven() and fitted.stop_reason() == "none"


def test_an_imu_that_is_back_is_set_up_and_read_again(fitted):
    fitted.ask("start_imu_stream", 20)
    fitted.plant.imu.present = False
    fitted.run(0.1)
    fitted.plant.imu.power_cycle()
    fitted.plant.imu.present = True
    assert count(frames(fitted, BACK_S), IMU)
    fitted.ask("stop_imu_stream")
    fitted.status()
    assert fitted.status().faults == 0


@pytest.mark.parametrize("who_am_i", [MPU6050, MPU9250])
def test_readings_of_a_chip_that_lost_its_settings_are_not_sent(fitted, who_am_i):
    """An MPU-6050 sleeps, others measure on with another scale; both are set up again."""
    imu = fitted.plant.imu
    imu.who_am_i = who_am_i
    imu.sensor = type(imu.sensor)(fitted.model.imu, SILENT._replace(gyro_bias_rad_s=(0.0, 0.0, 1.0)))
    fitted.ask("start_imu_stream", 10)
    imu.power_cycle()
    got = [event.args for event in frames(fitted, 0.3)]
    assert len(got) == pytest.approx(23, abs=3)
    assert {round(gyro_z * RAD_S, 2) for _, _, gyro_z, *_ in got} == {1.0}
