"""The times of messages: ours beside two sketches, on the simulated chip.  `make comparison` builds the sketches."""

from statistics import median

import pytest

from mrl_driver.errors import BoardTimeout
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.experiments import message_times, trials, turnaround
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.message_times import CHECKED, PLAIN, ROSSERIAL, TIMING_2013, packet

EARLIER_US = {TIMING_2013: 2445.0, ROSSERIAL: 2896.0}
"""Turnaround of the released firmware and of ros_lib: README, "The firmware, measured" [us]."""
AS_EARLIER = 0.03
MESSAGES = 3


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trials, "SEEDS", 1)
        return turnaround.run(
            Setting(str(tmp_path_factory.mktemp("turnaround"))), turnaround.Topics(1.0, 2.0)
        )


@pytest.fixture(scope="module")
def rows(result):
    return {row.key: row for row in result.rows}


@pytest.mark.parametrize("mode", ["plain", "checked"])
def test_messages_take_less_time_than_those_of_the_sketch_in_the_same_mode(rows, mode):
    row = rows[f"{mode}_20_ms"]
    assert row.ours <= row.worst < row.control


def test_checked_messages_are_compared_with_rosserial_at_the_same_baud_rate(rows):
    assert rows["checked_20_ms"].control == rows["rosserial_115200_20_ms"].ours


def test_messages_to_a_topic_are_those_of_the_default_mode(rows):
    """20 checked messages, and 20 times the time from frame to topic."""
    assert rows["ros_20_ms"].ours == rows["checked_20_ms"].ours + 20.0


def test_published_time_is_shorter_than_the_serial_link_needs(rows):
    assert (
        turnaround.PUBLISHED_MS * (1 - turnaround.LESS) < rows["link_20_ms"].ours < rows["plain_20_ms"].ours
    )


def test_picture_is_drawn(result):
    assert result.pictures == ["turnaround.png"]


@pytest.mark.parametrize("sketch", EARLIER_US, ids=lambda sketch: sketch.key)
def test_sketch_needs_the_time_of_the_earlier_measurement(sketch):
    found = message_times.measure(Setting(""), sketch, MESSAGES)
    assert 1e6 * median(message.reply_s for message in found) == pytest.approx(
        EARLIER_US[sketch], rel=AS_EARLIER
    )


def test_seed_draws_the_phases():
    first, same, other = (message_times.measure(Setting("", seed=seed), CHECKED, 1) for seed in (1, 1, 2))
    assert first == same != other


def test_rows_of_sketches_that_are_not_built_are_missing_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(message_times, "FOLDER", str(tmp_path))
    monkeypatch.setattr(trials, "SEEDS", 1)
    found = turnaround.run(Setting(str(tmp_path)))
    assert {row.key for row in found.rows} == {"plain_20_ms", "checked_20_ms", "link_20_ms", "short_20_ms"}
    assert TIMING_2013.text in found.remark and "make comparison" in found.remark


def test_reply_with_other_counters_does_not_count(monkeypatch):
    monkeypatch.setattr(message_times, "PATIENCE_S", 0.01)
    with pytest.raises(BoardTimeout, match="make firmware comparison"):
        message_times.measure(Setting(""), PLAIN, 1, message_times.Counts(1, 40000))


def text(word):
    return len(word).to_bytes(4, "little") + word


def test_sketch_tells_rosserial_its_topics():
    """Id, name, type, MD5 sum and size of the buffer: rosserial_msgs/TopicInfo; 0 is a publisher, 1 a subscriber."""
    number = text(b"std_msgs/Int16") + text(b"8524586e34fbd7cb1c08c5f5f1ca0e57")
    order = text(b"std_msgs/Empty") + text(b"d41d8cd98f00b204e9800998ecf8427e")
    size = (150).to_bytes(4, "little")
    with AvrMachine(ROSSERIAL.path) as chip:
        chip.run(0.01)
        chip.send(packet(0))
        chip.run(0.05)
        said = bytes(byte.data for byte in chip.sent())
    assert said == b"".join(
        packet(kind, topic.to_bytes(2, "little") + text(name) + about + size)
        for kind, topic, name, about in (
            (0, 101, b"right", number),
            (0, 102, b"left", number),
            (1, 100, b"read_encoders", order),
        )
    )


@pytest.mark.parametrize("at", range(8))
def test_sketch_ignores_a_packet_with_a_wrong_byte(at):
    wrong = bytearray(packet(message_times.READ_TOPIC))
    wrong[at] ^= 0x01
    with AvrMachine(ROSSERIAL.path) as chip:
        chip.run(0.01)
        chip.send(bytes(wrong))
        chip.run(0.02)
        assert not chip.sent()
