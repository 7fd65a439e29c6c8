"""What a driver records while it drives, and recordings that begin and end while it is connected."""

import json
import threading
import time

import pytest

from mrl_driver.apps.review import drive_data
from mrl_driver.driver import Driver, Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.errors import ConfigError, PortMissing
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.recording import FROM_BOARD, TO_BOARD, Recording
from mrl_driver.transport.link import SerialLink
from tests.call_lists import CallLists
from tests.waiting import PATIENCE_S, drive_until, wait_until

from .test_call_path import READ

LASTING = Options(command_timeout_s=None)
PIECE, PIECE_S = 5, 0.002
POSE_ERROR_M = 1e-9
SONARS = BY_NAME["read_sonars"].code  # A request that the driver never sends by itself to this board


@pytest.fixture
def files(tmp_path):
    return [str(tmp_path / name) for name in ("one.mrl", "two.mrl")]


@pytest.fixture
def pieces(monkeypatch):
    """The driver reads a few bytes at a time, so that most reads end within a frame; all that it has read."""
    read, waiting, seen = SerialLink.read, bytearray(), bytearray()

    def read_piece(link, timeout_s):
        if not waiting:
            waiting.extend(read(link, timeout_s))
        else:
            time.sleep(PIECE_S)
        data = bytes(waiting[:PIECE])
        del waiting[:PIECE]
        seen.extend(data)
        return data

    monkeypatch.setattr(SerialLink, "read", read_piece)
    return seen


def joined(entries, way):
    return b"".join(entry.data for entry in entries if entry.direction == way)


def frames_later(robot, number=5):
    """Wait until the driver has read so many more frames."""
    before = robot.link.statistics.frames
    wait_until(lambda: robot.link.statistics.frames >= before + number)


def record(robot, path):
    robot.recorder.start(path)
    frames_later(robot)
    return robot.recorder.stop()


def test_the_path_in_it_is_that_of_the_driver(serve, files):
    """As of a recording from the start: model and capabilities of the board are in it."""
    with Driver(serve().path, options=LASTING) as robot:
        frames_later(robot)
        robot.recorder.start(files[0])
        frames_later(robot, 10)
        robot.reset_pose()
        drive_until(robot, 0.2, 0.1, lambda: robot.pose.x_m > 0.02)
        robot.stop()
        wait_until(lambda: robot.stopped)
        frames_later(robot)
        pose = robot.pose
        assert robot.recorder.stop() == ""
    found = drive_data.read(RecordedDriver(files[0]))
    assert found.model.name == "traxbot" and "sonars" in found.board.capabilities
    assert tuple(found.poses.values[-1]) == pytest.approx(pose, abs=POSE_ERROR_M)


def test_no_byte_from_the_board_is_lost_or_doubled(serve, files, pieces):
    with Driver(serve().path, options=LASTING) as robot:
        for path in files:
            frames_later(robot)
            record(robot, path)
    first, second = (joined(Recording(path), FROM_BOARD) for path in files)
    at = pieces.find(first)
    assert at > 0 and pieces.find(second, at + len(first)) > 0


def test_what_is_sent_right_after_it_began_is_in_it(serve, files):
    with Driver(serve().path, options=LASTING) as robot:
        for _ in range(10):
            robot.recorder.start(files[0])
            robot.request(SONARS)
            frames_later(robot, 1)  # the reading thread may send it
            robot.recorder.stop()
            assert b"@%d," % SONARS in joined(Recording(files[0]), TO_BOARD)


def test_it_begins_with_a_whole_frame(serve, files, pieces):
    with Driver(serve().path) as robot:
        for _ in range(10):
            frames_later(robot, 1)
            record(robot, files[0])
            found = summarise(RecordedDriver(files[0]))
            assert found["garbage"] == {} and sum(found["frames"].values()) >= 5
            assert joined(Recording(files[0]), FROM_BOARD).lstrip(b"\r\n")[:1] == b"@"


def test_another_one_can_begin_only_when_the_first_has_ended(serve, files):
    with Driver(serve().path, options=Options(record=files[0])) as robot:
        with pytest.raises(ConfigError, match=r"one\.mrl is being recorded; stop that recording first"):
            robot.recorder.start(files[1])
        robot.recorder.stop()
        record(robot, files[1])
        with pytest.raises(ConfigError, match="no recording is running"):
            robot.recorder.stop()
        assert robot.recorder.file is None


def test_a_file_that_cannot_be_made_leaves_the_robot_driving(serve, tmp_path):
    with Driver(serve().path, options=LASTING) as robot:
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.01)
        with pytest.raises(ConfigError):
            robot.recorder.start(str(tmp_path))
        frames_later(robot)
        assert robot.command is not None and robot.recorder.file is None


def test_without_one_no_frame_passes_through_it(serve, files):
    """Neither before the first one, nor after the last one."""
    lists, steps = CallLists(READ).install(), []
    try:
        with Driver(serve().path) as robot:
            for path in files:
                frames_later(robot)
                lists.steps.clear()
                frames_later(robot)
                steps += lists.steps
                record(robot, path)
                frames_later(robot)
    finally:
        lists.remove()
    calls = {call for step in steps for call in step.calls}
    assert "mrl_driver/protocol/decoder.py:feed" in calls
    assert not [call for call in calls if call.startswith("mrl_driver/recording/")]


def test_readings_of_a_phone_are_read_back_and_change_nothing_else(serve, files):
    reading = {"t": 1.5, "alpha": 90.0, "name": "Zoë\n"}
    with Driver(serve().path) as robot:
        robot.recorder.remark("phone {}")
        robot.recorder.start(files[0])
        robot.recorder.remark("phone " + json.dumps(reading))
        robot.recorder.remark("phone no JSON")
        frames_later(robot)
    phone = [entry.data[6:] for entry in Recording(files[0]) if entry.data.startswith(b"phone ")]
    assert json.loads(phone[0]) == reading and phone[1:] == [b"no JSON"]
    assert summarise(RecordedDriver(files[0]))["lost"] == 0


@pytest.mark.parametrize("text", ["", "checked", "plain", "opened /dev/ttyACM0", "x" * 1001])
def test_a_remark_that_would_be_taken_for_the_drivers_own_is_refused(text):
    with pytest.raises(ConfigError, match="expected 1 to 1000 characters"):
        Driver("/dev/nothing").recorder.remark(text)


@pytest.fixture
def recorded(serve, tmp_path):
    """Entries of a short drive, and the board that it was with."""
    board, path = serve(), str(tmp_path / "drive.mrl")
    with Driver(board.path, options=Options(record=path, command_timeout_s=None)) as robot:
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.01)
    recording = Recording(path)
    return list(recording), board, recording


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
    found = summarise(RecordedDriver(path))
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
    assert sum(summarise(RecordedDriver(path))["frames"].values()) == robot.link.statistics.frames
    played = RecordedDriver(path)
    played.on_telemetry(replayed.append)
    played.play()
    assert replayed == heard and played.link.statistics.frames == robot.link.statistics.frames


def test_a_full_disk_does_not_stop_the_robot(serve):
    with Driver(serve().path, options=Options(record="/dev/full", command_timeout_s=None)) as robot:
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 0.01 and robot.recorder.file.lost > 10)
        assert robot.command is not None
        assert "No space" in robot.recorder.file.error


def test_a_file_that_cannot_be_made_is_refused_before_anything_is_sent(serve, tmp_path):
    board = serve()
    with pytest.raises(ConfigError, match="cannot record to"):
        Driver(board.path, options=Options(record=str(tmp_path))).connect()
    assert not board.received
    SerialLink(board.path).close()


def test_an_open_link_is_not_recorded(serve, tmp_path):
    link = SerialLink(serve().path)
    with pytest.raises(ConfigError, match="with an open link"):
        Driver(link, options=Options(record=str(tmp_path / "x")))
    link.close()


def test_a_port_that_cannot_be_opened_leaves_no_thread_and_the_old_recording(tmp_path):
    before, file = set(threading.enumerate()), tmp_path / "x"
    file.write_text("of yesterday")
    with pytest.raises(PortMissing):
        Driver("/dev/nothing", options=Options(record=str(file))).connect()
    assert not [each for each in set(threading.enumerate()) - before if each.name == "recorder"]
    assert file.read_text() == "of yesterday"
