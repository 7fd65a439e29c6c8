"""What `mrl` asks before a robot moves or a file is replaced, and what it says of limits."""

import json

import pytest

from mrl_driver.recording.recording import Recording

from .run import fails, mrl
from .terminal import Terminal

MOVES = [
    (("calibrate", "wiring"), "Each wheel turns forward"),
    (("calibrate", "gains"), "The robot turns in place"),
    (("calibrate", "sonar"), "The robot drives 1.80 m forward"),
    (("experiment", "power"), "drives by itself (power)"),
    (("goto", "1", "0"), "The robot drives by itself to 1 m, 0 m"),
]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def motion_of(port):
    """Requests to the motors, without stops."""
    return [frame for frame in port.board.heard if frame.code in (9, 10, 11, 12) and any(frame.args)]


@pytest.mark.parametrize(("command", "question"), MOVES)
def test_nothing_moves_without_a_terminal_or_yes(serve, here, command, question):
    port = serve()
    unseen = ["--unseen"] if command[1] == "wiring" else []
    done = mrl(*command, *unseen, "--port", port.path)
    assert done.returncode == 2 and "give --yes to agree" in done.stdout + done.stderr
    assert question in done.stdout + done.stderr and motion_of(port) == []


@pytest.mark.parametrize(("command", "question"), MOVES)
def test_nothing_moves_after_a_no(serve, here, command, question):
    port = serve()
    terminal = Terminal(*command, "--port", port.path, folder=here)
    terminal.answer(question, "n")
    assert terminal.end() == 130 and motion_of(port) == []
    if command[0] != "experiment":
        assert b"mrl: the robot was not moved" in terminal.seen


def test_the_doctor_leaves_out_the_wheels_after_a_no(serve):
    port = serve()
    terminal = Terminal("doctor", "--drive", "--port", port.path)
    terminal.answer("Are the wheels lifted off the ground?", "n")
    assert terminal.end() == 0 and motion_of(port) == [], terminal.seen.decode()
    assert b"telemetry" in terminal.seen and b"not checked" in terminal.seen


# -- limits


def test_a_speed_that_the_model_does_not_allow_is_said_to_be_limited(serve):
    done = mrl("drive", "--port", serve().path, "--linear", "5", "--angular", "1", "--for", "0.2", "--json")
    assert (
        "limited to --linear 0.3 m/s, --angular 0.06 rad/s: the model traxbot allows 0.3 m/s" in done.stderr
    )
    assert json.loads(done.stdout)["pose"]["x_m"] < 0.2


# -- recordings


@pytest.fixture(params=["drive", "monitor", "record"])
def recording(request, serve, tmp_path):
    """A command that records for a moment, and its file."""
    file, port = tmp_path / "drive.mrl", serve()
    words = {
        "drive": ("drive", "--linear", "0.1", "--for", "0.2", "--record", file),
        "monitor": ("monitor", "--seconds", "0.2", "--record", file),
        "record": ("record", "--seconds", "0.2", file),
    }
    return (*words[request.param], "--port", port.path), file


def test_a_recording_is_not_replaced_without_a_question(recording):
    command, file = recording
    file.write_text("precious\n")
    assert "already exists. Replace it?" in fails(2, *command)
    terminal = Terminal(*command)
    terminal.answer("already exists. Replace it?", "n")
    assert terminal.end() == 130 and file.read_text() == "precious\n"


def test_a_recording_is_replaced_with_yes_and_an_empty_file_always(recording):
    command, file = recording
    file.touch()
    assert mrl(*command).returncode == 0 and list(Recording(str(file)))
    assert mrl(*command, "--yes").returncode == 0
