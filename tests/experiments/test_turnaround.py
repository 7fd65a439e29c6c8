"""The times of messages: ours beside two sketches, on the simulated chip.  `make comparison` builds the sketches."""

from statistics import median

import pytest

from sim_arduino.experiments import experiment_report, turnaround
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.turnaround import ROSSERIAL, TIMING_2013

EARLIER_US = {TIMING_2013: 2445.0, ROSSERIAL: 2896.0}
"""Turnaround of the released firmware and of ros_lib: README, "The firmware, measured" [us]."""
AS_EARLIER = 0.03
MESSAGES = 3


def test_messages_take_less_time_than_those_of_the_sketch_in_the_same_mode(tmp_path, monkeypatch):
    """rosserial has the same baud rate."""
    monkeypatch.setattr(experiment_report, "SEEDS", 1)
    result = turnaround.run(Setting(str(tmp_path)))
    assert result.pictures == ["turnaround.png"]
    rows = {row.key: row for row in result.rows}
    for row in (rows["plain_20_ms"], rows["checked_20_ms"]):
        assert row.ours <= row.worst < row.control
    assert rows["checked_20_ms"].control == rows["rosserial_115200_20_ms"].ours
    link_ms = rows["link_20_ms"].ours
    assert turnaround.PUBLISHED_MS * (1 - turnaround.LESS) < link_ms < rows["plain_20_ms"].ours


@pytest.mark.parametrize("sketch", EARLIER_US, ids=lambda sketch: sketch.key)
def test_sketch_needs_the_time_of_the_earlier_measurement(sketch):
    found = turnaround.measure(Setting(""), sketch, MESSAGES)
    assert 1e6 * median(message.reply_s for message in found) == pytest.approx(
        EARLIER_US[sketch], rel=AS_EARLIER
    )


def test_rows_of_sketches_that_are_not_built_are_missing_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(turnaround, "FOLDER", tmp_path)
    monkeypatch.setattr(experiment_report, "SEEDS", 1)
    found = turnaround.run(Setting(str(tmp_path)))
    assert {row.key for row in found.rows} == {"plain_20_ms", "checked_20_ms", "link_20_ms", "short_20_ms"}
    assert TIMING_2013.text in found.remark and "make comparison" in found.remark
