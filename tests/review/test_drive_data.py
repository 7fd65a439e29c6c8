"""The arrays of a recorded drive are what the driver had, and what was on the wire."""

import math
import random

import numpy as np
import pytest

from mrl_driver.apps.review.drive_data import Frames, read
from mrl_driver.apps.review.findings import find
from mrl_driver.apps.review.page import render
from mrl_driver.driver import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from sim_arduino.serve import factory
from tests.models import without_encoders

STOP = b"@13e"


class Driven:
    """A drive with a stop by its user, one by its timeout and one by a dead encoder; and what the driver had in it."""

    def __init__(self, path):
        board = factory.make(
            factory.Options(robot="traxbot", name="data", imu=True, faults=("encoder_open:at=5",))
        )
        self.telemetry = []
        with SteppedDriver(board.engine, options=Options(record=path)) as robot:
            robot.on_telemetry(self.telemetry.append)
            robot.wait(1.0)
            for speed in (0.2, 0.2, 0.0):
                self._drive(robot, speed)
            robot.stop()
            robot.wait(0.3)
            self._drive(robot, 0.2)
            robot.wait(1.2)
            for _ in range(3):
                self._drive(robot, 0.2)
        board.close()
        self.data = read(RecordedDriver(path))
        with open(path, "rb") as file:
            self.raw = file.read()

    def _drive(self, robot, speed):
        for _ in range(4):
            robot.drive(speed, 0.0)
            robot.wait(0.1)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    return Driven(str(tmp_path_factory.mktemp("data") / "drive.mrl"))


def test_poses_counts_and_stamps_are_those_of_the_driver(driven):
    data, had = driven.data, driven.telemetry[-1]
    assert len(data.poses.time_s) == len(data.counts.time_s) == len(data.stamps_s) == len(data.speeds.time_s)
    assert data.poses.values[-1].tolist() == list(had.pose)
    assert data.counts.values[-1].tolist() == list(had.counts)
    assert data.stamps_s[-1] == pytest.approx(had.stamp_s, abs=1e-9)
    commands = data.commands
    assert commands.values.max(axis=0).tolist() == pytest.approx([0.2, 0.0, 0.0])
    assert commands.values[-1].tolist() == [0.0, 0.0, 0.0], "a stop"
    assert np.all(np.diff(commands.time_s) >= 0.0)


def test_sensors_and_delays_are_those_of_the_wire(driven):
    """Readings of a sonar are each there once; the bias of the gyro is unknown until it is learned."""
    data = driven.data
    assert set(data.ranges) == {"front", "left", "right"}
    assert 0.25 < np.median(np.diff(data.ranges["front"].time_s)) < 0.35
    bias = data.imu.values[:, 4]
    assert np.isnan(bias[0]) and not np.isnan(bias[-1])
    assert data.imu.values[-1, 3] == pytest.approx(9.8, abs=0.2)
    assert 0.0 < np.median(data.round_trips.values) < 0.02
    assert 0.0 <= data.delays.values.min() and np.median(data.delays.values) < 0.01


def test_each_stop_has_its_cause_once_and_the_frame_that_proves_it(driven):
    reasons = [stop.reason for stop in driven.data.stops]
    assert reasons == ["user", "command_timeout", "wheel_mismatch"]
    for stop in driven.data.stops:
        assert stop.direction == ">"
        assert stop.data.startswith(STOP)
    assert "left wheel moved" in driven.data.stops[-1].text


def test_all_frames_are_kept_with_their_bytes(driven):
    data = driven.data
    first = data.heard.at(0.0)
    assert first.startswith(b"@29,") and first.endswith(b"e")
    assert data.sent.at(math.inf, 13).startswith(STOP)
    assert data.garbage == [] and len(data.lost.time_s) == 0 and data.skipped_lines == 0


def test_the_frame_at_a_time_is_the_next_one_else_the_last():
    frames = Frames()
    for time_s, code, data in ((1.0, 8, b"a"), (2.0, 30, b"bc"), (3.0, 8, b"d")):
        frames.add(time_s, code, data)
    assert [frames.at(t, *codes) for t, *codes in ((0.0,), (1.5,), (1.5, 8), (2.5, 30), (9.0,), (0.0, 5))] == [
        b"a", b"bc", b"d", b"bc", b"d", b"",
    ]  # fmt: skip


def test_a_recording_without_a_robot_has_no_data(tmp_path):
    path = tmp_path / "silent.mrl"
    path.write_text(
        '#mrl-recording 1 {"port": "/dev/ttyACM0"}\n0.000000 ! opened /dev/ttyACM0\n0.100000 > @5e\n'
    )
    with pytest.raises(ConfigError, match="holds no answer of a robot"):
        read(RecordedDriver(str(path)))


def test_a_board_without_motors_has_sensors_no_poses_and_a_page(tmp_path):
    path = str(tmp_path / "pioneer.mrl")
    board = factory.make(factory.Options(robot="pioneer", name="sensing"))
    with SteppedDriver(board.engine, options=Options(record=path)) as robot:
        robot.wait(3.0)
    board.close()
    data = read(RecordedDriver(path))
    assert data.poses.values.shape == (0, 3) and data.counts.time_s.shape == (0,)
    assert len(data.sensors["thermopile"].time_s) > 1
    assert find(data) == []
    page = render(data, [])
    assert "The robot was not stopped" in page and "Light" in page


def test_a_pose_that_is_set_is_no_way(tmp_path):
    path, board = (
        str(tmp_path / "drive.mrl"),
        factory.make(factory.Options(robot="traxbot", footprint="none")),
    )
    with SteppedDriver(board.engine, options=Options(record=path)) as robot:
        for x_m in (10.0, -5.0):
            for _ in range(10):
                robot.drive(0.2, 0.0)
                robot.wait(0.1)
            robot.reset_pose(Pose(x_m, 0.0, 0.0))
        robot.stop()
        robot.wait(1.0)
        driven_m = robot.telemetry.counts.right * robot.model.drive.metres_per_count
    board.close()
    drive = read(RecordedDriver(path))
    assert drive.path_length_m == pytest.approx(driven_m, abs=0.01)
    assert np.abs(drive.steps(every=4)).max() < 0.1


def test_motors_without_encoders_have_a_page_without_a_way(tmp_path):
    path, robot_file = str(tmp_path / "drive.mrl"), without_encoders(tmp_path)
    board = factory.make(factory.Options(robot=robot_file, name="open loop"))
    with SteppedDriver(board.engine, models.load(robot_file), Options(record=path)) as robot:
        for _ in range(40):
            robot.drive(0.2, 0.5)
            robot.wait(0.1)
    board.close()
    data = read(RecordedDriver(path))
    assert find(data) == [] and not np.isfinite(data.poses.values).any()
    page = render(data, [])
    assert "Distance" not in page and "Ranges" in page


@pytest.mark.parametrize("seed", range(6))
def test_a_damaged_recording_is_read_and_searched(driven, tmp_path, seed):
    """It is cut, or lacks lines besides that of the fault, or some of its bytes are others."""
    rng = random.Random(seed)
    first, *lines = driven.raw.splitlines(keepends=True)
    lines = [line for line in lines if rng.random() > 0.02 * (seed % 3) or b" ! stop wheel_mismatch" in line]
    lines = lines[rng.randrange(len(lines) // 2) if seed % 2 else 0 :]
    data = bytearray(b"".join(lines))
    for _ in range(50 * (seed // 3)):
        data[rng.randrange(len(data))] = rng.randrange(256)
    path = tmp_path / "damaged.mrl"
    path.write_bytes(first + data)
    found = find(read(RecordedDriver(str(path))))
    assert found[0].kind in ("encoder_dead", "bad_cable", "noise_bursts")
    assert all(each.text and each.remedy for each in found)


def test_damage_without_end_is_refused_and_readings_of_a_phone_take_no_memory(driven, tmp_path, monkeypatch):
    """A recording of another baud rate; each damaged piece takes more memory than its bytes."""
    monkeypatch.setattr("mrl_driver.apps.review.drive_data.MOST_KEPT", 1000)
    path, after = tmp_path / "drive.mrl", b"%.6f " % (driven.data.duration_s + 1.0)
    path.write_bytes(driven.raw + after + b'! phone {"time_s": 1}\n')
    assert read(RecordedDriver(str(path))).remarks == driven.data.remarks
    path.write_bytes(driven.raw + after + b"< " + b"z@6,e@" * 1000 + b"\n")
    words = "more than 1000 damaged pieces and events .* check port and baud rate"
    with pytest.raises(ConfigError, match=words):
        read(RecordedDriver(str(path)))
