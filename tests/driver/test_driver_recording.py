"""What a driver records while it drives."""

import subprocess
import sys
import threading
import time

import pytest

from mrl_driver.driver import Driver, Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.errors import ConfigError, PortMissing
from mrl_driver.recording.recording import FROM_BOARD, TO_BOARD, Recording
from mrl_driver.recording.summary import summarise
from mrl_driver.transport.link import SerialLink
from tests.waiting import PATIENCE_S, drive_until, wait_until


@pytest.fixture
def recorded(serve, tmp_path):
    """Entries of a short drive, and the board that it was with."""
    board, path = serve(), str(tmp_path / "drive.mrl")
    with Driver(board.path, options=Options(record=path, command_timeout_s=None)) as robot:
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.01)
    recording = Recording(path)
    return list(recording), board, recording


def joined(entries, way):
    return b"".join(entry.data for entry in entries if entry.direction == way)


def test_what_went_to_the_board_is_recorded(recorded):
    entries, board, _ = recorded
    wait_until(lambda: bytes(board.received) == joined(entries, TO_BOARD))


def test_a_summary_counts_the_frames_that_the_driver_counted(prompt, serve, tmp_path):
    """Also those around the beginning and the end of the check value, which the remark comes behind."""
    board, path = serve(), str(tmp_path / "drive.mrl")
    with Driver(board.path, options=Options(record=path)) as robot:
        wait_until(lambda: robot.link.statistics.frames > 20)
        board.board.reset(time.monotonic())
        wait_until(lambda: robot.link.statistics.restarts == 1 and robot.ready)
        before = robot.link.statistics
        wait_until(lambda: robot.link.statistics.frames > before.frames + 20)
    found = summarise(Recording(path))
    assert found["garbage"] == {}
    assert sum(found["frames"].values()) == robot.link.statistics.frames


def test_a_summary_counts_what_was_read_while_the_driver_closed(serve, tmp_path, monkeypatch):
    """The reading thread has a frame in hand when the driver is closed."""
    path, close = str(tmp_path / "drive.mrl"), SerialLink.close
    leaving, held, closed = threading.Event(), threading.Event(), threading.Event()
    monkeypatch.setattr(SerialLink, "close", lambda link: (closed.set(), close(link)))

    def hold(way, data):
        if leaving.is_set() and way == FROM_BOARD and b"e" in data:
            held.set()
            assert closed.wait(PATIENCE_S)

    robot, heard, replayed = Driver(serve().path, options=Options(record=path, tap=hold)), [], []
    robot.on_telemetry(heard.append)
    robot.connect()
    leaving.set()
    wait_until(held.is_set)
    robot.close()
    assert sum(summarise(Recording(path))["frames"].values()) == robot.link.statistics.frames
    played = RecordedDriver(path)
    played.on_telemetry(replayed.append)
    played.play()
    assert replayed == heard and played.link.statistics.frames == robot.link.statistics.frames


def test_a_full_disk_does_not_stop_the_robot(serve):
    with Driver(serve().path, options=Options(record="/dev/full", command_timeout_s=None)) as robot:
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.01 and robot.recorder.file.lost > 10)
        assert robot.command is not None
        assert "No space" in robot.recorder.file.error


def test_a_file_that_cannot_be_made_is_refused_before_the_port_is_opened(tmp_path):
    with pytest.raises(ConfigError, match="cannot record to"):
        Driver("/dev/nothing", options=Options(record=str(tmp_path))).connect()


def test_an_open_link_is_not_recorded(serve, tmp_path):
    link = SerialLink(serve().path)
    with pytest.raises(ConfigError, match="with an open link"):
        Driver(link, options=Options(record=str(tmp_path / "x")))
    link.close()


def test_a_port_that_is_not_there_leaves_no_thread(tmp_path):
    before = set(threading.enumerate())
    with pytest.raises(PortMissing):
        Driver("/dev/nothing", options=Options(record=str(tmp_path / "x"))).connect()
    assert not [each for each in set(threading.enumerate()) - before if each.name == "recorder"]


# -- as a command


def mrl(*args):
    command = [sys.executable, "-m", "mrl_driver", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)


@pytest.mark.parametrize(
    "command",
    [
        ("record", "--seconds", "0.3", "FILE"),
        ("monitor", "--seconds", "0.3", "--record", "FILE"),
        ("drive", "--linear", "0.1", "--for", "0.3", "--record", "FILE"),
    ],
    ids=lambda command: command[0],
)
def test_commands_record(serve, tmp_path, command):
    path = tmp_path / "drive.mrl"
    name, *rest = (str(path) if word == "FILE" else word for word in command)
    done = mrl(name, "--port", serve().path, *rest)
    assert done.returncode == 0, done.stderr
    assert len(list(Recording(str(path)))) > 10
