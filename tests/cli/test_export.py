"""`mrl export`: recordings for other programs, read back with their libraries; with ROS where it is, and without."""

import csv
import errno
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros1.decoder import DecoderFactory
from rosbags.rosbag1 import Reader

from mrl_driver.driver.options import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, OutputError
from ros1_bridge.export import message_files
from sim_arduino.serve import factory
from tests.waiting import PATIENCE_S

from .run import fails, mrl

ROS = "genpy genmsg rosbag std_msgs sensor_msgs nav_msgs tf2_msgs diagnostic_msgs geometry_msgs rosgraph_msgs"
"""Packages of ROS that an export could use."""


def drive(path, seconds=2.0, robot="traxbot", **options):
    """Record a curve in simulated time; after a pause of the host, many frames arrive at once."""
    board = factory.make(factory.Options(robot=robot, **options)).engine
    with SteppedDriver(board, robot, Options(record=str(path))) as driver:
        for _ in range(round(seconds / 0.1)):
            driver.drive(0.2, 0.5)
            driver.wait(0.1)
        driver.pause(0.2)
        driver.wait(0.1)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "drive.mrl"
    drive(path)
    return path


@pytest.fixture(scope="module")
def telemetry(recording):
    """What the driver's listeners got."""
    found, robot = [], RecordedDriver(str(recording))
    robot.on_telemetry(found.append)
    robot.play()
    return found


def export(recording, name, *options):
    """Export to a file beside the recording; the file."""
    output = recording.with_name(name)
    done = mrl("export", recording, output, "--yes", *options)
    assert done.returncode == 0, done.stderr
    return output


@pytest.fixture(scope="module")
def mcap(recording):
    return export(recording, "drive.mcap", "--name", "robot1")


@pytest.fixture(scope="module")
def messages(mcap):
    """Channel and message of each, in the order of the file."""
    with open(mcap, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (channel, message)
            for _, channel, _, message in reader.iter_decoded_messages(log_time_order=False)
        ]


def of_topic(messages, topic):
    return [message for channel, message in messages if channel.topic == topic]


def in_bag(path):
    """Topic, checksum of the type, latched, arrival and bytes of each message."""
    with Reader(Path(path)) as bag:
        return [
            (
                each.topic,
                getattr(each, "digest", None) or each.md5sum,
                each.ext.latching,
                time_ns,
                bytes(data),
            )
            for each, time_ns, data in bag.messages()
        ]


def test_poses_are_those_of_the_driver(messages, telemetry):
    points = [message.pose.pose.position for message in of_topic(messages, "/robot1/odom")]
    assert points and [(each.x, each.y) for each in points] == [each.pose[:2] for each in telemetry]


def test_stamps_are_board_time_on_the_wall_clock(messages, telemetry, recording):
    ahead_s = RecordedDriver(str(recording)).clock_ahead_s
    stamps = [each.header.stamp.to_nsec() / 1e9 for each in of_topic(messages, "/robot1/odom")]
    assert stamps == pytest.approx([ahead_s + each.stamp_s for each in telemetry], abs=1e-6)


def test_damaged_bytes_are_warnings_with_their_reason(tmp_path, recording):
    damaged = tmp_path / "damaged.mrl"
    damaged.write_text(recording.read_text() + "9.0 < @8,1,2,3\\xffe\\r\\n\n")
    with open(export(damaged, "damaged.mcap"), "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [message for *_, message in reader.iter_decoded_messages("/frames") if message.level == 4]
    assert [(each.msg, bool(each.function)) for each in found[-1:]] == [("@8,1,2,3\\xffe", True)]


def test_without_ros_the_messages_are_the_same_byte_for_byte(recording):
    """Types too, by their checksums; where ROS is missing, both are made without it."""
    with_ros, without = export(recording, "with.bag"), recording.with_name("without.bag")
    code = f"import sys; sys.modules.update(dict.fromkeys({ROS!r}.split())); sys.argv[0] = 'mrl'; "
    code += "import runpy; runpy.run_module('mrl_driver', run_name='__main__')"
    command = [sys.executable, "-c", code, "export", str(recording), str(without)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, env=environment)
    assert done.returncode == 0, done.stderr
    assert in_bag(with_ros) == in_bag(without) and len(in_bag(without)) > 200


@pytest.fixture(scope="module")
def rows(recording):
    with open(export(recording, "drive.csv"), newline="") as file:
        return list(csv.DictReader(file))


def test_a_table_has_a_row_for_each_telemetry(rows, telemetry):
    assert rows and [(float(row["x_m"]), float(row["yaw_rad"])) for row in rows] == [
        (each.pose.x_m, each.pose.yaw_rad) for each in telemetry
    ]


def test_a_table_has_speeds_and_ranges(rows, telemetry):
    """A cell is empty only if nobody has measured its value."""
    assert [float(row["speed_m_s"]) for row in rows] == [each.twist.linear_m_s for each in telemetry]
    for row, each in zip(rows, telemetry):
        seen = float(row["sonar_front_m"] or "nan")
        assert seen == pytest.approx(each.ranges.get("front", math.nan), nan_ok=True)
    assert any(row["sonar_front_m"] for row in rows)


def test_a_damaged_clock_is_moved_into_the_range_of_ros(recording, tmp_path):
    header, _, rest = recording.read_text().partition("\n")
    damaged = tmp_path / "damaged.mrl"
    damaged.write_text(f"{header}\n0.0 ! clock 1e300\n{rest}")
    assert len(in_bag(export(damaged, "damaged.bag"))) > 200


# -- errors


def test_a_file_that_exists_stays(recording, tmp_path):
    old = tmp_path / "old.csv"
    old.write_text("old")
    fails(ConfigError.exit_code, "export", recording, old)
    assert old.read_text() == "old"


def test_a_recording_is_not_its_own_output(recording, tmp_path):
    alias = tmp_path / "alias.csv"
    alias.symlink_to(recording)
    assert "is the recording" in fails(ConfigError.exit_code, "export", recording, alias, "--yes")


@pytest.mark.parametrize("method", ["add", "write", "close"])
def test_a_message_that_cannot_be_written_ends_the_export(recording, tmp_path, monkeypatch, method):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    old = tmp_path / "drive.mcap"
    old.write_text("old")
    monkeypatch.setattr(message_files.Mcap, method, full)
    words = fails(OutputError.exit_code, "export", recording, old, "--yes")
    assert f"{old} cannot be written: No space left" in words
    assert old.read_text() == "old" and os.listdir(tmp_path) == [old.name]


@pytest.mark.parametrize("name", ["my robot", "r\u00f6bot", "a//b", "1st"])
def test_a_namespace_that_ros_would_refuse_is_refused(recording, tmp_path, name):
    words = fails(ConfigError.exit_code, "export", recording, tmp_path / "drive.bag", "--name", name)
    assert f"--name is {name!r}" in words and not os.listdir(tmp_path)
