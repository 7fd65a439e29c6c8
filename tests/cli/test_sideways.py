"""`mrl` with a robot that moves sideways, and with one that does not."""

import json

import pytest

from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.recording.recording import Recording
from mrl_driver.recording.summary import summarise
from mrl_driver.review import drive_data
from mrl_driver.terminal.teleop_keys import HOLD_S, LINEAR_M_S, Teleop

from .run import fails, mrl


@pytest.mark.emulated_board(robot="omni")
def test_a_timed_drive_to_the_left(emulated_board, tmp_path):
    """The model is found by the board's id; JSON tells the lateral speed as well, and the recording where it went."""
    log = tmp_path / "left.mrllog"
    done = mrl(
        "drive", "--port", emulated_board.port, "--lateral", "0.3", "--for", "1", "--json", "--record", log
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["pose"]["y_m"] > 0.1 > abs(told["pose"]["x_m"])
    assert set(told["twist"]) == {"linear_m_s", "angular_rad_s", "lateral_m_s"}
    there = Recording(str(log))
    assert summarise(there)["pose"] == pytest.approx(told["pose"], abs=2e-4)
    seen = drive_data.read(RecordedDriver(there))
    assert tuple(seen.poses.values[-1]) == pytest.approx(tuple(told["pose"].values()), abs=2e-4)
    assert len(seen.ranges["front"].time_s) and [0.0, 0.0, 0.0] in seen.commands.values.tolist()
    assert "sideways" in mrl("monitor", "--port", emulated_board.port, "--seconds", "0.2").stdout


@pytest.mark.emulated_board(robot="traxbot")
def test_two_wheels_say_that_they_cannot(emulated_board):
    line = fails(12, "drive", "--port", emulated_board.port, "--lateral", "0.1", "--for", "1")
    assert "a differential base cannot move sideways (0.1 m/s requested)" in line


def test_keys_slide():
    teleop = Teleop()
    teleop.press(",", 0.0)
    assert teleop.slide(0.1) == LINEAR_M_S and teleop.command(0.1) == (0.0, 0.0)
    teleop.press(".", 0.2)
    assert teleop.slide(0.3) == -LINEAR_M_S
    assert teleop.slide(0.2 + HOLD_S) == 0.0
